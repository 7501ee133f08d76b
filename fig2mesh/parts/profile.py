"""Thickness and depth from part fields, outline from the drawing.

A network's part is about as wide as drawn, seldom exactly: its own rim may not replace the drawn one. So the networks
do not give the surface but its cross-section. Their parts are cut into columns along the line of sight; how thick the
columns are, compared with an inflation of the same silhouette, is a smooth ratio, and how far their middle lies from
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

SMOOTHNESS = 0.022
"""Spread of the average over neighbouring columns, FIGURE units: finer detail of a network is noise."""

RATIO = (0.25, 2.5)
"""Bounds of the squared thickness relative to the inflation: half as thick to one and a half times."""

OFFSET = 0.12
"""Largest distance of the middle from the bone, FIGURE units."""

FADING = 0.08
"""Distance over which the inflation takes over where no network reaches, FIGURE units."""

LEAST_COVER = 0.02


@dataclass(frozen=True)
class Profile:
    """How a layer's cross-section differs from an inflated outline.

    ratio : (H, W) factor of the squared half thickness
    offset : (H, W) what is added to the depth of the middle, FIGURE units
    """

    ratio: NDArray[np.float64]
    offset: NDArray[np.float64]


def column_extents(canvas: Canvas, fields: Sequence[PartSdf]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(H, W) FIGURE z of the foremost and the rearmost point of the union of some parts; NaN where they are not."""
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
    """(n, n) nearest and farthest z of each column of a grid, between nodes, and whether there is anything in it."""
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


def measure_profile(
    canvas: Canvas,
    region: NDArray[np.bool_],
    front: NDArray[np.float64],
    back: NDArray[np.float64],
    reference: NDArray[np.float64],
    bone: NDArray[np.float64],
) -> Profile | None:
    """The profile of a layer; None where networks and drawing do not overlap.

    region : (H, W) bool, the drawn layer
    front, back : (H, W) as `column_extents` gives them
    reference : (H, W) squared half thickness of the inflation of what `front` and `back` cover
    bone : (H, W) depth of the bones
    """
    common = np.isfinite(front) & region & (reference > 0)
    if not common.any():
        return None
    half = np.where(common, np.nan_to_num(front - back) / 2, 0.0)
    middle = np.where(common, np.nan_to_num(front + back) / 2 - bone, 0.0)
    blur = SMOOTHNESS / canvas.pitch

    def average(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(ndimage.gaussian_filter(np.where(common, values, 0.0), blur))

    # Sums before quotients: near a rim both are small, and neither alone means much.
    ratio = average(half**2) / np.maximum(average(reference), 1e-12)
    offset = average(half * middle) / np.maximum(average(half), 1e-12)
    known = average(np.ones_like(half)) > LEAST_COVER
    away, nearest = ndimage.distance_transform_edt(~known, sampling=canvas.pitch, return_indices=True)
    # Beyond what a network knows (a skirt, a hat's brim) what is known nearest fades into the plain inflation.
    fading = np.exp(-((away / FADING) ** 2))
    ratio = np.clip(ratio, *RATIO)[tuple(nearest)] ** fading
    offset = np.clip(offset, -OFFSET, OFFSET)[tuple(nearest)] * fading
    return Profile(ndimage.gaussian_filter(ratio, blur), ndimage.gaussian_filter(offset, blur))
