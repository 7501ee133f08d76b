"""Bodies and rays that the tests of this folder share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field import analytic
from fig2mesh.field.body import Body
from fig2mesh.records import PartSdf, Rays

BALL = analytic.sphere((0.1, -0.2, 0.05), 0.4)
LIMB = ((-0.3, -0.25, 0.0), (0.35, 0.3, 0.1), 0.12)


def ball(n: int = 64) -> PartSdf:
    return analytic.sample(BALL, 1, (0.1, -0.2, 0.05), 1.1, n)


def limb(n: int = 64) -> PartSdf:
    return analytic.sample(analytic.capsule(*LIMB), 3, (0.0, 0.0, 0.0), 1.2, n)


def pair() -> Body:
    """Two parts that overlap, on grids of different sizes."""
    return Body((ball(48), limb(33)))


def harsh(seed: int = 3) -> Body:
    """Possible network fields: limbs thinner than a cell, distances three times too large, ripples, a hollow grid."""
    rng = np.random.default_rng(seed)
    parts = []
    for radius, n in ((0.004, 32), (0.012, 40), (0.05, 48), (0.1, 64)):
        function = analytic.capsule(rng.uniform(-0.4, 0.4, 3), rng.uniform(-0.4, 0.4, 3), radius)
        clean = analytic.sample(function, 1, (0.0, 0.0, 0.0), 1.1, n)
        factor = 1 + 2 * rng.random(clean.grid.shape)
        parts.append(PartSdf(1, clean.grid * factor, clean.centre, clean.edge))
    empty = analytic.sample(lambda points: np.full(len(points), 0.01), 2, (0.0, 0.0, 0.0), 1.0, 32)
    return Body((*parts, empty))


def random_rays(count: int, seed: int = 0, *, radius: float = 1.5, target: float = 0.6) -> Rays:
    """Rays from a sphere about the origin towards random points near it."""
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(count, 3))
    origins *= radius / np.linalg.norm(origins, axis=1, keepdims=True)
    return towards(origins, rng.uniform(-target, target, (count, 3)))


def towards(origins: NDArray[np.float64], targets: NDArray[np.float64]) -> Rays:
    directions = targets - origins
    return Rays(origins, directions / np.linalg.norm(directions, axis=1, keepdims=True))


def gap(first: NDArray[Any], second: NDArray[Any]) -> NDArray[np.float64]:
    """Difference of depths; infinite where only one ray hit something, 0 where neither did."""
    met = np.isfinite(first) & np.isfinite(second)
    difference = np.subtract(first, second, out=np.zeros(len(first)), where=met)
    return np.where(np.isfinite(first) == np.isfinite(second), np.abs(difference), np.inf)


def first_below(body: Body, rays: Rays, reach: float, samples: int) -> NDArray[np.float64]:
    """Depth at which a fine march first finds the field not positive; infinite if it never is."""
    depth = np.full(len(rays.origins), np.inf)
    for t in np.linspace(0, reach, samples)[::-1]:
        points = rays.origins.astype(np.float64) + t * rays.directions
        depth[body.evaluate(points)[0] <= 0] = t
    return depth
