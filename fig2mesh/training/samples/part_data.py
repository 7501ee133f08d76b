"""One kind of body part from the training shards, in memory: left parts, and right ones mirrored."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import ANCHORS, MIRRORED, PART_KIND, anchor_joints
from fig2mesh.training.samples.build import read_shard, shards

VIEWS: Final = 4
"""Front, left, back, right: yaw 0, 90, 180, 270 degrees."""
MASKS: Final = ("amodal", "visible")
HELD_OUT: Final = ("valid-clips", "valid-characters")
MIRROR: Final = np.array((-1, 1, 1), np.float32)
VIEW_IN_MIRROR: Final = [0, 3, 2, 1]
"""The mirror image of a figure seen from its left is the mirror image of its view from the right."""


@dataclass(frozen=True)
class PartData:
    """I parts of one kind, front view, PART coordinates; right ones mirrored.

    anchors : (I, A, 3) float32
    points : (I, P, 3) float16, the first half inside; distance : (I, P) float16, PART units
    masks : (I, 4, 2, 64, 8) uint8, packed rows, [view, amodal|visible]
    grid : (I, n, n, n) float16 PART units, [x, y, z], or None
    body : (I,) index of the body
    """

    kind: str
    anchors: NDArray[np.float32]
    points: NDArray[np.float16]
    distance: NDArray[np.float16]
    masks: NDArray[np.uint8]
    grid: NDArray[np.float16] | None
    body: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.anchors)

    def mask(self, items: NDArray[np.integer], views: NDArray[np.integer], which: str) -> NDArray[np.bool_]:
        """(B, 64, 64) masks of items in their views."""
        return np.unpackbits(self.masks[items, views, MASKS.index(which)], axis=-1).astype(np.bool_)


def turned(points: NDArray[np.floating], views: NDArray[np.integer]) -> NDArray[np.float32]:
    """(B, N, 3) points as seen in view 0-3 of each row: `points @ axes(90 view).T`, exactly."""
    points = np.asarray(points, np.float32)
    view = np.asarray(views)[:, None, None]
    x, y, z = points[..., :1], points[..., 1:2], points[..., 2:]
    right = np.choose(view, [x, -z, -x, z])
    back = np.choose(view, [z, x, -z, -x])
    return np.concatenate([right, y, back], -1)


def turned_grid(grid: NDArray[np.floating], view: int) -> NDArray[np.floating]:
    """Field on a grid [x, y, z] as seen in view 0-3."""
    return np.rot90(grid, view, axes=(0, 2))


def swapped(anchors: NDArray[np.float32], kind: str) -> NDArray[np.float32]:
    """(..., A, 3) mirrored anchors of a part on the middle line; left and right exchange places."""
    order = [1, 0, 3, 2] if kind == "torso" else list(range(len(ANCHORS[kind])))
    return np.asarray(anchors[..., order, :] * MIRROR, np.float32)


def mirrored_masks(masks: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(I, 4, 2, 64, 8) packed masks of the mirrored figure."""
    return np.packbits(np.unpackbits(masks[:, VIEW_IN_MIRROR], axis=-1)[..., ::-1], axis=-1)


def load_parts(
    data: Path, kind: str, split: str, *, max_bodies: int | None = None, grid: bool = False, points: bool = True
) -> PartData:
    """Read all parts of a kind in the shards `data/split*-NNNNN.npz`.

    split : "train", "valid-clips", "valid-characters", or "valid" for both
    grid, points : read the dense fields and the point samples
    """
    splits = HELD_OUT if split == "valid" else (split,)
    labels = [label for label, name in PART_KIND.items() if name == kind]
    rows: dict[str, list[NDArray[np.generic]]] = {
        name: [] for name in ("anchors", "points", "distance", "masks", "grid", "body")
    }
    bodies = 0
    for shard in shards(data, *splits):
        if max_bodies is not None and bodies >= max_bodies:
            break
        names = ["joints", "centre", "edge", "mask_amodal", "mask_visible"]
        loaded = read_shard(shard, [*names, *(["points", "distance"] if points else []), *(["grid"] if grid else [])])
        count = len(loaded["joints"])
        if max_bodies is not None:
            count = min(count, max_bodies - bodies)
        for label in labels:
            _append(rows, {name: value[:count] for name, value in loaded.items()}, label)
            rows["body"].append(np.arange(bodies, bodies + count))
        bodies += count
    joined: dict[str, Any] = {name: np.concatenate(parts) if parts else None for name, parts in rows.items()}
    return PartData(
        kind,
        joined["anchors"],
        joined["points"] if points else np.zeros((len(joined["body"]), 0, 3), np.float16),
        joined["distance"] if points else np.zeros((len(joined["body"]), 0), np.float16),
        joined["masks"],
        joined["grid"],
        joined["body"],
    )


def _append(rows: dict[str, list[NDArray[np.generic]]], shard: dict[str, NDArray[np.generic]], label: int) -> None:
    index = label - 1
    joints = np.asarray(shard["joints"], np.float64)[:, list(anchor_joints(label))]
    centre, edge = np.asarray(shard["centre"], np.float64)[:, index], np.asarray(shard["edge"], np.float64)[:, index]
    anchors = (2 * (joints - centre[:, None]) / edge[:, None, None]).astype(np.float32)
    masks = np.stack([shard["mask_amodal"][:, :, index], shard["mask_visible"][:, :, index]], 2)
    sign = np.ones(3, np.float32)
    if MIRRORED[label]:
        sign[0] = -1
        masks = mirrored_masks(masks)
    rows["anchors"].append(anchors * sign)
    rows["masks"].append(masks)
    if "points" in shard:
        rows["points"].append(shard["points"][:, index] * sign.astype(np.float16))
        rows["distance"].append(shard["distance"][:, index].copy())
    if "grid" in shard:
        field = shard["grid"][:, index]
        rows["grid"].append(field[:, ::-1].copy() if MIRRORED[label] else field.copy())
