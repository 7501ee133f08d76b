"""Sphere tracing of a body (paper §4.5, appendix B), made safe for fields that are not true distances."""

from __future__ import annotations

import numpy as np

from fig2mesh import counters
from fig2mesh.field.body import Body
from fig2mesh.field.compiled import run_blocks, sealed
from fig2mesh.field.trace_kernel import trace_blocks
from fig2mesh.records import Hits, Rays

_BLOCK = 64
"""Rays per block that share one test against the bounding boxes: a stretch of an image row."""


def trace(body: Body, rays: Rays, *, tolerance: float = 1e-4, max_steps: int = 1024, with_normals: bool = True) -> Hits:
    """First intersection of each ray with the body's surface.

    tolerance : FIGURE units along the ray; the depth is at most so much short of the surface of the grids' interpolant
    max_steps : cells visited for each part before the ray passes it by; no straight line crosses more than 3 n, so it
        only serves to bound the work
    with_normals : False leaves the normals zero, and costs nothing for them

    Each part is marched only inside of the box around its negative region, nearest box first. A step goes through cells
    known to be empty, and in the others the interpolant is solved. Values beside the surface therefore do not matter: a
    field may overestimate distances by any factor at no cost; see `empty_space` and `march_kernel`.

    A ray that starts inside meets the surface at once, at depth 0. A part that is still negative at a face of its cube
    ends there, as in `Body.distance`; normals there are the field's, not the face's. `Hits.steps` counts cells.
    """
    count = len(rays.origins)
    depth = np.full(count, np.inf, np.float32)
    part_index = np.full(count, -1, np.int32)
    points = np.zeros((count, 3), np.float32)
    normals = np.zeros((count, 3), np.float32)
    steps = np.zeros(count, np.int32)
    if not tolerance > 0:
        raise ValueError(f"tolerance: {tolerance}, expected a positive length")
    grids, space = body.grids, body.empty_space
    origins, directions = sealed(rays.origins, np.float32), sealed(rays.directions, np.float32)

    def run(first: int, step: int) -> None:
        trace_blocks(
            grids,
            space,
            origins,
            directions,
            first,
            step,
            _BLOCK,
            float(tolerance),
            int(max_steps),
            bool(with_normals),
            depth,
            part_index,
            points,
            normals,
            steps,
        )

    counters.count("rays", count)
    run_blocks(run, count, _BLOCK)
    return Hits(depth, part_index, points, normals, steps)
