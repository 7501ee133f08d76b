"""Compiled kernels of frames: which tiles can see which grids, and the pixels themselves.

What a frame is not asked for comes as None. The compiler makes a kernel of its own for each combination and drops the
branches of the rest, so that an effect that is not wanted leaves no trace in the loop.
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
from fig2mesh.render.surface_colours import BAND, HIDDEN, STEEPEST, Colouring

TILE = 8
"""Pixels along the edge of a tile."""

_EDGE = 1e-3  # of a pixel, by which bricks are thrown wider than rounding could make them narrower
_SLACK = 1e-6  # of the depth, the same for depths, which are kept in single precision


class View(NamedTuple):
    """A camera for the kernels. The ray of pixel (column, row) is origin + t direction, t the depth along the axis.

    columns, rows : size of the picture
    origin, direction : (3, 3) float64, FIGURE, each as at pixel (0, 0), plus per column, plus per row
    start : (3,) float64, FIGURE, from where depths count: the eye, or the middle of the plane of origins
    axes : (3, 3) float64, right, up and back
    pixel : edge of a pixel, FIGURE units, in perspective at `distance`
    distance : from the eye to the plane in which pixels have that size
    perspective : whether rays start at one point
    """

    columns: int
    rows: int
    origin: NDArray[np.float64]
    direction: NDArray[np.float64]
    start: NDArray[np.float64]
    axes: NDArray[np.float64]
    pixel: float
    distance: float
    perspective: bool


@helper
def seen_box(view: View, box: NDArray[np.float64]) -> tuple[float, float, float, float, float, float]:
    """Where a box (2, 3), FIGURE, lies in the picture: least and greatest column, row and depth, as real numbers.

    In perspective columns and rows hold for boxes in front of the eye only.
    """
    mx = 0.5 * (box[0, 0] + box[1, 0]) - view.start[0]
    my = 0.5 * (box[0, 1] + box[1, 1]) - view.start[1]
    mz = 0.5 * (box[0, 2] + box[1, 2]) - view.start[2]
    hx, hy, hz = 0.5 * (box[1, 0] - box[0, 0]), 0.5 * (box[1, 1] - box[0, 1]), 0.5 * (box[1, 2] - box[0, 2])
    a = view.axes
    x, y, z = (
        mx * a[0, 0] + my * a[0, 1] + mz * a[0, 2],
        mx * a[1, 0] + my * a[1, 1] + mz * a[1, 2],
        -(mx * a[2, 0] + my * a[2, 1] + mz * a[2, 2]),
    )
    ex = abs(a[0, 0]) * hx + abs(a[0, 1]) * hy + abs(a[0, 2]) * hz
    ey = abs(a[1, 0]) * hx + abs(a[1, 1]) * hy + abs(a[1, 2]) * hz
    ez = abs(a[2, 0]) * hx + abs(a[2, 1]) * hy + abs(a[2, 2]) * hz
    left, right, low, high = x - ex, x + ex, y - ey, y + ey
    if view.perspective:
        near, far = view.distance / max(z - ez, 1e-9), view.distance / max(z + ez, 1e-9)
        left, right = left * (near if left < 0.0 else far), right * (far if right < 0.0 else near)
        low, high = low * (near if low < 0.0 else far), high * (far if high < 0.0 else near)
    middle_column, middle_row = 0.5 * view.columns - 0.5, 0.5 * view.rows - 0.5
    scale = 1.0 / view.pixel
    return (
        middle_column + left * scale,
        middle_column + right * scale,
        middle_row - high * scale,
        middle_row - low * scale,
        z - ez,
        z + ez,
    )


@kernel
def span_bricks(grids: Grids, space: EmptySpace, view: View, first: int, step: int, spans: NDArray[np.float32]) -> None:
    """Fill `spans` (G, tiles down, tiles across, 2) for the grids `first, first + step, ...`.

    A span holds the depths between which rays of the tile can enter the grid's solid; (inf, -inf) where none can. A
    grid whose box the rays start in may be met at once, also far from its surface: its span is everything.
    """
    down, across = spans.shape[1], spans.shape[2]
    for g in range(first, grids.sizes.shape[0], step):
        spans[g, :, :, 0] = np.inf
        spans[g, :, :, 1] = -np.inf
        if space.brick_starts[g] == space.brick_starts[g + 1]:
            continue
        _, _, _, _, near, far = seen_box(view, grids.boxes[g])
        if far < 0.0:
            continue
        if near <= 0.0:
            spans[g, :, :, 0] = 0.0
            spans[g, :, :, 1] = np.inf
            continue
        for b in range(space.brick_starts[g], space.brick_starts[g + 1]):
            left, right, top, bottom, near, far = seen_box(view, space.bricks[b])
            first_column, last_column = max(left - _EDGE, 0.0), min(right + _EDGE, view.columns - 1.0)
            first_row, last_row = max(top - _EDGE, 0.0), min(bottom + _EDGE, view.rows - 1.0)
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
def bilinear(picture: NDArray[np.uint8], x: float, y: float) -> tuple[float, float, float]:
    """Colour of a picture (h, w, 4) between its pixels, whose centres lie at whole numbers; the border goes on."""
    x = min(max(x, 0.0), picture.shape[1] - 1.0)
    y = min(max(y, 0.0), picture.shape[0] - 1.0)
    i, j = int(x), int(y)
    ii, jj = min(i + 1, picture.shape[1] - 1), min(j + 1, picture.shape[0] - 1)
    u, v = x - i, y - j
    a, b, c, d = (1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v
    return (
        a * picture[j, i, 0] + b * picture[j, ii, 0] + c * picture[jj, i, 0] + d * picture[jj, ii, 0],
        a * picture[j, i, 1] + b * picture[j, ii, 1] + c * picture[jj, i, 1] + d * picture[jj, ii, 1],
        a * picture[j, i, 2] + b * picture[j, ii, 2] + c * picture[jj, i, 2] + d * picture[jj, ii, 2],
    )


@helper
def openness(front: NDArray[np.float32], x: float, y: float, limit: float) -> float:
    """Share, 0 to 1, of the map's four pixels about (x, y) where the body reaches no further forward than `limit`."""
    x = min(max(x, 0.0), front.shape[1] - 1.0)
    y = min(max(y, 0.0), front.shape[0] - 1.0)
    i, j = int(x), int(y)
    ii, jj = min(i + 1, front.shape[1] - 1), min(j + 1, front.shape[0] - 1)
    u, v = x - i, y - j
    share = 0.0
    if front[j, i] <= limit:
        share += (1.0 - u) * (1.0 - v)
    if front[j, ii] <= limit:
        share += u * (1.0 - v)
    if front[jj, i] <= limit:
        share += (1.0 - u) * v
    if front[jj, ii] <= limit:
        share += u * v
    return share


@helper
def surface_colour(
    colouring: Colouring, part: int, px: float, py: float, pz: float, nz: float
) -> tuple[float, float, float, int]:
    """Colour of a surface point, and how many pictures were looked at.

    The drawing where it saw the point, the plain picture of its part elsewhere, and a mixture over `BAND`.
    """
    maps = colouring.maps
    samples = 0
    weight = min(max((nz - colouring.least) / BAND, 0.0), 1.0)
    weight *= weight * (3.0 - 2.0 * weight)
    if weight > 0.0:
        x, y = maps[2, 0] * px + maps[2, 1], maps[2, 2] * py + maps[2, 3]
        # from one pixel of the map to the next the surface itself falls by its slope
        slope = 1.0 / max(nz, STEEPEST)
        weight *= openness(colouring.front, x, y, pz + HIDDEN + 1.5 * slope / maps[2, 0])
        samples += 1
    red, green, blue = 0.0, 0.0, 0.0
    if weight > 0.0:
        r, g, b = bilinear(colouring.seen, maps[0, 0] * px + maps[0, 1], maps[0, 2] * py + maps[0, 3])
        red, green, blue = weight * r, weight * g, weight * b
        samples += 1
    if weight < 1.0:
        picture = colouring.plain[colouring.slots[part]]
        r, g, b = bilinear(picture, maps[1, 0] * px + maps[1, 1], maps[1, 2] * py + maps[1, 3])
        rest = 1.0 - weight
        red, green, blue = red + rest * r, green + rest * g, blue + rest * b
        samples += 1
    return red, green, blue, samples


@helper
def candidates_of_tile(
    spans: NDArray[np.float32], row: int, column: int, found: NDArray[np.int64], near: NDArray[np.float64]
) -> int:
    """Write to `found` the grids that the tile may see, nearest first, and their nearest depths; return how many."""
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
    view: View,
    spans: NDArray[np.float32],
    tile_row: int,
    tile_column: int,
    found: NDArray[np.int64],
    near: NDArray[np.float64],
    candidates: int,
    tolerance: float,
    colouring: Colouring | None,
    colour: NDArray[np.uint8] | None,
    depth: NDArray[np.float32] | None,
    parts: NDArray[np.int32] | None,
    normals: NDArray[np.float32] | None,
) -> tuple[int, int, int]:
    """Fill a tile of the pictures that are not None; cells looked at, normals computed and pictures looked up."""
    cells, computed, samples = 0, 0, 0
    for row in range(tile_row * TILE, min((tile_row + 1) * TILE, view.rows)):
        for column in range(tile_column * TILE, min((tile_column + 1) * TILE, view.columns)):
            ox = view.origin[0, 0] + column * view.origin[1, 0] + row * view.origin[2, 0]
            oy = view.origin[0, 1] + column * view.origin[1, 1] + row * view.origin[2, 1]
            oz = view.origin[0, 2] + column * view.origin[1, 2] + row * view.origin[2, 2]
            dx = view.direction[0, 0] + column * view.direction[1, 0] + row * view.direction[2, 0]
            dy = view.direction[0, 1] + column * view.direction[1, 1] + row * view.direction[2, 1]
            dz = view.direction[0, 2] + column * view.direction[1, 2] + row * view.direction[2, 2]
            t, hit, used = first_hit_of_tile(
                grids, space, spans, tile_row, tile_column, found, near, candidates, ox, oy, oz, dx, dy, dz, tolerance
            )
            cells += used
            if hit < 0:
                clear_pixel(row, column, colour, depth, parts, normals)
                continue
            if depth is not None:
                depth[row, column] = t * math.sqrt(dx * dx + dy * dy + dz * dz)
            px, py, pz = ox + t * dx, oy + t * dy, oz + t * dz
            if parts is not None:
                parts[row, column] = owner_at(grids, hit, px, py, pz)
            if colour is not None or normals is not None:
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
                if normals is not None:
                    normals[row, column, 0] = nx
                    normals[row, column, 1] = ny
                    normals[row, column, 2] = nz
                if colour is not None and colouring is not None:
                    part = grids.owners[hit, 0]
                    if part != grids.owners[hit, 1]:
                        part = owner_at(grids, hit, px, py, pz)
                    red, green, blue, looked = surface_colour(colouring, part, px, py, pz, nz)
                    samples += looked
                    colour[row, column, 0] = np.uint8(red + 0.5)
                    colour[row, column, 1] = np.uint8(green + 0.5)
                    colour[row, column, 2] = np.uint8(blue + 0.5)
                    colour[row, column, 3] = 255
    return cells, computed, samples


@helper
def clear_pixel(
    row: int,
    column: int,
    colour: NDArray[np.uint8] | None,
    depth: NDArray[np.float32] | None,
    parts: NDArray[np.int32] | None,
    normals: NDArray[np.float32] | None,
) -> None:
    """What a pixel holds that does not see the body."""
    if colour is not None:
        for channel in range(4):
            colour[row, column, channel] = 0
    if depth is not None:
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
    view: View,
    spans: NDArray[np.float32],
    first: int,
    step: int,
    block: int,
    tolerance: float,
    colouring: Colouring | None,
    colour: NDArray[np.uint8] | None,
    depth: NDArray[np.float32] | None,
    parts: NDArray[np.int32] | None,
    normals: NDArray[np.float32] | None,
) -> tuple[int, int, int, int]:
    """Fill the pictures that are not None for the blocks `first, first + step, ...` of tiles.

    Returns how many rays were sent, cells looked at, normals computed and pictures looked up.
    """
    down, across = spans.shape[1], spans.shape[2]
    found = np.empty(spans.shape[0], np.int64)
    near = np.empty(spans.shape[0], np.float64)
    rays, cells, computed, samples = 0, 0, 0, 0
    for start in range(first * block, down * across, step * block):
        for tile in range(start, min(start + block, down * across)):
            tile_row, tile_column = tile // across, tile % across
            last_row = min((tile_row + 1) * TILE, view.rows)
            last_column = min((tile_column + 1) * TILE, view.columns)
            candidates = candidates_of_tile(spans, tile_row, tile_column, found, near)
            if candidates == 0:
                for row in range(tile_row * TILE, last_row):
                    for column in range(tile_column * TILE, last_column):
                        clear_pixel(row, column, colour, depth, parts, normals)
                continue
            used, normals_here, samples_here = render_tile(
                grids,
                space,
                view,
                spans,
                tile_row,
                tile_column,
                found,
                near,
                candidates,
                tolerance,
                colouring,
                colour,
                depth,
                parts,
                normals,
            )
            rays += (last_row - tile_row * TILE) * (last_column - tile_column * TILE)
            cells += used
            computed += normals_here
            samples += samples_here
    return rays, cells, computed, samples
