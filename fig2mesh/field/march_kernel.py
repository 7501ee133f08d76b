"""Compiled search for the first intersection of a ray with the grids; `reference.trace_reference` is its NumPy twin."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.compiled import helper
from fig2mesh.field.empty_space import EmptySpace, cell_index
from fig2mesh.field.grid_kernels import cell_of, node, slopes_at
from fig2mesh.field.grids import Grids

FAR = 1e30
"""Stands for "never" in arithmetic where infinity times zero would make NaN."""


@helper
def first_root(c0: float, c1: float, c2: float, c3: float, tolerance: float) -> float:
    """Smallest root of c0 + c1 s + c2 s^2 + c3 s^3 in (0, 1], given c0 > 0; 2 if there is none.

    In Bernstein's form the coefficients enclose the values, and one change of sign means one root. What is left is
    settled at the extremes: between them a cubic is monotone, so that also two roots close together are found, a limb
    grazed or thinner than a cell. Then Newton's method, kept inside of the bracket by bisection. The end returned is
    the one just outside of the solid.
    """
    b1 = c0 + c1 * (1.0 / 3.0)
    b2 = b1 + (c1 + c2) * (1.0 / 3.0)
    b3 = c0 + c1 + c2 + c3
    if b1 > 0.0 and b2 > 0.0 and b3 > 0.0:
        return 2.0
    a = 0.0
    b = 1.0
    if b3 > 0.0 or (b1 <= 0.0 and b2 > 0.0):
        # where the derivative c1 + 2 c2 s + 3 c3 s^2 vanishes, in a form that survives a vanishing c3
        low = 2.0
        high = 2.0
        discriminant = c2 * c2 - 3.0 * c3 * c1
        if discriminant > 0.0:
            q = -(c2 + math.copysign(math.sqrt(discriminant), c2))
            r1 = c1 / q if q != 0.0 else 2.0
            r2 = q / (3.0 * c3) if c3 != 0.0 else 2.0
            low, high = min(r1, r2), max(r1, r2)
        b = 2.0
        for check in range(3):
            s = 1.0 if check == 2 else (low if check == 0 else high)
            if a < s <= 1.0:
                if c0 + s * (c1 + s * (c2 + s * c3)) <= 0.0:
                    b = s
                    break
                a = s
        if b > 1.0:
            return 2.0
        s = 0.5 * (a + b)
    else:
        s = c0 / (c0 - b3)
    while b - a > tolerance:
        value = c0 + s * (c1 + s * (c2 + s * c3))
        if value > 0.0:
            a = s
        else:
            b = s
        slope = c1 + s * (2.0 * c2 + s * 3.0 * c3)
        # aim half a tolerance beyond the root: the bracket then closes from both sides
        step = -value / slope if slope < 0.0 else FAR
        s = s + step + math.copysign(0.4 * tolerance, step)
        if not a < s < b:
            s = 0.5 * (a + b)
            if s <= a or s >= b:
                break
    return a


@helper
def reciprocal(d: float) -> float:
    """1 / d, but huge instead of infinite, so that zero times it is zero."""
    return 1.0 / d if abs(d) > 1.0 / FAR else FAR


@helper
def march(
    values: NDArray[np.float32],
    base: int,
    free_cells: NDArray[np.uint8],
    cells: int,
    n: int,
    ux: float,
    uy: float,
    uz: float,
    wx: float,
    wy: float,
    wz: float,
    rx: float,
    ry: float,
    rz: float,
    t: float,
    end: float,
    tolerance: float,
    max_steps: int,
) -> tuple[float, int]:
    """First t in [t, end] where a grid is not positive along u + t w, infinite if nowhere; and the cells visited.

    From an empty cell the ray goes to where it leaves the block of empty cells around it. An occupied cell is settled
    exactly, as a cubic along the ray. So every step passes at least one cell, a grazing ray cannot run out of steps,
    and no limb is thin enough to be stepped over, whatever the values are.

    values, base, n : the grid's nodes and their start, `Grids`; free_cells, cells : the same of `EmptySpace.free`.
        Single arrays, because a record of many costs more to hand over than a step of the march
    u, w, r : start and direction in grid coordinates, and one over the direction
    """
    # The plane through which a block of f cells is left lies at i + f or at i + 1 - f.
    sx, sy, sz = 1 if wx > 0.0 else -1, 1 if wy > 0.0 else -1, 1 if wz > 0.0 else -1
    px, py, pz = (0.0 if wx > 0.0 else 1.0) - ux, (0.0 if wy > 0.0 else 1.0) - uy, (0.0 if wz > 0.0 else 1.0) - uz
    last = float(n - 1)
    across = (n + 2) >> 2
    i, j, k = cell_of(ux + t * wx, n), cell_of(uy + t * wy, n), cell_of(uz + t * wz, n)
    steps = 0
    while steps < max_steps:
        steps += 1
        free = int(
            np.int64(free_cells[np.uint64(cells + cell_index(across, i, j, k))])
        )  # int alone would make it unsigned, and sums with it floats
        f = max(free, 1)
        tx = (i + sx * f + px) * rx if wx != 0.0 else FAR
        ty = (j + sy * f + py) * ry if wy != 0.0 else FAR
        tz = (k + sz * f + pz) * rz if wz != 0.0 else FAR
        leave = max(min(tx, ty, tz), t)
        if free == 0:
            x = min(max(ux + t * wx, 0.0), last) - i
            y = min(max(uy + t * wy, 0.0), last) - j
            z = min(max(uz + t * wz, 0.0), last) - k
            e = base + (i * n + j) * n + k
            f000, f001, f010, f011 = node(values, e), node(values, e + 1), node(values, e + n), node(values, e + n + 1)
            e += n * n
            f100, f101, f110, f111 = node(values, e), node(values, e + 1), node(values, e + n), node(values, e + n + 1)
            # the interpolant as a polynomial in the cell's coordinates
            kz, ky, kx = f001 - f000, f010 - f000, f100 - f000
            kyz, kxz, kxy = f011 - f010 - kz, f101 - f100 - kz, f110 - f100 - ky
            kxyz = f111 - f110 - f101 + f100 - kyz
            value = f000 + z * kz + y * (ky + z * kyz) + x * (kx + z * kxz + y * (kxy + z * kxyz))
            if value <= 0.0:
                return t, steps
            length = leave - t
            vx, vy, vz = wx * length, wy * length, wz * length
            c1 = vx * (kx + z * kxz + y * (kxy + z * kxyz)) + vy * (ky + z * kyz + x * (kxy + z * kxyz))
            c1 += vz * (kz + y * kyz + x * (kxz + y * kxyz))
            c2 = vx * vy * (kxy + z * kxyz) + vx * vz * (kxz + y * kxyz) + vy * vz * (kyz + x * kxyz)
            s = first_root(value, c1, c2, vx * vy * vz * kxyz, tolerance / max(length, 1e-12))
            if s <= 1.0:
                t += s * length
                return (t, steps) if t <= end else (math.inf, steps)
        t = leave
        if t > end:
            break
        if f > 1:
            u, v, w = cell_of(ux + t * wx, n), cell_of(uy + t * wy, n), cell_of(uz + t * wz, n)
        else:
            u, v, w = i, j, k
        # along the axis of the plane the cell is known; rounding must not put the ray back
        if tx <= ty and tx <= tz:
            i, j, k = i + sx * f, v, w
        elif ty <= tz:
            i, j, k = u, j + sy * f, w
        else:
            i, j, k = u, v, k + sz * f
        if i < 0 or j < 0 or k < 0 or i > n - 2 or j > n - 2 or k > n - 2:
            break
    return math.inf, steps


@helper
def march_grid(
    grids: Grids,
    space: EmptySpace,
    g: int,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    rx: float,
    ry: float,
    rz: float,
    t: float,
    end: float,
    tolerance: float,
    max_steps: int,
) -> tuple[float, int]:
    """`march` through grid g along o + t d, FIGURE; r : one over d."""
    h = grids.spacings[g]
    scale = 1.0 / h
    return march(
        grids.values,
        grids.starts[g],
        space.free,
        space.free_starts[g],
        grids.sizes[g],
        (ox - grids.origins[g, 0]) * scale,
        (oy - grids.origins[g, 1]) * scale,
        (oz - grids.origins[g, 2]) * scale,
        dx * scale,
        dy * scale,
        dz * scale,
        rx * h,
        ry * h,
        rz * h,
        t,
        end,
        tolerance,
        max_steps,
    )


@helper
def first_hit(
    grids: Grids,
    space: EmptySpace,
    found: NDArray[np.int64],
    candidates: int,
    order: NDArray[np.int64],
    entry: NDArray[np.float64],
    leave: NDArray[np.float64],
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    tolerance: float,
    max_steps: int,
) -> tuple[float, int, int]:
    """Smallest t at which o + t d meets one of `candidates` grids in `found`, that grid (or -1), and cells visited.

    Each grid is marched only inside of the box around its negative region, nearest box first.

    order, entry, leave : (G,) work arrays
    """
    rx, ry, rz = reciprocal(dx), reciprocal(dy), reciprocal(dz)
    met = 0
    for candidate in range(candidates):
        g = found[candidate]
        ax, bx = (grids.boxes[g, 0, 0] - ox) * rx, (grids.boxes[g, 1, 0] - ox) * rx
        ay, by = (grids.boxes[g, 0, 1] - oy) * ry, (grids.boxes[g, 1, 1] - oy) * ry
        az, bz = (grids.boxes[g, 0, 2] - oz) * rz, (grids.boxes[g, 1, 2] - oz) * rz
        a = max(min(ax, bx), min(ay, by), min(az, bz), 0.0)
        b = min(max(ax, bx), max(ay, by), max(az, bz))
        if a <= b:
            at = met
            while at > 0 and entry[order[at - 1]] > a:
                order[at] = order[at - 1]
                at -= 1
            order[at] = g
            entry[g], leave[g] = a, b
            met += 1
    best = math.inf
    hit = -1
    spent = 0
    for at in range(met):
        g = order[at]
        if entry[g] >= best:
            break
        end = min(leave[g], best)
        t, used = march_grid(grids, space, g, ox, oy, oz, dx, dy, dz, rx, ry, rz, entry[g], end, tolerance, max_steps)
        spent += used
        if t < best:
            best = t
            hit = g
    return best, hit, spent


@helper
def unit_normal(
    values: NDArray[np.float32],
    start: int,
    n: int,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
) -> tuple[float, float, float]:
    """The field's normal at grid coordinates that a ray of direction d meets; where the field is flat, -d.

    values, start, n : the grid's nodes and their start, `Grids`
    """
    last = float(n - 1)
    gx, gy, gz = slopes_at(
        values, start, n, 1.0, min(max(x, 0.0), last), min(max(y, 0.0), last), min(max(z, 0.0), last)
    )
    length = math.sqrt(gx * gx + gy * gy + gz * gz)
    if length == 0.0:
        gx, gy, gz = -dx, -dy, -dz
        length = math.sqrt(gx * gx + gy * gy + gz * gz)
    scale = 1.0 / length
    return gx * scale, gy * scale, gz * scale
