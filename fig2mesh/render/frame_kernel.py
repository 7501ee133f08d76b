"""Compiled kernels of frames: visibility of grids in tiles, and the pixels themselves.

Channels that are not requested are None. The compiler makes a separate kernel for each combination and drops the other
branches, so that a channel that is not requested costs nothing in the loop.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.compiled import helper, kernel
from fig2mesh.field.empty_space import EmptySpace
from fig2mesh.field.grid_kernels import owner_at
from fig2mesh.field.grids import Grids
from fig2mesh.field.march_kernel import FAR, march_grid, reciprocal, unit_normal

TILE = 8
"""Pixels along the edge of a tile."""

_EDGE = 1e-3  # of a pixel, added to projected bricks to outweigh rounding
_SLACK = 1e-6  # of the depth, likewise for depths, which are stored in single precision


class Window(NamedTuple):
    """Rows of a camera's picture for the kernels.

    The ray of pixel (column, row) of the picture is origin + t direction, t the depth along the axis.

    columns, rows : size of the window; first_row : of the picture, the window's first
    middle_column, middle_row : of the picture's centre, from the window's first pixel
    origin, direction : (3, 3) float64, FIGURE, each as at the picture's pixel (0, 0), plus per column, plus per row
    start : (3,) float64, FIGURE, zero of depths: the eye, or the centre of the plane of origins
    axes : (3, 3) float64, right, up and back
    pixel : edge of a pixel, FIGURE units, in perspective at `distance`
    distance : from the eye to the plane in which pixels have that size
    perspective : whether rays start at one point
    """

    columns: int
    rows: int
    first_row: int
    middle_column: float
    middle_row: float
    origin: NDArray[np.float64]
    direction: NDArray[np.float64]
    start: NDArray[np.float64]
    axes: NDArray[np.float64]
    pixel: float
    distance: float
    perspective: bool


@helper
def projected_box(window: Window, box: NDArray[np.float64]) -> tuple[float, float, float, float, float, float]:
    """Projection of a box (2, 3), FIGURE, to the window: minimum and maximum column, row and depth, as real numbers.

    In perspective, columns and rows are valid only for boxes in front of the eye.
    """
    mx = 0.5 * (box[0, 0] + box[1, 0]) - window.start[0]
    my = 0.5 * (box[0, 1] + box[1, 1]) - window.start[1]
    mz = 0.5 * (box[0, 2] + box[1, 2]) - window.start[2]
    hx, hy, hz = 0.5 * (box[1, 0] - box[0, 0]), 0.5 * (box[1, 1] - box[0, 1]), 0.5 * (box[1, 2] - box[0, 2])
    a = window.axes
    x, y, z = (
        mx * a[0, 0] + my * a[0, 1] + mz * a[0, 2],
        mx * a[1, 0] + my * a[1, 1] + mz * a[1, 2],
        -(mx * a[2, 0] + my * a[2, 1] + mz * a[2, 2]),
    )
    ex = abs(a[0, 0]) * hx + abs(a[0, 1]) * hy + abs(a[0, 2]) * hz
    ey = abs(a[1, 0]) * hx + abs(a[1, 1]) * hy + abs(a[1, 2]) * hz
    ez = abs(a[2, 0]) * hx + abs(a[2, 1]) * hy + abs(a[2, 2]) * hz
    left, right, low, high = x - ex, x + ex, y - ey, y + ey
    if window.perspective:
        near, far = window.distance / max(z - ez, 1e-9), window.distance / max(z + ez, 1e-9)
        left, right = left * (near if left < 0.0 else far), right * (far if right < 0.0 else near)
        low, high = low * (near if low < 0.0 else far), high * (far if high < 0.0 else near)
    scale = 1.0 / window.pixel
    return (
        window.middle_column + left * scale,
        window.middle_column + right * scale,
        window.middle_row - high * scale,
        window.middle_row - low * scale,
        z - ez,
        z + ez,
    )


@kernel
def span_bricks(
    grids: Grids, space: EmptySpace, window: Window, first: int, step: int, spans: NDArray[np.float32]
) -> None:
    """Fill `spans` (G, tiles down, tiles across, 2) for the grids `first, first + step, ...`.

    A span is the range of depths at which rays of the tile can enter the grid's solid; (inf, -inf) where none can. If
    rays may start inside the grid's box, its span covers all depths.
    """
    down, across = spans.shape[1], spans.shape[2]
    for g in range(first, grids.sizes.shape[0], step):
        spans[g, :, :, 0] = np.inf
        spans[g, :, :, 1] = -np.inf
        if space.brick_starts[g] == space.brick_starts[g + 1]:
            continue
        _, _, _, _, near, far = projected_box(window, grids.boxes[g])
        if far < 0.0:
            continue
        if near <= 0.0:
            spans[g, :, :, 0] = 0.0
            spans[g, :, :, 1] = np.inf
            continue
        for b in range(space.brick_starts[g], space.brick_starts[g + 1]):
            left, right, top, bottom, near, far = projected_box(window, space.bricks[b])
            first_column, last_column = max(left - _EDGE, 0.0), min(right + _EDGE, window.columns - 1.0)
            first_row, last_row = max(top - _EDGE, 0.0), min(bottom + _EDGE, window.rows - 1.0)
            if first_column > last_column or first_row > last_row:
                continue
            near, far = near - _SLACK * abs(near), far + _SLACK * abs(far)
            for row in range(math.ceil(first_row) // TILE, min(int(last_row) // TILE, down - 1) + 1):
                for column in range(math.ceil(first_column) // TILE, min(int(last_column) // TILE, across - 1) + 1):
                    if near < spans[g, row, column, 0]:
                        spans[g, row, column, 0] = near
                    if far > spans[g, row, column, 1]:
                        spans[g, row, column, 1] = far


@helper
def candidates_of_tile(
    spans: NDArray[np.float32], row: int, column: int, found: NDArray[np.int64], near: NDArray[np.float64]
) -> int:
    """Write the grids that the tile may show to `found`, nearest first, with their depths; return their number."""
    count = 0
    for g in range(spans.shape[0]):
        a = np.float64(spans[g, row, column, 0])
        if a > spans[g, row, column, 1]:
            continue
        at = count
        while at > 0 and near[at - 1] > a:
            found[at], near[at] = found[at - 1], near[at - 1]
            at -= 1
        found[at], near[at] = g, a
        count += 1
    return count


@helper
def first_hit_of_tile(
    grids: Grids,
    space: EmptySpace,
    spans: NDArray[np.float32],
    tile_row: int,
    tile_column: int,
    found: NDArray[np.int64],
    near: NDArray[np.float64],
    candidates: int,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    tolerance: float,
) -> tuple[float, int, int]:
    """As `march_kernel.first_hit`, with rays that start and end where the tile's bricks do."""
    rx, ry, rz = reciprocal(dx), reciprocal(dy), reciprocal(dz)
    best = FAR
    hit = -1
    cells = 0
    for candidate in range(candidates):
        if near[candidate] >= best:
            break
        g = found[candidate]
        ax, bx = (grids.boxes[g, 0, 0] - ox) * rx, (grids.boxes[g, 1, 0] - ox) * rx
        ay, by = (grids.boxes[g, 0, 1] - oy) * ry, (grids.boxes[g, 1, 1] - oy) * ry
        az, bz = (grids.boxes[g, 0, 2] - oz) * rz, (grids.boxes[g, 1, 2] - oz) * rz
        a = max(min(ax, bx), min(ay, by), min(az, bz), near[candidate])
        b = min(max(ax, bx), max(ay, by), max(az, bz), np.float64(spans[g, tile_row, tile_column, 1]), best)
        if a <= b:
            t, used = march_grid(grids, space, g, ox, oy, oz, dx, dy, dz, rx, ry, rz, a, b, tolerance, 1 << 30)
            cells += used
            if t < best:
                best = t
                hit = g
    return best, hit, cells


@helper
def render_tile(
    grids: Grids,
    space: EmptySpace,
    window: Window,
    spans: NDArray[np.float32],
    tile_row: int,
    tile_column: int,
    found: NDArray[np.int64],
    near: NDArray[np.float64],
    candidates: int,
    tolerance: float,
    depth: NDArray[np.float32],
    parts: NDArray[np.int32] | None,
    normals: NDArray[np.float32] | None,
) -> tuple[int, int]:
    """Fill a tile of the channels that are not None; return numbers of cells visited and normals computed."""
    cells, computed = 0, 0
    for row in range(tile_row * TILE, min((tile_row + 1) * TILE, window.rows)):
        for column in range(tile_column * TILE, min((tile_column + 1) * TILE, window.columns)):
            line = window.first_row + row
            ox = window.origin[0, 0] + column * window.origin[1, 0] + line * window.origin[2, 0]
            oy = window.origin[0, 1] + column * window.origin[1, 1] + line * window.origin[2, 1]
            oz = window.origin[0, 2] + column * window.origin[1, 2] + line * window.origin[2, 2]
            dx = window.direction[0, 0] + column * window.direction[1, 0] + line * window.direction[2, 0]
            dy = window.direction[0, 1] + column * window.direction[1, 1] + line * window.direction[2, 1]
            dz = window.direction[0, 2] + column * window.direction[1, 2] + line * window.direction[2, 2]
            t, hit, used = first_hit_of_tile(
                grids, space, spans, tile_row, tile_column, found, near, candidates, ox, oy, oz, dx, dy, dz, tolerance
            )
            cells += used
            if hit < 0:
                clear_pixel(row, column, depth, parts, normals)
                continue
            depth[row, column] = t * math.sqrt(dx * dx + dy * dy + dz * dz)
            px, py, pz = ox + t * dx, oy + t * dy, oz + t * dz
            if parts is not None:
                parts[row, column] = owner_at(grids, hit, px, py, pz)
            if normals is not None:
                scale = 1.0 / grids.spacings[hit]
                nx, ny, nz = unit_normal(
                    grids.values,
                    grids.starts[hit],
                    grids.sizes[hit],
                    (px - grids.origins[hit, 0]) * scale,
                    (py - grids.origins[hit, 1]) * scale,
                    (pz - grids.origins[hit, 2]) * scale,
                    dx,
                    dy,
                    dz,
                )
                computed += 1
                normals[row, column, 0] = nx
                normals[row, column, 1] = ny
                normals[row, column, 2] = nz
    return cells, computed


@helper
def clear_pixel(
    row: int,
    column: int,
    depth: NDArray[np.float32],
    parts: NDArray[np.int32] | None,
    normals: NDArray[np.float32] | None,
) -> None:
    """Fill a pixel that does not show the body."""
    depth[row, column] = np.inf
    if parts is not None:
        parts[row, column] = -1
    if normals is not None:
        for axis in range(3):
            normals[row, column, axis] = 0.0


@kernel
def render_tiles(
    grids: Grids,
    space: EmptySpace,
    window: Window,
    spans: NDArray[np.float32],
    first: int,
    step: int,
    block: int,
    tolerance: float,
    depth: NDArray[np.float32],
    parts: NDArray[np.int32] | None,
    normals: NDArray[np.float32] | None,
) -> tuple[int, int, int]:
    """Fill the channels that are not None for the blocks `first, first + step, ...` of tiles.

    Returns the numbers of rays traced, cells visited and normals computed.
    """
    down, across = spans.shape[1], spans.shape[2]
    found = np.empty(spans.shape[0], np.int64)
    near = np.empty(spans.shape[0], np.float64)
    rays, cells, computed = 0, 0, 0
    for start in range(first * block, down * across, step * block):
        for tile in range(start, min(start + block, down * across)):
            tile_row, tile_column = tile // across, tile % across
            last_row = min((tile_row + 1) * TILE, window.rows)
            last_column = min((tile_column + 1) * TILE, window.columns)
            candidates = candidates_of_tile(spans, tile_row, tile_column, found, near)
            if candidates == 0:
                for row in range(tile_row * TILE, last_row):
                    for column in range(tile_column * TILE, last_column):
                        clear_pixel(row, column, depth, parts, normals)
                continue
            used, normals_here = render_tile(
                grids,
                space,
                window,
                spans,
                tile_row,
                tile_column,
                found,
                near,
                candidates,
                tolerance,
                depth,
                parts,
                normals,
            )
            rays += (last_row - tile_row * TILE) * (last_column - tile_column * TILE)
            cells += used
            computed += normals_here
    return rays, cells, computed
