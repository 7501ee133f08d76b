"""Cells of a grid that may hold the surface, and the sampling density needed in each.

Scanned evenly, a limb as thick as the point spacing comes out of ball pivoting with 0.38 of its volume (three spacings:
0.88, four: 0.93), and one thinner than a cell may pass between the nodes. Drawn staffs and strings are that thin; so
where a body is thin the spacing shrinks with it, down to a quarter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.mesh.grid import LIPSCHITZ, Grid
from fig2mesh.mesh.newton import newton
from fig2mesh.mesh.protocol import Field
from fig2mesh.records import FloatArray

MIN_SHARE = 0.25
"""Least spacing relative to the requested one."""

PER_DEPTH = 0.5
"""Spacing relative to half the thickness; a flat surface shows a depth of 2 spacings, so nothing changes there."""


@dataclass(frozen=True)
class Band:
    """cells : (C, 3) indices of the cells' lowest nodes; share : (C,) float32 in [1/4, 1], local spacing by spacing;
    hidden : (C,) bool, no corner is inside and the body is thinner than a cell here, as small values reveal."""

    cells: NDArray[np.int64]
    share: FloatArray
    hidden: NDArray[np.bool_]


def band(grid: Grid) -> Band:
    """Cells that may hold the outer surface; those of cavities take no part."""
    inside = grid.values < 0
    crossing = _any_corner(inside) & _any_corner(grid.outside)
    # A limb thinner than a cell need not have a node inside; then it runs within 0.87 spacings of one that is known.
    near = _any_corner(grid.outside & grid.known & (np.abs(grid.values) < 0.9 * LIPSCHITZ * grid.spacing))
    cells = np.argwhere(crossing | (near & ~_any_corner(inside)))
    lowest = ndimage.minimum_filter(grid.values, size=5, mode="nearest")
    minimum = np.zeros(len(cells), np.float32)
    for corner in np.ndindex(2, 2, 2):
        np.minimum(minimum, lowest[tuple((cells + corner).T)], out=minimum)
    # In lengths, where the field runs slower or faster than the distance.
    depth = -minimum / np.maximum(_slope(grid, cells), 1e-3) / np.float32(grid.spacing)
    crossed = crossing[tuple(cells.T)]
    # Beside a thick body the other cells lie just outside of it, and its neighbours give all points that they could.
    useful = crossed | (depth < 0.9)
    cells, depth, crossed = cells[useful], depth[useful], crossed[useful]
    share = np.exp2(np.floor(np.log2(np.clip(PER_DEPTH * depth, MIN_SHARE, 1.0)) + 0.5)).astype(np.float32)
    return Band(cells, share, ~crossed & (depth < 0.7))


def _slope(grid: Grid, cells: NDArray[np.int64]) -> FloatArray:
    """(C,) steepest slope along the edges of each cell, of those between nodes where the field's value is known."""
    corners = [tuple((cells + corner).T) for corner in np.ndindex(2, 2, 2)]
    values = np.stack([grid.values[corner] for corner in corners]).reshape(2, 2, 2, -1)
    known = np.stack([grid.known[corner] for corner in corners]).reshape(2, 2, 2, -1)
    steepest = [
        (np.abs(np.diff(values, axis=axis)) * known.min(axis=axis, keepdims=True)).max(axis=(0, 1, 2))
        for axis in range(3)
    ]
    with np.errstate(over="ignore"):  # the norm of huge values is infinite, and so is the band
        slope: FloatArray = np.linalg.norm(steepest, axis=0) / np.float32(grid.spacing)
    return slope


def _any_corner(nodes: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(nx - 1, ny - 1, nz - 1) bool: any corner of the cell is in `nodes`."""
    for axis in range(3):
        along = np.moveaxis(nodes, axis, 0)
        nodes = np.moveaxis(along[:-1] | along[1:], 0, axis)
    return nodes


def throw(grid: Grid, chosen: Band, each: NDArray[np.int64], random: np.random.Generator) -> FloatArray:
    """Random points in the cells of a band, `each` (C,) of them, (each.sum(), 3) float32, FIGURE."""
    corner = np.repeat(chosen.cells, each, axis=0)
    inner = random.random(corner.shape, np.float32)
    return ((corner + inner) * grid.spacing + grid.origin).astype(np.float32)


def misses_limbs(field: Field, grid: Grid) -> bool:
    """Whether a limb thinner than a cell runs through cells that have no node inside."""
    found = band(grid)
    hidden = Band(found.cells[found.hidden], found.share[found.hidden], found.hidden[found.hidden])
    if len(hidden.cells) == 0:
        return False
    points = throw(grid, hidden, np.full(len(hidden.cells), 4), np.random.default_rng(0))
    landed, arrived = newton(field, points, tolerance=1e-2 * grid.spacing, reach=grid.spacing)
    # Only what lies in a hidden cell counts: the surface next door may be known well.
    cell = np.floor((landed - grid.origin) / grid.spacing).astype(np.int64)
    home = np.repeat(hidden.cells, 4, axis=0)
    return bool((arrived & (cell == home).all(axis=1)).any())
