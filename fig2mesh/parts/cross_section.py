"""Thickness and depth from part fields, outline from the drawing.

A network's part is about as wide as drawn, seldom exactly: its own rim may not replace the drawn one. So the networks
do not give the surface but its cross-section. Their parts are cut into columns along the line of sight; the thickness
of the columns relative to an inflation of the same silhouette is a smooth ratio, and the distance of their middle from
the bone is a smooth offset. Both are applied to the inflation of the drawn outline, which keeps its round rim.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.canvas import Canvas
from fig2mesh.records import PartSdf
from fig2mesh.skeleton import PART

DETAIL = 0.04
"""Standard deviation of the average over neighbouring columns, FIGURE units: finer detail of a network is noise."""

SMOOTHNESS = 0.025
"""Standard deviation of the blend from one part to the next, FIGURE units."""

RATIO = (0.25, 2.5)
"""Bounds of the squared thickness relative to the inflation: half as thick to one and a half times."""

HEAD_RATIO = (0.7, 1.3)
"""The same bounds for heads: drawn heads are round, whatever is on them."""

MAX_OFFSET = 0.12
"""Largest distance of the middle from the bone, FIGURE units."""

LOW_OVERLAP, HIGH_OVERLAP = 0.45, 0.7
"""Overlap of a network's part with the drawn one in the front view: up to the former its depth has no weight, from the
latter on full weight."""


@dataclass(frozen=True)
class CrossSection:
    """Difference of a layer's cross-section from an inflated outline.

    ratio : (H, W) factor of the squared half thickness
    offset : (H, W) added to the depth of the middle, FIGURE units
    """

    ratio: NDArray[np.float64]
    offset: NDArray[np.float64]


def column_extents(canvas: Canvas, fields: Sequence[PartSdf]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(H, W) FIGURE z of the foremost and the rearmost point of the union of some parts; NaN outside them."""
    shape = canvas.sdf.shape
    front, back = np.full(shape, np.nan), np.full(shape, np.nan)
    points = canvas.points()
    for field in fields:
        near, far, inside = _columns(field)
        where = (points - field.origin[:2]) / field.spacing
        window = _window(where, field.grid.shape[0])
        if window is None:
            continue
        coordinates = np.moveaxis(where[window], -1, 0)
        cover = ndimage.map_coordinates(inside.astype(np.float64), coordinates, order=1, mode="constant")
        there = cover > 0.5
        for own, total, pick in ((near, front, np.fmax), (far, back, np.fmin)):
            value = ndimage.map_coordinates(np.where(inside, own, 0.0), coordinates, order=1, mode="constant")
            total[window] = pick(total[window], np.where(there, value / np.maximum(cover, 1e-9), np.nan))
    return front, back


def _columns(field: PartSdf) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """(n, n) nearest and farthest z of each column of a grid, between nodes, and True where the column is not empty."""
    grid = field.grid.astype(np.float64)
    nodes = grid.shape[2]
    negative = grid < 0
    inside = negative.any(axis=2)
    first = np.argmax(negative, axis=2)
    last = nodes - 1 - np.argmax(negative[:, :, ::-1], axis=2)
    ends = []
    for index, step in ((last, 1), (first, -1)):
        here = np.take_along_axis(grid, index[..., None], axis=2)[..., 0]
        beyond = np.clip(index + step, 0, nodes - 1)
        there = np.take_along_axis(grid, beyond[..., None], axis=2)[..., 0]
        share = np.where(there > 0, here / np.minimum(here - there, -1e-12), 0.0)
        ends.append(field.origin[2] + field.spacing * (index + step * share))
    return ends[0], ends[1], np.asarray(inside)


def _window(where: NDArray[np.float64], nodes: int) -> tuple[slice, slice] | None:
    rows = np.flatnonzero((where[:, 0, 1] >= 0) & (where[:, 0, 1] <= nodes - 1))
    columns = np.flatnonzero((where[0, :, 0] >= 0) & (where[0, :, 0] <= nodes - 1))
    if not len(rows) or not len(columns):
        return None
    return np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def measure_cross_section(
    canvas: Canvas,
    labels: NDArray[np.uint8],
    fields: Sequence[PartSdf],
    reference: NDArray[np.float64],
    bone: NDArray[np.float64],
) -> CrossSection | None:
    """Cross-section of a layer; None where the networks have none of its parts.

    labels : (H, W) uint8, the parts of the drawn layer, 0 outside
    fields : of its parts
    reference : (H, W) squared half thickness of the inflated layer
    bone : (H, W) depth of the bones
    """
    ratio, offset = np.ones(labels.shape), np.zeros(labels.shape)
    known = False
    for field in fields:
        drawn = labels == field.part
        front, back = column_extents(canvas, [field])
        there = np.isfinite(front)
        common = there & drawn & (reference > 0)
        if not common.any():
            continue
        # The overlap with the drawing is the confidence in a network: a pictogram's head is no head.
        overlap = common.sum() / max(int((there | drawn).sum()), 1)
        trust = float(np.clip((overlap - LOW_OVERLAP) / (HIGH_OVERLAP - LOW_OVERLAP), 0.0, 1.0))
        half = np.where(common, np.nan_to_num(front - back) / 2, 0.0)
        middle = np.where(common, np.nan_to_num(front + back) / 2 - bone, 0.0)
        # Sums before quotients: near a rim both are small, and neither alone means much. A head is a ball, and what
        # its outline has of noses, hats and locks is not to be repeated in depth: its sums run over all of it.
        blur = (np.inf if field.part == PART["head"] else DETAIL) / canvas.pitch
        squares, usual, weights, moments = (
            _averaged(np.where(common, values, 0.0), blur) for values in (half**2, reference, half, half * middle)
        )
        bounds = HEAD_RATIO if field.part == PART["head"] else RATIO
        ratio[drawn] = np.clip(squares / np.maximum(usual, 1e-12), *bounds)[drawn] ** trust
        offset[drawn] = trust * np.clip(moments / np.maximum(weights, 1e-12), -MAX_OFFSET, MAX_OFFSET)[drawn]
        known = True
    if not known:
        return None
    region = labels > 0
    blur = SMOOTHNESS / canvas.pitch
    _, nearest = ndimage.distance_transform_edt(~region, return_indices=True)
    return CrossSection(*(ndimage.gaussian_filter(values[tuple(nearest)], blur) for values in (ratio, offset)))


def _averaged(values: NDArray[np.float64], blur: float) -> NDArray[np.float64]:
    # With a trace of the overall mean where nothing is near.
    near = ndimage.gaussian_filter(values, blur, truncate=3.0) if np.isfinite(blur) else 0.0
    return np.asarray(near + 1e-3 * values.mean() * np.ones(values.shape))
