"""A contact sheet of training data, as `fig2mesh data show` writes it.

One row per body: its pictures from four sides, or the visible part masks put together where it has none; part labels
and depth of the front; visible masks of some parts; its skeleton.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from exporters.atomic_file import atomic_path
from fig2mesh.errors import InputError, OutputError
from fig2mesh.field.camera import VIEW_YAW_DEG, axes
from fig2mesh.skeleton import BODY_PARTS, BONES, JOINT, PART
from fig2mesh.training.drawing.marks import FloatImage, composite, stroke

TILE: Final = 112
"""Edge of one picture on the sheet, pixels."""
REACH: Final = 1.15
"""Half the extent of a tile without a frame of its own, FIGURE units, about the pelvis or the joints' middle."""
SHOWN: Final = ("torso", "head", "l_hand", "l_upper_leg", "r_foot")
"""The parts whose masks are shown."""
EMPTY, PAPER, INK = 226.0, 250.0, (40.0, 40.0, 46.0)
SIDE_INK: Final = {"l": (40.0, 80.0, 220.0), "r": (220.0, 50.0, 40.0)}

FIELDS: Final = ("joints", "centre", "edge", "mask_amodal", "mask_visible", "picture", "labels", "depth")
"""Arrays shown on the sheet; the first five are required."""
REMEDY: Final = "make the data again with `fig2mesh data build`"

Body = dict[str, NDArray[Any]]
"""One body: the arrays of the training data without their first axis."""


def make_sheet(data: Path, out: Path, count: int = 24) -> Path:
    """Write a contact sheet (PNG) of bodies spread evenly over the training data.

    data : a shard (.npz), or the folder that holds shards
    out : PNG file; count : maximum number of bodies
    """
    from PIL import Image

    rows = [np.concatenate(_tiles(body), axis=1) for body in _bodies(Path(data), count)]
    sheet = np.concatenate(rows, axis=0)
    out = Path(out)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(out) as partial:
            Image.fromarray(np.clip(np.rint(sheet), 0, 255).astype(np.uint8)).save(partial, format="PNG")
    except (OSError, ValueError) as error:
        raise OutputError(out, f"cannot be written ({error})", "name a .png file in a writable folder") from error
    return out


def part_colours() -> NDArray[np.float32]:
    """(18, 3) float32 0-255, one per label: left parts cool, right parts warm, neighbours far apart."""
    colours = np.full((18, 3), PAPER, np.float32)
    colours[1:3] = (120, 170, 110), (232, 190, 90)
    for pair in range(6):
        share = (pair % 3) / 2 * 0.55
        base = (
            np.array([[70, 120, 214], [222, 96, 70]], float) if pair < 3 else np.array([[40, 150, 170], [176, 60, 130]])
        )
        colours[3 + 2 * pair : 5 + 2 * pair] = base + (255 - base) * share
    colours[15:] = (100, 70, 50), (170, 150, 200), (120, 120, 120)
    return colours


def compose(centre: Any, edge: Any, masks: NDArray[np.uint8], view: str, size: int = TILE) -> NDArray[np.uint8]:
    """(size, size) uint8 part labels of a view, composed from the parts' masks; `REACH` about the origin.

    centre : (14, 3), edge : (14,) FIGURE, front view; masks : (14, 64, 8) uint8, packed, of this view
    """
    labels = np.zeros((size, size), np.uint8)
    place = (np.arange(size) + 0.5) / size * 2 * REACH - REACH
    middles = np.asarray(centre, float) @ axes(VIEW_YAW_DEG[view]).T
    for index, part in enumerate(BODY_PARTS):
        mask = np.unpackbits(masks[index], axis=-1).astype(bool)
        cells = mask.shape[0]
        column = np.floor(((place - middles[index, 0]) / edge[index] + 0.5) * cells).astype(int)
        row = np.floor((0.5 - (-place - middles[index, 1]) / edge[index]) * cells).astype(int)
        inside = ((row >= 0) & (row < cells))[:, None] & ((column >= 0) & (column < cells))
        hit = mask[np.clip(row, 0, cells - 1)[:, None], np.clip(column, 0, cells - 1)]
        labels[inside & hit] = part
    return labels


def _tiles(arrays: Body) -> list[FloatImage]:
    """(TILE, TILE, 3) pictures of one row."""
    colours = part_colours()
    visible = arrays["mask_visible"]
    labels = [compose(arrays["centre"], arrays["edge"], visible[v], view) for v, view in enumerate(VIEW_YAW_DEG)]
    if "picture" in arrays:
        tiles = [_fit(picture.astype(np.float32)) for picture in arrays["picture"]]
    elif "labels" in arrays:
        tiles = [_fit(colours[np.minimum(own, 17)]) for own in arrays["labels"]]
    else:
        tiles = [colours[own] for own in labels]
    front = _fit(colours[np.minimum(arrays["labels"][0], 17)]) if "labels" in arrays else colours[labels[0]]
    tiles += [front, _depth(arrays["depth"][0]) if "depth" in arrays else np.full((TILE, TILE, 3), EMPTY, np.float32)]
    for name in SHOWN:
        whole, seen = (
            np.unpackbits(arrays[kind][0, PART[name] - 1], axis=-1).astype(np.float32)
            for kind in ("mask_amodal", "mask_visible")
        )
        # Hidden: pale. Seen: the part's colour.
        mask = composite(np.full((*seen.shape, 3), PAPER, np.float32), (200, 200, 204), whole)
        tiles.append(_fit(composite(mask, colours[PART[name]], seen)))
    tiles.append(
        _skeleton(
            composite(colours[labels[0]], (255, 255, 255), np.full((TILE, TILE), 0.55, np.float32)), arrays["joints"]
        )
    )
    for tile in tiles:
        tile[-1:], tile[:, -1:] = EMPTY - 40, EMPTY - 40
    return tiles


def _skeleton(picture: FloatImage, joints: NDArray[Any]) -> FloatImage:
    """Draw the body's joints over the picture of the front: left blue, right red."""
    scale = TILE / (2 * REACH)
    pixels = np.stack([(joints[:, 0] + REACH) * scale, (REACH - joints[:, 1]) * scale], axis=1)
    for start, end in BONES:
        line = np.zeros(picture.shape[:2], np.float32)
        stroke(line, pixels[[JOINT[start], JOINT[end]]], 1.3)
        stroke(line, pixels[JOINT[end]], 3.2)
        picture = composite(picture, SIDE_INK.get(end[0], INK) if end[1] == "_" else INK, line)
    return picture


def _depth(depth: NDArray[Any]) -> FloatImage:
    """Depth as grey: near is light, far is dark, nothing is paper."""
    depth = np.asarray(depth, np.float32)
    seen = np.isfinite(depth)
    grey = np.full(depth.shape, PAPER, np.float32)
    if seen.any():
        low, high = depth[seen].min(), depth[seen].max()
        grey[seen] = 30 + 190 * (depth[seen] - low) / max(float(high - low), 1e-6)
    return _fit(np.repeat(grey[..., None], 3, axis=2))


def _fit(picture: FloatImage) -> FloatImage:
    """Resize a picture to TILE x TILE by area averaging, so that thin lines stay."""
    for axis in (0, 1):
        count = picture.shape[axis]
        edges = np.linspace(0, count, TILE + 1)
        sums = np.concatenate(
            [np.zeros_like(picture.take([0], axis)), np.cumsum(picture, axis=axis, dtype=np.float64)], axis
        )
        low = np.minimum(edges.astype(int), count - 1)
        part = np.moveaxis((edges - low).reshape(-1, *[1] * (picture.ndim - 1)), 0, axis)
        at = sums.take(low, axis) * (1 - part) + sums.take(low + 1, axis) * part
        picture = np.asarray(np.diff(at, axis=axis) / (count / TILE), np.float32)
    return picture


def _bodies(data: Path, count: int) -> list[Body]:
    """Read at most `count` bodies, spread evenly over the shards."""
    shards = sorted(data.glob("*-?????.npz")) if data.is_dir() else [data]
    sizes = []
    for shard in shards:
        try:
            with np.load(shard) as file:
                sizes.append(len(file["joints"]))
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
            raise InputError(shard, f"not a readable shard of training data ({error})", REMEDY) from error
    total = sum(sizes)
    if not total or count < 1:
        raise InputError(data, "no bodies in it" if count > 0 else f"{count} bodies requested", REMEDY)
    wanted = np.unique(np.linspace(0, total - 1, min(count, total)).astype(int))
    starts = np.cumsum([0, *sizes])
    out: list[Body] = []
    for shard, first, last in zip(shards, starts[:-1], starts[1:], strict=True):
        rows = wanted[(wanted >= first) & (wanted < last)] - first
        if len(rows):
            with np.load(shard) as file:
                arrays = {name: file[name][rows] for name in FIELDS if name in file.files}
            if missing := [name for name in FIELDS[:5] if name not in arrays]:
                raise InputError(shard, f"no {', '.join(missing)} in it", REMEDY)
            out += [{name: array[i] for name, array in arrays.items()} for i in range(len(rows))]
    return out
