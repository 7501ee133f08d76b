"""Silhouette, part labels and joints of one figure from the bare picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parse.joints import decode, doubts, visible_inside
from fig2mesh.parse.silhouette import refine
from fig2mesh.records import BoolArray, ByteArray, FloatArray
from fig2mesh.skeleton import JOINT_MIRROR, PART_MIRROR, PART_NAMES

ROOM: Final = 0.12
"""Space round the figure in the second look, share of its size."""

DARK: Final = 70
SAME: Final = 12
PLAIN_RIM: Final = 0.7
"""A ground is plain and dark where this share of the picture's rim is within `SAME` of a colour darker than `DARK`."""

FINEST: Final = 320
"""Cells a side in which part labels are told apart; the network's own are a third as fine."""

REMEDY: Final = "look at what `fig2mesh parse` writes, correct keypoints.json or mask.png, and pass them"


@dataclass(frozen=True)
class Inference:
    """What was found, IMAGE.

    mask : (H, W) bool; part_labels : (H, W) uint8, `PART_NAMES`, 0 outside the mask
    joints_px : (21, 2) float32; visible : (21,) bool; confidence : (21,) float32, 0-1
    doubts : what is unlikely about it, in words
    """

    mask: BoolArray
    part_labels: ByteArray
    joints_px: FloatArray
    visible: BoolArray
    confidence: FloatArray
    doubts: tuple[str, ...]


class Look(NamedTuple):
    """What the network says of a square of the picture.

    likely : (n, n) of the figure, 0-1; labels : (18, n, n) 0-1; heat : (21, m, m), 1 in sum; visible : (21,) 0-1
    low, edge : upper left corner (x, y) and edge of the square, pixels
    """

    likely: FloatArray
    labels: FloatArray
    heat: FloatArray
    visible: FloatArray
    low: NDArray[np.float64]
    edge: float


def infer_figure(rgb: ByteArray, mask: BoolArray | None = None) -> Inference | None:
    """The figure in a picture; None where the network sees none.

    rgb : (H, W, 3) uint8, a crop with one figure; mask : its silhouette, where that is known
    """
    height, width = rgb.shape[:2]
    shown = on_light(rgb)
    if mask is None:
        first = look(shown, np.array([width, height]) / 2, 1.04 * max(height, width))
        box = box_of(first, (height, width))
        if box is None:
            return None
    else:
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        box = np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1], float)
    second = look(shown, (box[:2] + box[2:]) / 2, (1 + 2 * ROOM) * float((box[2:] - box[:2]).max()))
    likely = spread(second.likely, second, (height, width))
    found = refine(rgb, likely) if mask is None else mask
    if not found.any():
        return None
    rows = np.flatnonzero(found.any(axis=1))
    columns = np.flatnonzero(found.any(axis=0))
    tall_px = float(max(rows[-1] - rows[0], columns[-1] - columns[0]) + 1)
    places, sure = decode(second.heat, tall_px / second.edge)
    joints = visible_inside(second.low + places * second.edge, found, tall_px)
    joints = np.clip(joints, 0, [width, height])
    visible = second.visible > 0.5
    said = doubts(joints, sure, visible, found)
    outside = float((found & (likely < 0.5)).sum() + (~found & (likely > 0.5)).sum()) / float(found.sum())
    if mask is None and outside > 0.35:
        said.append("the silhouette is unsure")
    return Inference(
        mask=found,
        part_labels=part_labels(second, found),
        joints_px=joints.astype(np.float32),
        visible=visible,
        confidence=sure.astype(np.float32),
        doubts=tuple(said),
    )


def on_light(rgb: ByteArray) -> ByteArray:
    """The picture with a plain dark ground made white: the network has learned from light ones."""
    rim = np.concatenate([rgb[0], rgb[-1], rgb[:, 0], rgb[:, -1]]).astype(np.int16)
    colour = np.median(rim, axis=0)
    if colour.mean() > DARK or (np.abs(rim - colour).max(axis=1) <= SAME).mean() < PLAIN_RIM:
        return rgb
    ground = (np.abs(rgb.astype(np.int16) - colour) <= SAME).all(axis=2)
    regions, _ = ndimage.label(ground)
    ends = np.unique(np.concatenate([regions[0], regions[-1], regions[:, 0], regions[:, -1]]))
    outside = np.isin(regions, ends[ends > 0])
    return np.where(outside[..., None], np.uint8(255), rgb)


def look(rgb: ByteArray, centre: NDArray[np.floating], edge: float) -> Look:
    """The network's answer on a square of the picture, mean of the picture as it is and mirrored."""
    import torch

    from fig2mesh.nets import figure_parser

    low = np.asarray(centre, float) - edge / 2
    picture = square(rgb, low, edge, figure_parser.INPUT).astype(np.float32) / 255
    batch = torch.from_numpy(np.stack([picture, picture[:, ::-1]]).transpose(0, 3, 1, 2).copy())
    net = figure_parser.PARSER_WEIGHTS.shipped(figure_parser.SHIPPED)
    with torch.inference_mode():
        found = net(batch.contiguous(memory_format=torch.channels_last))
    likely = found.silhouette.sigmoid().numpy()
    labels = found.labels.softmax(dim=1).numpy()
    heat = found.heat.flatten(2).softmax(dim=2).reshape(found.heat.shape).numpy()
    visible = found.visible.sigmoid().numpy()
    return Look(
        likely=(likely[0] + likely[1][:, ::-1]) / 2,
        labels=(labels[0] + labels[1][list(PART_MIRROR)][:, :, ::-1]) / 2,
        heat=(heat[0] + heat[1][list(JOINT_MIRROR)][:, :, ::-1]) / 2,
        visible=(visible[0] + visible[1][list(JOINT_MIRROR)]) / 2,
        low=low,
        edge=edge,
    )


def square(rgb: ByteArray, low: NDArray[np.floating], edge: float, size: int) -> ByteArray:
    """(size, size, 3) a square of the picture; beyond the picture its rim's median colour."""
    from PIL import Image

    height, width = rgb.shape[:2]
    rim = np.concatenate([rgb[0], rgb[-1], rgb[:, 0], rgb[:, -1]])
    left, top = int(np.floor(low[0])), int(np.floor(low[1]))
    right, bottom = int(np.ceil(low[0] + edge)), int(np.ceil(low[1] + edge))
    canvas = np.empty((bottom - top, right - left, 3), np.uint8)
    canvas[:] = np.median(rim, axis=0)
    y0, y1, x0, x1 = max(top, 0), min(bottom, height), max(left, 0), min(right, width)
    if y0 < y1 and x0 < x1:
        canvas[y0 - top : y1 - top, x0 - left : x1 - left] = rgb[y0:y1, x0:x1]
    box = (low[0] - left, low[1] - top, low[0] - left + edge, low[1] - top + edge)
    return np.asarray(
        Image.fromarray(canvas).resize(
            (size, size), Image.Resampling.BOX if edge > 2 * size else Image.Resampling.BILINEAR, box=box
        )
    )


def spread(values: FloatArray, seen: Look, shape: tuple[int, int]) -> FloatArray:
    """(H, W) values of a look's cells (n, n) at the picture's pixels; 0 outside the square."""
    size = values.shape[-1]
    grid = [
        ((np.arange(length) + 0.5 - low) / seen.edge * size) - 0.5
        for length, low in zip(shape, seen.low[::-1], strict=True)
    ]
    rows, columns = np.meshgrid(*grid, indexing="ij")
    out = ndimage.map_coordinates(values, [rows, columns], order=1, mode="constant", cval=0.0)
    # The rim's half cells count as their cell.
    edge = ((rows > -1) & (rows < size) & (columns > -1) & (columns < size)) & ~(
        (rows >= 0) & (rows <= size - 1) & (columns >= 0) & (columns <= size - 1)
    )
    if edge.any():
        near = ndimage.map_coordinates(values, [rows[edge], columns[edge]], order=1, mode="nearest")
        out[edge] = near
    return np.asarray(out, np.float32)


def part_labels(seen: Look, mask: BoolArray) -> ByteArray:
    """(H, W) uint8, the likeliest part of each pixel of the mask."""
    height, width = mask.shape
    step = max(1, round(seen.edge / FINEST))
    shape = (-(-height // step), -(-width // step))
    coarse = seen._replace(low=seen.low / step, edge=seen.edge / step)
    best, label = np.full(shape, -1.0, np.float32), np.zeros(shape, np.uint8)
    for part in range(1, len(PART_NAMES)):
        if seen.labels[part].max() < 0.1:
            continue
        likely = spread(seen.labels[part], coarse, shape)
        better = likely > best
        best[better], label[better] = likely[better], part
    out = label[np.arange(height)[:, None] // step, np.arange(width) // step]
    return np.where(mask, out, 0).astype(np.uint8)


def box_of(seen: Look, shape: tuple[int, ...]) -> NDArray[np.float64] | None:
    """(4,) x0, y0, x1, y1 of the figure in the picture: its largest piece with what is near, and its joints."""
    guess = seen.likely > 0.5
    regions, count = ndimage.label(ndimage.binary_dilation(guess, iterations=2))
    if not count:
        return None
    index = np.arange(1, count + 1)
    mass = ndimage.sum_labels(seen.likely, regions, index)
    kept = np.isin(regions, index[mass > 0.15 * mass.max()]) & guess
    rows, columns = np.nonzero(kept)
    size = guess.shape[0]
    low = np.array([columns.min(), rows.min()]) / size
    high = np.array([columns.max() + 1, rows.max() + 1]) / size
    places, sure = decode(seen.heat, float((high - low).max()))
    good = places[sure > 0.4]
    if len(good):
        low, high = np.minimum(low, good.min(axis=0) - 0.02), np.maximum(high, good.max(axis=0) + 0.02)
    bounds = np.array([*(seen.low + low * seen.edge), *(seen.low + high * seen.edge)])
    limits = np.array([shape[1], shape[0]] * 2, float)
    return np.asarray(np.clip(bounds, 0, limits))
