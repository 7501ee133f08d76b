"""The compiled sphere tracer; `reference.trace_reference` is its NumPy twin."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.compiled import helper, kernel
from fig2mesh.field.empty_space import EmptySpace
from fig2mesh.field.grid_kernels import owner_at
from fig2mesh.field.grids import Grids
from fig2mesh.field.march_kernel import FAR, first_hit, reciprocal, unit_normal


@helper
def boxes_of_block(
    grids: Grids,
    origins: NDArray[np.float32],
    directions: NDArray[np.float32],
    start: int,
    stop: int,
    found: NDArray[np.int64],
    first: NDArray[np.float64],
    last: NDArray[np.float64],
) -> int:
    """Write to `found` the grids whose boxes some ray from `start` to `stop` may meet, and return how many.

    The slab test in interval arithmetic over all rays at once: neighbouring pixels mostly meet the same few boxes.

    first, last : (G,) work arrays
    """
    for g in range(grids.sizes.shape[0]):
        first[g], last[g] = 0.0, FAR
    for axis in range(3):
        o0, o1, r0, r1 = math.inf, -math.inf, math.inf, -math.inf
        for ray in range(start, stop):
            o, r = np.float64(origins[ray, axis]), reciprocal(np.float64(directions[ray, axis]))
            o0, o1, r0, r1 = min(o0, o), max(o1, o), min(r0, r), max(r1, r)
        if r0 < 0.0 < r1:
            continue  # no constraint from this axis
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
    space: EmptySpace,
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
    """Trace the blocks `first, first + step, ...` of rays; the outputs come filled with the values of a miss."""
    count = len(origins)
    total = grids.sizes.shape[0]
    entry = np.empty(total, np.float64)
    leave = np.empty(total, np.float64)
    order = np.empty(total, np.int64)
    found = np.empty(total, np.int64)
    for start in range(first * block, count, step * block):
        stop = min(start + block, count)
        candidates = boxes_of_block(grids, origins, directions, start, stop, found, entry, leave)
        if candidates == 0:
            continue
        for ray in range(start, stop):
            ox, oy, oz = np.float64(origins[ray, 0]), np.float64(origins[ray, 1]), np.float64(origins[ray, 2])
            dx, dy, dz = np.float64(directions[ray, 0]), np.float64(directions[ray, 1]), np.float64(directions[ray, 2])
            best, hit, spent = first_hit(
                grids, space, found, candidates, order, entry, leave, ox, oy, oz, dx, dy, dz, tolerance, max_steps
            )
            steps[ray] = spent
            if hit < 0:
                continue
            px, py, pz = ox + best * dx, oy + best * dy, oz + best * dz
            depth[ray] = best
            part_index[ray] = owner_at(grids, hit, px, py, pz)
            points[ray, 0], points[ray, 1], points[ray, 2] = px, py, pz
            if with_normals:
                scale = 1.0 / grids.spacings[hit]
                normals[ray, 0], normals[ray, 1], normals[ray, 2] = unit_normal(
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
