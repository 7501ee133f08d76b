"""Distance grids in plain NumPy: slopes, bounds of the negative region, and values at points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.records import FloatArray, PartSdf


def lipschitz(grid: FloatArray, spacing: float, *, outside: bool = False) -> float:
    """Upper bound of the slope of a grid's trilinear interpolant, exact to within its cells.

    grid : (a, b, c) float32, at least 2 nodes per axis; spacing : distance of nodes, in the same unit
    outside : use only cells that hold a positive value, which a ray crosses before it meets the surface; leaves out
        the ridge in the middle of a limb, where bounds are loosest; 0 where there are none

    Inside a cell each partial derivative is a mean of the differences along the cell's four edges of that direction,
    so no slope exceeds the largest of them; that holds for any values, distances or not.
    """
    steepest = np.zeros(tuple(n - 1 for n in grid.shape), np.float32)
    for axis in range(3):
        slope = np.abs(np.diff(grid, axis=axis))
        # Squares of distances in other units than ours would leave float32's range: at 1e-23 they vanish.
        np.hypot(steepest, _over_corners(slope, [other for other in range(3) if other != axis]), out=steepest)
    if outside:
        steepest[_over_corners(grid, [0, 1, 2]) <= 0] = 0
    return float(steepest.max()) * (1 + 1e-6) / spacing


def _over_corners(values: FloatArray, axes: list[int]) -> FloatArray:
    """Maximum of neighbouring values along each of `axes`."""
    for axis in axes:
        values = np.maximum(values[_slab(axis, None, -1)], values[_slab(axis, 1, None)])
    return values


def negative_bounds(grid: FloatArray) -> NDArray[np.float64] | None:
    """(2, 3) bounding box of the negative region of a grid's interpolant, in units of nodes; None where there is none.

    Exact: in a plane across an axis the interpolant is bilinear in each cell and so smallest at a node's column,
    hence the region's extent along an axis is reached on the grid lines of that axis.
    """
    negative = grid <= 0
    if not negative.any():
        return None
    bounds = np.zeros((2, 3))
    for axis in range(3):
        planes = np.flatnonzero(negative.any(axis=tuple({0, 1, 2} - {axis})))
        for side, (plane, beyond) in enumerate(((planes[0], planes[0] - 1), (planes[-1], planes[-1] + 1))):
            bounds[side, axis] = plane
            if 0 <= beyond < grid.shape[axis]:
                inner = np.take(grid, plane, axis=axis).astype(np.float64)
                outer = np.take(grid, beyond, axis=axis).astype(np.float64)
                columns = inner <= 0
                reach = (inner[columns] / (inner[columns] - outer[columns])).max()
                bounds[side, axis] += reach if side else -reach
    return bounds


def trilinear(grid: NDArray[Any], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) values of a grid at (N, 3) grid coordinates within [0, n-1]."""
    cell = np.clip(np.floor(at).astype(int), 0, np.array(grid.shape) - 2)
    offset = at - cell
    total = np.zeros(len(at))
    for corner in np.ndindex(2, 2, 2):
        weight = np.where(corner, offset, 1 - offset).prod(axis=1)
        total += weight * grid[tuple((cell + corner).T)]
    return total


def to_cube(part: PartSdf, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Nearest points of a part's cube in grid coordinates, (N, 3), and the vectors from there to `points`, FIGURE."""
    origin = part.centre.astype(np.float64) - float(part.edge) / 2
    at = (points - origin) / part.spacing
    inside = np.clip(at, 0, part.grid.shape[0] - 1)
    return inside, (at - inside) * part.spacing


def grid_distance(part: PartSdf, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) signed distance of points (N, 3), FIGURE, to one part; outside of its cube as `Body` defines it."""
    inside, away = to_cube(part, points)
    value = trilinear(part.grid, inside)
    squared = (away * away).sum(axis=1)
    return np.where(squared > 0, np.sqrt(squared + np.maximum(value, 0) ** 2), value)


def _slab(axis: int, start: int | None, stop: int | None) -> tuple[slice, ...]:
    return tuple(slice(start, stop) if i == axis else slice(None) for i in range(3))
