"""Solids as formulas, functions of points: oracles for tracing, meshing and baking.

After I. Quilez, "Distance functions" (https://iquilezles.org/articles/distfunctions/). Exact unless stated otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.records import PartSdf
from fig2mesh.skeleton import PART

Distance = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Signed distance (N,) of points (N, 3), both float64 in FIGURE units, negative inside."""


def sphere(centre: Any, radius: float) -> Distance:
    """Sphere; centre : (3,) FIGURE."""
    middle = np.asarray(centre, np.float64)

    def distance(points: NDArray[np.float64]) -> NDArray[np.float64]:
        result: NDArray[np.float64] = np.linalg.norm(points - middle, axis=-1) - radius
        return result

    return distance


def capsule(start: Any, end: Any, radius: float, end_radius: float | None = None) -> Distance:
    """Convex hull of two spheres about `start` and `end`, (3,) FIGURE; with `end_radius` a tapered capsule."""
    a, axis = np.asarray(start, np.float64), np.asarray(end, np.float64) - np.asarray(start, np.float64)
    length = float(np.linalg.norm(axis))
    taper = radius - (radius if end_radius is None else end_radius)
    if length <= abs(taper):  # one sphere contains the other
        return sphere(start, radius) if taper >= 0 else sphere(end, radius - taper)
    sine = taper / length
    cosine = np.sqrt(1 - sine * sine)

    def distance(points: NDArray[np.float64]) -> NDArray[np.float64]:
        offset = points - a
        along = offset @ axis / length
        away = np.sqrt(np.maximum((offset * offset).sum(axis=-1) - along * along, 0.0))
        # the nearest point of the slanted side belongs to the sphere this far along
        share = np.clip((along - away * sine / cosine) / length, 0, 1)
        result: NDArray[np.float64] = np.hypot(along - share * length, away) - (radius - share * taper)
        return result

    return distance


def ellipsoid(centre: Any, radii: Any) -> Distance:
    """Ellipsoid with axes along FIGURE's; approximate: exact zero level, good near it, no distance far away."""
    middle, axes = np.asarray(centre, np.float64), np.asarray(radii, np.float64)

    def distance(points: NDArray[np.float64]) -> NDArray[np.float64]:
        scaled = (points - middle) / axes
        first, second = np.linalg.norm(scaled, axis=-1), np.linalg.norm(scaled / axes, axis=-1)
        inside = second < 1e-9  # the centre itself, where the quotient is 0 / 0
        result: NDArray[np.float64] = np.where(inside, -axes.min(), first * (first - 1) / np.where(inside, 1, second))
        return result

    return distance


def sample(function: Distance, part: int, centre: Any, edge: float, n: int = 64) -> PartSdf:
    """Sample `function` on n^3 nodes of the cube about `centre`, (3,) FIGURE."""
    middle = np.asarray(centre, np.float32)
    offsets = np.linspace(-edge / 2, edge / 2, n)
    lines = [float(c) + offsets for c in middle]
    points = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    return PartSdf(part, function(points).reshape(n, n, n).astype(np.float32), middle, float(edge))


MANNEQUIN: dict[str, tuple[tuple[float, float, float], tuple[float, float, float], float, float]] = {
    "torso": ((0.0, 0.42, 0.0), (0.0, 0.02, 0.0), 0.15, 0.14),
    "head": ((0.0, 0.75, 0.02), (0.0, 0.62, 0.0), 0.12, 0.07),
    **{
        f"{side}_{part}": ((sign * start[0], *start[1:]), (sign * end[0], *end[1:]), first, second)
        for side, sign in (("l", 1.0), ("r", -1.0))
        for part, start, end, first, second in (
            ("upper_arm", (0.17, 0.44, 0.0), (0.36, 0.24, 0.02), 0.055, 0.045),
            ("lower_arm", (0.36, 0.24, 0.02), (0.50, 0.02, 0.08), 0.045, 0.032),
            ("hand", (0.50, 0.02, 0.08), (0.53, -0.08, 0.10), 0.032, 0.022),
            ("upper_leg", (0.10, -0.02, 0.0), (0.13, -0.44, 0.02), 0.085, 0.06),
            ("lower_leg", (0.13, -0.44, 0.02), (0.15, -0.84, -0.02), 0.06, 0.04),
            ("foot", (0.15, -0.86, -0.02), (0.17, -0.88, 0.14), 0.05, 0.04),
        )
    },
}
"""A plain figure of 14 tapered limbs: start and end in FIGURE, radius at either; 1.79 units tall."""


def mannequin_parts() -> dict[str, Distance]:
    """Formula of each of `MANNEQUIN`'s parts; the figure is their minimum."""
    return {name: capsule(start, end, first, second) for name, (start, end, first, second) in MANNEQUIN.items()}


def mannequin(n: int = 64, *, margin: float = 0.15) -> tuple[PartSdf, ...]:
    """`MANNEQUIN` as 14 grids of n^3 nodes; margin : room around each limb, as a share of its extent."""
    parts = []
    for name, function in mannequin_parts().items():
        start, end, first, second = MANNEQUIN[name]
        ends, radii = np.array([start, end]), np.array([[first], [second]])
        low, high = (ends - radii).min(axis=0), (ends + radii).max(axis=0)
        parts.append(sample(function, PART[name], (low + high) / 2, float((high - low).max() * (1 + 2 * margin)), n))
    return tuple(parts)
