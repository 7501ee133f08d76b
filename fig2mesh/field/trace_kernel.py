"""The compiled sphere tracer; `reference.trace_reference` is its NumPy twin."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.compiled import helper, kernel
from fig2mesh.field.grid_kernels import cell_of, grid_gradient, owner_at
from fig2mesh.field.grids import Grids

_FAR = 1e30  # stands for "never" in arithmetic where infinity times zero would make NaN


@helper
def first_root(c0: float, c1: float, c2: float, c3: float, tolerance: float) -> float:
    """Smallest root of c0 + c1 s + c2 s^2 + c3 s^3 in (0, 1], given c0 > 0; 2 where there is none.

    Between its extremes a cubic is monotone, so looking at them finds also two roots close together: a limb grazed
    or thinner than a cell. Then Newton's method, kept inside of the bracket by bisection. The end returned is the one
    just outside of the solid.
    """
    # where the derivative c1 + 2 c2 s + 3 c3 s^2 vanishes, in a form that survives a vanishing c3
    low = 2.0
    high = 2.0
    discriminant = c2 * c2 - 3.0 * c3 * c1
    if discriminant > 0.0:
        q = -(c2 + math.copysign(math.sqrt(discriminant), c2))
        r1 = c1 / q if q != 0.0 else 2.0
        r2 = q / (3.0 * c3) if c3 != 0.0 else 2.0
        low, high = min(r1, r2), max(r1, r2)
    a = 0.0
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
    while b - a > tolerance:
        value = c0 + s * (c1 + s * (c2 + s * c3))
        if value > 0.0:
            a = s
        else:
            b = s
        slope = c1 + s * (2.0 * c2 + s * 3.0 * c3)
        # aim half a tolerance beyond the root: the bracket then closes from both sides
        step = -value / slope if slope < 0.0 else _FAR
        s = s + step + math.copysign(0.4 * tolerance, step)
        if not a < s < b:
            s = 0.5 * (a + b)
            if s <= a or s >= b:
                break
    return a


@helper
def reciprocal(d: float) -> float:
    """1 / d, but huge instead of infinite, so that zero times it is zero."""
    return 1.0 / d if abs(d) > 1.0 / _FAR else _FAR


@helper
def march(
    grids: Grids,
    g: int,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    t: float,
    end: float,
    tolerance: float,
    max_steps: int,
) -> tuple[float, int]:
    """First t in [t, end] where grid g is not positive along o + t d, infinite if nowhere; and the cells looked at.

    Where the value divided by the grid's Lipschitz bound reaches past the ray's cell, the ray jumps: the surface cannot
    be nearer. Else the cell is settled exactly, as a cubic along the ray, and left for its neighbour. So every step
    passes at least one cell, a grazing ray cannot run out of steps, and no limb is thin enough to be stepped over.
    """
    n = grids.sizes[g]
    h = grids.spacings[g]
    values = grids.values
    base = grids.starts[g]
    reach = 1.0 / grids.slopes[g] if grids.slopes[g] > 0.0 else _FAR
    ux, uy, uz = (ox - grids.origins[g, 0]) / h, (oy - grids.origins[g, 1]) / h, (oz - grids.origins[g, 2]) / h
    wx, wy, wz = dx / h, dy / h, dz / h
    rx, ry, rz = reciprocal(wx), reciprocal(wy), reciprocal(wz)
    last = float(n - 1)
    i, j, k = cell_of(ux + t * wx, n), cell_of(uy + t * wy, n), cell_of(uz + t * wz, n)
    steps = 0
    while steps < max_steps:
        steps += 1
        x = min(max(ux + t * wx, 0.0), last) - i
        y = min(max(uy + t * wy, 0.0), last) - j
        z = min(max(uz + t * wz, 0.0), last) - k
        e = base + (i * n + j) * n + k
        f000, f001, f010, f011 = (
            np.float64(values[e]),
            np.float64(values[e + 1]),
            np.float64(values[e + n]),
            np.float64(values[e + n + 1]),
        )
        e += n * n
        f100, f101, f110, f111 = (
            np.float64(values[e]),
            np.float64(values[e + 1]),
            np.float64(values[e + n]),
            np.float64(values[e + n + 1]),
        )
        # the interpolant as a polynomial in the cell's coordinates
        kz, ky, kx = f001 - f000, f010 - f000, f100 - f000
        kyz, kxz, kxy = f011 - f010 - kz, f101 - f100 - kz, f110 - f100 - ky
        kxyz = f111 - f110 - f101 + f100 - kyz
        value = f000 + z * kz + y * (ky + z * kyz) + x * (kx + z * kxz + y * (kxy + z * kxyz))
        if value <= 0.0:
            return t, steps
        tx = (i + (1 if wx > 0.0 else 0) - ux) * rx if wx != 0.0 else _FAR
        ty = (j + (1 if wy > 0.0 else 0) - uy) * ry if wy != 0.0 else _FAR
        tz = (k + (1 if wz > 0.0 else 0) - uz) * rz if wz != 0.0 else _FAR
        leave = max(min(tx, ty, tz), t)
        jump = t + value * reach
        if jump > leave:
            t = jump
            if t > end:
                break
            i, j, k = cell_of(ux + t * wx, n), cell_of(uy + t * wy, n), cell_of(uz + t * wz, n)
            continue
        if min(f000, f001, f010, f011, f100, f101, f110, f111) <= 0.0:
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
        if tx <= ty and tx <= tz:
            i += 1 if wx > 0.0 else -1
        elif ty <= tz:
            j += 1 if wy > 0.0 else -1
        else:
            k += 1 if wz > 0.0 else -1
        if i < 0 or j < 0 or k < 0 or i > n - 2 or j > n - 2 or k > n - 2:
            break
    return math.inf, steps


@helper
def boxes_of_block(
    grids: Grids,
    origins: NDArray[np.float32],
    directions: NDArray[np.float32],
    start: int,
    stop: int,
    found: NDArray[np.int64],
) -> int:
    """Write to `found` the grids whose boxes some ray from `start` to `stop` may meet, and return how many.

    The slab test in interval arithmetic over all rays at once: neighbouring pixels mostly see the same few boxes.
    """
    first = np.zeros(grids.sizes.shape[0])
    last = np.full(grids.sizes.shape[0], _FAR)
    for axis in range(3):
        o0, o1, r0, r1 = math.inf, -math.inf, math.inf, -math.inf
        for ray in range(start, stop):
            o, r = np.float64(origins[ray, axis]), reciprocal(np.float64(directions[ray, axis]))
            o0, o1, r0, r1 = min(o0, o), max(o1, o), min(r0, r), max(r1, r)
        if r0 < 0.0 < r1:
            continue  # says nothing about this axis
        for g in range(grids.sizes.shape[0]):
            near, far = grids.boxes[g, 0, axis] - o1, grids.boxes[g, 1, axis] - o0
            slow, fast = r0, r1
            if r1 < 0.0:
                near, far = -far, -near
                slow, fast = -r1, -r0
            first[g] = max(first[g], near * (slow if near > 0.0 else fast))
            last[g] = min(last[g], far * (fast if far > 0.0 else slow))
    count = 0
    for g in range(grids.sizes.shape[0]):
        if first[g] <= last[g] and grids.boxes[g, 0, 0] <= grids.boxes[g, 1, 0]:
            found[count] = g
            count += 1
    return count


@kernel
def trace_blocks(
    grids: Grids,
    origins: NDArray[np.float32],
    directions: NDArray[np.float32],
    first: int,
    step: int,
    block: int,
    tolerance: float,
    max_steps: int,
    with_normals: bool,
    depth: NDArray[np.float32],
    part_index: NDArray[np.int32],
    points: NDArray[np.float32],
    normals: NDArray[np.float32],
    steps: NDArray[np.int32],
) -> None:
    """Trace the blocks `first, first + step, ...` of rays; the outputs come filled with what a miss has."""
    count = len(origins)
    total = grids.sizes.shape[0]
    entry = np.empty(total, np.float64)
    leave = np.empty(total, np.float64)
    order = np.empty(total, np.int64)
    found = np.empty(total, np.int64)
    for start in range(first * block, count, step * block):
        stop = min(start + block, count)
        candidates = boxes_of_block(grids, origins, directions, start, stop, found)
        if candidates == 0:
            continue
        for ray in range(start, stop):
            ox, oy, oz = np.float64(origins[ray, 0]), np.float64(origins[ray, 1]), np.float64(origins[ray, 2])
            dx, dy, dz = np.float64(directions[ray, 0]), np.float64(directions[ray, 1]), np.float64(directions[ray, 2])
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
            hit = total
            spent = 0
            for at in range(met):
                g = order[at]
                if entry[g] >= best:
                    break
                t, used = march(grids, g, ox, oy, oz, dx, dy, dz, entry[g], min(leave[g], best), tolerance, max_steps)
                spent += used
                if t < best:
                    best = t
                    hit = g
            steps[ray] = spent
            if hit == total:
                continue
            px, py, pz = ox + best * dx, oy + best * dy, oz + best * dz
            depth[ray] = best
            part_index[ray] = owner_at(grids, hit, px, py, pz)
            points[ray, 0], points[ray, 1], points[ray, 2] = px, py, pz
            if with_normals:
                h = grids.spacings[hit]
                last = float(grids.sizes[hit] - 1)
                gx, gy, gz = grid_gradient(
                    grids,
                    hit,
                    min(max((px - grids.origins[hit, 0]) / h, 0.0), last),
                    min(max((py - grids.origins[hit, 1]) / h, 0.0), last),
                    min(max((pz - grids.origins[hit, 2]) / h, 0.0), last),
                )
                length = math.sqrt(gx * gx + gy * gy + gz * gz)
                if length == 0.0:  # a flat spot: face the viewer
                    gx, gy, gz, length = -dx, -dy, -dz, 1.0
                normals[ray, 0], normals[ray, 1], normals[ray, 2] = gx / length, gy / length, gz / length
