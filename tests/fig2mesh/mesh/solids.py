"""Analytic bodies for the tests of this folder, as fields; volumes are exact."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from manifold3d import Error, Manifold
from manifold3d import Mesh as ManifoldMesh

from fig2mesh.field.analytic import Distance, capsule, sphere
from fig2mesh.mesh.ball_pivot import ball_pivot
from fig2mesh.mesh.close import close
from fig2mesh.mesh.scan import scan
from fig2mesh.mesh.topology import check_solid
from fig2mesh.records import FloatArray, Mesh

SPACING = 0.03


@dataclass(frozen=True)
class Formula:
    """A field from a formula; `scale` other than 1 makes it over- or underestimate the distance."""

    function: Distance
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    scale: float = 1.0

    def distance(self, points: np.ndarray) -> FloatArray:
        return (self.scale * self.function(np.asarray(points, np.float64))).astype(np.float32)

    def gradient(self, points: np.ndarray) -> FloatArray:
        points, step = np.asarray(points, np.float64), 1e-5
        sides = [self.function(points + step * e) - self.function(points - step * e) for e in np.eye(3)]
        return (self.scale * np.stack(sides, axis=1) / (2 * step)).astype(np.float32)

    def bounds(self) -> FloatArray:
        return np.array([self.low, self.high], np.float32)


def union(*functions: Distance) -> Distance:
    return lambda points: np.min([function(points) for function in functions], axis=0)


def torus(radius: float, tube: float) -> Distance:
    return lambda p: np.hypot(np.hypot(p[:, 0], p[:, 1]) - radius, p[:, 2]) - tube


def _ball(radius: float) -> float:
    return 4 / 3 * np.pi * radius**3


@dataclass(frozen=True)
class Solid:
    """A body, how many pieces and handles it has, and its volume where a formula gives it."""

    field: Formula
    components: int = 1
    genus: int = 0
    volume: float | None = None


SOLIDS: dict[str, Solid] = {
    "sphere": Solid(Formula(sphere((0.1, 0.2, 0), 0.4), (-0.3, -0.2, -0.4), (0.5, 0.6, 0.4)), volume=_ball(0.4)),
    "capsule": Solid(
        Formula(capsule((0, -0.3, 0), (0, 0.4, 0), 0.2), (-0.2, -0.5, -0.2), (0.2, 0.6, 0.2)),
        volume=_ball(0.2) + 0.7 * np.pi * 0.2**2,
    ),
    "overlapping": Solid(
        Formula(
            union(capsule((0, -0.3, 0), (0, 0.4, 0), 0.16), capsule((0, 0.1, 0), (0.5, 0.2, 0.1), 0.1)),
            (-0.2, -0.5, -0.2),
            (0.65, 0.6, 0.25),
        )
    ),
    "two spheres": Solid(
        Formula(union(sphere((0, 0, 0), 0.35), sphere((0.6, 0.1, 0), 0.05)), (-0.35, -0.35, -0.35), (0.65, 0.35, 0.35)),
        components=2,
        volume=_ball(0.35) + _ball(0.05),
    ),
    "thin capsule": Solid(
        Formula(capsule((0, -0.4, 0), (0.2, 0.4, 0.1), 0.02), (-0.02, -0.42, -0.02), (0.22, 0.42, 0.12)),
        volume=_ball(0.02) + np.hypot(np.hypot(0.2, 0.8), 0.1) * np.pi * 0.02**2,
    ),
    "torus": Solid(
        Formula(torus(0.4, 0.12), (-0.52, -0.52, -0.12), (0.52, 0.52, 0.12)),
        genus=1,
        volume=2 * np.pi**2 * 0.4 * 0.12**2,
    ),
    "hollow sphere": Solid(
        Formula(lambda p: np.abs(np.linalg.norm(p, axis=1) - 0.3) - 0.1, (-0.4, -0.4, -0.4), (0.4, 0.4, 0.4)),
        volume=_ball(0.4),
    ),
}


@cache
def closed(name: str) -> Mesh:
    """A body scanned, ball pivoted and closed."""
    field = SOLIDS[name].field
    return close(ball_pivot(scan(field, spacing=SPACING, seed=0), SPACING), field, method="fill")[0]


def assert_solid(mesh: Mesh, components: int = 1, genus: int = 0) -> None:
    """The law of this folder: closed, oriented, manifold, and the body's own pieces and handles."""
    report = check_solid(mesh)
    assert report.outward, report
    assert (report.components, report.genus) == (components, genus)
    judge = Manifold(ManifoldMesh(mesh.vertices.copy(), mesh.faces.astype(np.uint32)))
    assert judge.status() == Error.NoError
    assert judge.num_tri() > 0
