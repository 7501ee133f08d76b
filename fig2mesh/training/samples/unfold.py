"""Bodies of `Drawings` in texture space: position of each texel behind the front picture, and its colour."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.skeleton import PART
from fig2mesh.texture.space import SIZE, inwards, shown_alike, spread, trust
from fig2mesh.training.samples.texture_data import Drawings

P = TypeVar("P", bound=np.generic)


@dataclass(frozen=True)
class Unfolded:
    """B bodies in texture space.

    place : (B, S, S, 2) float16, x, y in the front picture, edges at -1 and 1, y down
    there, observed, same : (B, S, S) bool, see `fill_inputs`
    truth : (B, S, S, 3) uint8, mean colour over the sides that show the texel; weight : (B, S, S) float16, 0 to 1
    part : (B, S, S) uint8, label of the texel
    front : (B, H, W, 3) uint8, the front picture, its colours extended beyond the silhouette
    inside : (B, H, W) bool, the silhouette
    """

    place: NDArray[np.float16]
    there: NDArray[np.bool_]
    observed: NDArray[np.bool_]
    same: NDArray[np.bool_]
    truth: NDArray[np.uint8]
    weight: NDArray[np.float16]
    part: NDArray[np.uint8]
    front: NDArray[np.uint8]
    inside: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.part)


def front_scale(labels: NDArray[np.uint8], depth: NDArray[np.floating]) -> tuple[float, float]:
    """Width of a pixel of the front picture in units of depth, and the x of its middle.

    The width of the front follows from the depths of left and right. labels, depth : (4, H, W)
    """
    columns = np.flatnonzero((labels[0] > 0).any(axis=0))
    left, right = (
        sign * float(np.asarray(depth[view], np.float64)[labels[view] > 0].max()) for view, sign in ((1, 1), (3, -1))
    )
    return (left - right) / (columns[-1] - columns[0] + 1), (left + right) / 2


def places(labels: NDArray[np.uint8], depth: NDArray[np.floating]) -> NDArray[np.float32]:
    """(4, H, W, 2) x, y in the front picture of the surface at each pixel of the four sides, edges at -1 and 1.

    Every side is framed about the middle of its own box, so the sides' scales follow from the heights of the boxes.
    """
    size = labels.shape[1]
    heights = []
    for view in range(4):
        rows = np.flatnonzero((labels[view] > 0).any(axis=1))
        heights.append(rows[-1] - rows[0] + 1)
    pitch, middle = front_scale(labels, depth)
    along = (np.arange(size) + 0.5) / size * 2 - 1
    result = np.zeros((*labels.shape, 2), np.float32)
    for view in range(4):
        result[view, ..., 1] = along[:, None] * (heights[0] / heights[view])
    result[0, ..., 0] = along
    result[2, ..., 0] = -along * (heights[0] / heights[2])
    for view, sign in ((1, 1.0), (3, -1.0)):
        x = sign * np.where(labels[view] > 0, np.asarray(depth[view], np.float64), 0.0)
        result[view, ..., 0] = 2 * (x - middle) / (pitch * size)
    return result


def extend_colours(picture: NDArray[P], inner: NDArray[np.float64]) -> NDArray[P]:
    """(H, W, 3) picture with colours extended beyond the silhouette, whose rim is mixed with the background.

    inner : (H, W) distance of each pixel inside the silhouette, see `inwards`
    """
    nearest = ndimage.distance_transform_edt(inner < 2, return_distances=False, return_indices=True)
    result: NDArray[P] = picture[tuple(nearest)]
    return result


def unfold(drawings: Drawings) -> Unfolded:
    """Unfold all bodies of `drawings`."""
    columns: list[tuple[NDArray[np.generic], ...]] = [_unfold(drawings, row) for row in range(len(drawings))]
    return Unfolded(*(np.stack(column) for column in zip(*columns, strict=True)))


def _unfold(drawings: Drawings, row: int) -> tuple[NDArray[np.generic], ...]:
    labels, uv = drawings.labels[row], drawings.uv[row].astype(np.float32)
    where = places(labels, drawings.depth[row])
    known = (labels > 0) & (labels != PART["garment"])
    inner = inwards(labels > 0)
    weight = trust(inner)
    colour = drawings.picture[row].astype(np.float32)
    same = shown_alike(labels, where)
    front = np.zeros(labels.shape, bool)
    front[0] = True
    values = np.concatenate([where, colour, front[..., None], same[..., None]], axis=-1)
    means, total = spread(uv[known], values[known], weight[known])
    part = np.zeros((SIZE, SIZE), np.uint8)
    cell = np.clip((uv[known] * SIZE).astype(int), 0, SIZE - 1)
    part[cell[:, 1], cell[:, 0]] = labels[known]
    there = total > 0
    return (
        means[..., :2].astype(np.float16),
        there,
        means[..., 5] > 0,
        means[..., 6] > 0.5,
        np.clip(np.round(means[..., 2:5]), 0, 255).astype(np.uint8),
        np.clip(total, 0, 1).astype(np.float16),
        part,
        extend_colours(drawings.picture[row, 0], inner[0]),
        labels[0] > 0,
    )
