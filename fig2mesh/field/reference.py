"""Plain NumPy twins of the compiled kernels: slow, short, used to test the kernels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.body import Body
from fig2mesh.field.distance import grid_distance, lipschitz, negative_bounds, to_cube, trilinear
from fig2mesh.records import Hits, IntArray, PartSdf, Rays

Array = NDArray[np.float64]


def distance_reference(body: Body, points: Array) -> tuple[Array, IntArray]:
    """Twin of `Body.distance` and `Body.nearest_part` for bodies without blends: (N,) values and (N,) indices."""
    never = np.full(len(points), np.inf)
    values = np.stack([grid_distance(part, points) if (part.grid <= 0).any() else never for part in body.parts])
    return values.min(axis=0), values.argmin(axis=0).astype(np.int32)


def gradient_reference(body: Body, points: Array) -> Array:
    """Twin of `Body.gradient` for bodies without blends: (N, 3)."""
    nearest = distance_reference(body, points)[1]
    result = np.zeros((len(points), 3))
    for index, part in enumerate(body.parts):
        mine = nearest == index
        inside, away = to_cube(part, points[mine])
        slope = grid_gradient_reference(part, inside)
        value = np.maximum(trilinear(part.grid, inside), 0)[:, None]
        length = np.sqrt((away * away).sum(axis=1, keepdims=True) + value * value)
        out = (away != 0).any(axis=1, keepdims=True)
        beyond = (away + np.where(away == 0, value * slope, 0)) / np.where(out, length, 1)
        result[mine] = np.where(out, beyond, slope)
    return result


def grid_gradient_reference(part: PartSdf, at: Array) -> Array:
    """(N, 3) gradient at grid coordinates (N, 3), per FIGURE unit: central differences, or exact where they cancel."""
    n = part.grid.shape[0]
    padded = np.pad(part.grid.astype(np.float64), 1, mode="reflect", reflect_type="odd")  # straight on past the faces
    middle = slice(1, -1)
    smooth, exact = np.zeros((len(at), 3)), np.zeros((len(at), 3))
    cell = np.clip(np.floor(at).astype(int), 0, n - 2)
    for axis in range(3):
        ahead = tuple(slice(2, None) if i == axis else middle for i in range(3))
        behind = tuple(slice(None, -2) if i == axis else middle for i in range(3))
        smooth[:, axis] = trilinear(0.5 * (padded[ahead] - padded[behind]), at)
        low, high = at.copy(), at.copy()
        low[:, axis], high[:, axis] = cell[:, axis], cell[:, axis] + 1
        exact[:, axis] = trilinear(part.grid, high) - trilinear(part.grid, low)
    cancelled = 10 * (smooth * exact).sum(axis=1) < (exact * exact).sum(axis=1)
    return np.where(cancelled[:, None], exact, smooth) / part.spacing


def trace_reference(body: Body, rays: Rays, *, tolerance: float = 1e-4, max_steps: int = 1024) -> Hits:
    """Twin of `trace.trace` for bodies without blends; counts of steps differ, as parts come in another order."""
    origins, directions = rays.origins.astype(np.float64), rays.directions.astype(np.float64)
    count = len(origins)
    best, index, steps = np.full(count, np.inf), np.full(count, -1, np.int32), np.zeros(count, np.int32)
    for number, part in enumerate(body.parts):
        box = negative_bounds(part.grid)
        if box is None:
            continue
        corner = part.centre.astype(np.float64) - float(part.edge) / 2
        enter, leave = _slabs(np.clip(box + [[-1e-3], [1e-3]], 0, part.grid.shape[0] - 1) * part.spacing + corner, rays)
        active = np.flatnonzero((enter <= leave) & (enter < best))
        found, used = _march(
            part,
            origins[active],
            directions[active],
            enter[active],
            np.minimum(leave, best)[active],
            tolerance,
            max_steps,
        )
        steps[active] += used
        nearer = found < best[active]
        best[active[nearer]], index[active[nearer]] = found[nearer], number
    points, normals = np.zeros((count, 3)), np.zeros((count, 3))
    hit = index >= 0
    points[hit] = origins[hit] + best[hit, None] * directions[hit]
    for number, part in enumerate(body.parts):
        mine = index == number
        slope = grid_gradient_reference(part, to_cube(part, points[mine])[0])
        length = np.linalg.norm(slope, axis=1, keepdims=True)
        normals[mine] = np.where(length > 0, slope / np.where(length > 0, length, 1), -directions[mine])
    return Hits(best.astype(np.float32), index, points.astype(np.float32), normals.astype(np.float32), steps)


def _slabs(box: Array, rays: Rays) -> tuple[Array, Array]:
    """(N,) entry, at least 0, and exit of rays through a box (2, 3)."""
    origins, directions = rays.origins.astype(np.float64), rays.directions.astype(np.float64)
    still = directions == 0
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (box[:, None, :] - origins) / directions
    within = (origins >= box[0]) & (origins <= box[1])
    first = np.where(still, np.where(within, -np.inf, np.inf), t.min(axis=0))
    last = np.where(still, np.where(within, np.inf, -np.inf), t.max(axis=0))
    return np.maximum(first.max(axis=1), 0), last.min(axis=1)


def _march(
    part: PartSdf, origins: Array, directions: Array, t: Array, end: Array, tolerance: float, max_steps: int
) -> tuple[Array, IntArray]:
    """(N,) first t at which the part is not positive, infinite if nowhere; (N,) cells visited."""
    n, h = part.grid.shape[0], part.spacing
    start = (origins - (part.centre.astype(np.float64) - float(part.edge) / 2)) / h
    speed = directions / h
    reach = 1 / max(lipschitz(part.grid, h, outside=True), 1e-30)
    corners = np.array(list(np.ndindex(2, 2, 2)))
    found, steps = np.full(len(t), np.inf), np.zeros(len(t), np.int32)
    t, active = t.copy(), np.arange(len(t))
    cell = np.clip(np.floor(start + t[:, None] * speed).astype(int), 0, n - 2)
    for _ in range(max_steps):
        active = active[(t[active] <= end[active]) & ((cell[active] >= 0) & (cell[active] <= n - 2)).all(axis=1)]
        if len(active) == 0:
            break
        u, w, c, now = start[active], speed[active], cell[active], t[active]
        steps[active] += 1
        grid = part.grid[tuple((c[:, None] + corners).transpose(2, 0, 1))].astype(np.float64)  # (A, 8)

        def along(when: Array, u: Array = u, w: Array = w, c: Array = c, grid: Array = grid) -> Array:
            offset = (np.clip(u + when[:, None] * w, 0, n - 1) - c)[:, None]
            result: Array = (grid * np.where(corners, offset, 1 - offset).prod(axis=2)).sum(axis=1)
            return result

        value = along(now)
        with np.errstate(divide="ignore", invalid="ignore"):
            exits = np.where(w != 0, (c + (w > 0) - u) / w, np.inf)
        leave = np.maximum(exits.min(axis=1), now)
        jump = now + value * reach
        jumps = (value > 0) & (jump > leave)
        low, high = _first_bracket(along, now, np.where(jumps, now, leave))
        for _ in range(60):
            middle = np.where(np.isfinite(high), 0.5 * (low + np.where(np.isfinite(high), high, 0)), low)
            positive = along(middle) > 0
            low, high = np.where(positive, middle, low), np.where(positive, high, middle)
        hit = (value <= 0) | (~jumps & np.isfinite(high) & (low <= end[active]))
        found[active[hit]] = np.where(value <= 0, now, low)[hit]
        t[active] = np.where(jumps, jump, leave)
        step = np.zeros_like(c)
        step[np.arange(len(c)), exits.argmin(axis=1)] = 1
        stepped = c + step * np.where(w > 0, 1, -1)
        jumped = np.clip(np.floor(u + jump[:, None] * w), 0, n - 2).astype(int)
        cell[active] = np.where(jumps[:, None], jumped, stepped)
        active = active[~hit]
    return found, steps


def _first_bracket(along: Callable[[Array], Array], start: Array, stop: Array) -> tuple[Array, Array]:
    """First of 64 equal intervals at whose end `along` is not positive: (N,) ends, the far one infinite if none.

    The compiled kernel examines the cubic's extremes, this one many points: another method for the same result.
    """
    low, high = start.copy(), np.full(len(start), np.inf)
    for share in np.linspace(0, 1, 65)[1:]:
        when = start + share * (stop - start)
        below = along(when) <= 0
        high = np.where(below & np.isinf(high), when, high)
        low = np.where(np.isinf(high), when, low)
    return low, high
