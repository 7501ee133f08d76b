"""Compiled kernels for values and gradients of grids and of their union; `reference` holds their NumPy twins.

All arithmetic is in float64: its cost is negligible beside the memory reads, and the twins agree to rounding.
Not tried further: an analytic gradient of the trilinear interpolant is cheaper, but jumps from cell to cell and
shows as facets; it serves only where central differences fail.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.compiled import helper, kernel
from fig2mesh.field.grids import Grids

Triple = tuple[float, float, float]


@helper
def cell_of(x: float, n: int) -> int:
    """Index of the cell (0 to n-2) that holds grid coordinate x; clamped to the outermost cells."""
    return min(int(max(x, 0.0)), n - 2)


@helper
def node(values: NDArray[np.float32], at: int) -> float:
    """Value of a node; the index is unsigned, which avoids a test for negative indices at each lookup."""
    return np.float64(values[np.uint64(at)])


@helper
def grid_value(grids: Grids, g: int, x: float, y: float, z: float) -> float:
    """Trilinear value of grid g at grid coordinates within [0, n-1]."""
    n = grids.sizes[g]
    i, j, k = cell_of(x, n), cell_of(y, n), cell_of(z, n)
    u, v, w = x - i, y - j, z - k
    values = grids.values
    a = grids.starts[g] + (i * n + j) * n + k
    b, c = a + n, a + n * n
    d = c + n
    low: float = (values[a] * (1 - w) + values[a + 1] * w) * (1 - v) + (values[b] * (1 - w) + values[b + 1] * w) * v
    high: float = (values[c] * (1 - w) + values[c + 1] * w) * (1 - v) + (values[d] * (1 - w) + values[d + 1] * w) * v
    return low * (1 - u) + high * u


@helper
def axis_slopes(
    values: NDArray[np.float32], at: int, stride: int, i: int, u: float, n: int, s: int, v: float, r: int, w: float
) -> tuple[float, float]:
    """Slopes per node along the axis of `stride` from the cell at `at`: by central differences, and of the interpolant.

    i, u : cell and position in it along the axis; s, v and r, w : strides and positions of the two other axes

    Central differences one node wide are the same as interpolating the differences at the nodes, since trilinear
    interpolation commutes with a shift by whole cells: four values along each of the cell's four edges do.
    """
    smooth = 0.0
    exact = 0.0
    for corner in range(4):
        weight = (v if corner & 1 else 1 - v) * (w if corner & 2 else 1 - w)
        e = at + (corner & 1) * s + (corner >> 1) * r
        f1 = node(values, e)
        f2 = node(values, e + stride)
        f0 = node(values, e - stride) if i > 0 else 2 * f1 - f2  # one-sided at the faces of the cube
        f3 = node(values, e + 2 * stride) if i < n - 2 else 2 * f2 - f1
        smooth += weight * 0.5 * ((f2 - f0) * (1 - u) + (f3 - f1) * u)
        exact += weight * (f2 - f1)
    return smooth, exact


@helper
def slopes_at(values: NDArray[np.float32], start: int, n: int, scale: float, x: float, y: float, z: float) -> Triple:
    """Gradient at grid coordinates of the grid of n^3 nodes that begins at `start`; scale : nodes per FIGURE unit.

    Central differences one node wide (paper appendix C), which are continuous; where they cancel, as in a limb thinner
    than a cell, the interpolant's own gradient.
    """
    i, j, k = cell_of(x, n), cell_of(y, n), cell_of(z, n)
    u, v, w = x - i, y - j, z - k
    at = start + (i * n + j) * n + k
    sx, ex = axis_slopes(values, at, n * n, i, u, n, n, v, 1, w)
    sy, ey = axis_slopes(values, at, n, j, v, n, n * n, u, 1, w)
    sz, ez = axis_slopes(values, at, 1, k, w, n, n * n, u, n, v)
    # next to nothing of the exact slope is left, or the contrary: the differences straddle the limb
    if 10.0 * (sx * ex + sy * ey + sz * ez) < ex * ex + ey * ey + ez * ez:
        return ex * scale, ey * scale, ez * scale
    return sx * scale, sy * scale, sz * scale


@helper
def grid_gradient(grids: Grids, g: int, x: float, y: float, z: float) -> Triple:
    """Gradient of grid g at grid coordinates, per FIGURE unit."""
    return slopes_at(grids.values, grids.starts[g], grids.sizes[g], 1.0 / grids.spacings[g], x, y, z)


@helper
def cube_point(
    grids: Grids, g: int, px: float, py: float, pz: float
) -> tuple[float, float, float, float, float, float]:
    """Nearest point of grid g's cube in grid coordinates, and the vector from there to the point in FIGURE units."""
    h = grids.spacings[g]
    last = float(grids.sizes[g] - 1)
    x, y, z = (px - grids.origins[g, 0]) / h, (py - grids.origins[g, 1]) / h, (pz - grids.origins[g, 2]) / h
    qx, qy, qz = min(max(x, 0.0), last), min(max(y, 0.0), last), min(max(z, 0.0), last)
    return qx, qy, qz, (x - qx) * h, (y - qy) * h, (z - qz) * h


@helper
def nearest_grid(grids: Grids, px: float, py: float, pz: float) -> tuple[float, int]:
    """Smallest distance of a point over all grids that have a surface, and the grid that gives it (-1 without any).

    Outside of a grid's cube at distance b, with the value v at the nearest point of the cube: sqrt(b^2 + max(v, 0)^2).
    Cubes are convex, so nothing inside is nearer than that; it joins v on the faces and is zero nowhere outside.
    """
    best = math.inf
    nearest = -1
    for g in range(grids.sizes.shape[0]):
        if grids.boxes[g, 0, 0] > grids.boxes[g, 1, 0]:
            continue  # no surface
        x, y, z, dx, dy, dz = cube_point(grids, g, px, py, pz)
        away = dx * dx + dy * dy + dz * dz
        if away > 0 and (best < 0 or away >= best * best):
            continue  # cannot be nearer than what was found: spares the memory reads
        value = grid_value(grids, g, x, y, z)
        if away > 0:
            value = math.sqrt(away + max(value, 0.0) ** 2)
        if value < best:
            best = value
            nearest = g
    return best, nearest


@helper
def union_gradient(grids: Grids, g: int, px: float, py: float, pz: float) -> Triple:
    """Gradient of `nearest_grid`'s distance, given the nearest grid."""
    x, y, z, dx, dy, dz = cube_point(grids, g, px, py, pz)
    gx, gy, gz = grid_gradient(grids, g, x, y, z)
    away = dx * dx + dy * dy + dz * dz
    if away == 0:
        return gx, gy, gz
    value = max(grid_value(grids, g, x, y, z), 0.0)
    length = math.sqrt(away + value * value)
    # the nearest point of the cube moves along only with the coordinates that lie within the cube's extent
    return (
        (dx + (value * gx if dx == 0 else 0.0)) / length,
        (dy + (value * gy if dy == 0 else 0.0)) / length,
        (dz + (value * gz if dz == 0 else 0.0)) / length,
    )


@helper
def owner_at(grids: Grids, g: int, px: float, py: float, pz: float) -> int:
    """Part that a point of grid g belongs to; of the two parts that a blend joins, the nearer one."""
    if grids.owners[g, 0] == grids.owners[g, 1]:
        return int(grids.owners[g, 0])
    best = math.inf
    owner = -1
    for side in range(2):
        x, y, z, dx, dy, dz = cube_point(grids, grids.owners[g, side], px, py, pz)
        # outside of the cube a plain sum will do: it only has to rank the two parts
        value = grid_value(grids, grids.owners[g, side], x, y, z) + abs(dx) + abs(dy) + abs(dz)
        if value < best:
            best = value
            owner = grids.owners[g, side]
    return owner


@kernel
def evaluate_blocks(
    grids: Grids,
    points: NDArray[np.float64],
    first: int,
    step: int,
    block: int,
    values: NDArray[np.float64],
    parts: NDArray[np.int32],
    gradients: NDArray[np.float64],
) -> None:
    """Fill `values`, `parts` and `gradients` for the blocks `first, first + step, ...` of points.

    `parts` and `gradients` may be empty, then they are not computed.
    """
    count = len(points)
    for start in range(first * block, count, step * block):
        for i in range(start, min(start + block, count)):
            px, py, pz = points[i, 0], points[i, 1], points[i, 2]
            value, g = nearest_grid(grids, px, py, pz)
            values[i] = value
            if len(parts) > 0:
                parts[i] = owner_at(grids, g, px, py, pz) if g >= 0 else -1
            if len(gradients) > 0 and g >= 0:
                gradients[i, 0], gradients[i, 1], gradients[i, 2] = union_gradient(grids, g, px, py, pz)
