"""Cost of the tracer's tolerance: depth errors, cells visited, seconds."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Final

import numpy as np

from fig2mesh.field.body import Body
from fig2mesh.field.camera import VIEW_YAW_DEG, framing, orthographic
from fig2mesh.field.trace import trace
from fig2mesh.records import Rays

TOLERANCES: Final = (1e-2, 1e-3, 1e-4, 1e-5)
EXACT: Final = 1e-7
SIZE: Final = 512


@dataclass(frozen=True)
class Tolerance:
    """Errors and costs of one tolerance.

    tolerance : FIGURE units, which are metres for a figure 1.79 m high
    mean_mm, worst_mm : errors of depth over all rays that hit with both tolerances
    steps : cells per ray; seconds : for the four views
    """

    tolerance: float
    mean_mm: float
    worst_mm: float
    steps: float
    seconds: float


def tolerances(body: Body) -> tuple[Tolerance, ...]:
    """Measure the four views of a body at every tolerance."""
    views = [_rays(body, yaw) for yaw in VIEW_YAW_DEG.values()]
    exact = [trace(body, rays, tolerance=EXACT, with_normals=False).depth for rays in views]
    result = []
    for tolerance in TOLERANCES:
        start = time.perf_counter()
        hits = [trace(body, rays, tolerance=tolerance, with_normals=False) for rays in views]
        seconds = time.perf_counter() - start
        pairs = [np.isfinite(hit.depth) & np.isfinite(depth) for hit, depth in zip(hits, exact, strict=True)]
        errors = np.concatenate(
            [np.abs(hit.depth[both] - depth[both]) for hit, depth, both in zip(hits, exact, pairs, strict=True)]
        )
        steps = float(np.mean([hit.steps.mean() for hit in hits]))
        mean_mm, worst_mm = 1000 * float(errors.mean()), 1000 * float(errors.max())
        result.append(Tolerance(tolerance, mean_mm, worst_mm, steps, seconds))
    return tuple(result)


def _rays(body: Body, yaw: float) -> Rays:
    centre, height = framing(body.bounds(), (SIZE, SIZE), yaw)
    return orthographic(yaw, size=(SIZE, SIZE), height=height, centre=centre)
