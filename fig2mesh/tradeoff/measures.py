"""Errors of a run against the finest one, the Pareto front, and its knee."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.asset import TexturedMesh
from fig2mesh.mesh.simplify import deviation, spread
from fig2mesh.records import Mesh
from fig2mesh.tradeoff.sweep import Run


@dataclass(frozen=True)
class MeasuredRun:
    """A run and its errors against the finest run; NaN where it failed.

    chamfer_mm, hausdorff_mm : mean and maximum distance, both ways, of a figure 1.79 m high
    normal_deg : mean angle between normals at nearest points, both ways
    """

    run: Run
    chamfer_mm: float
    hausdorff_mm: float
    normal_deg: float


def measure(run: Run, finest: TexturedMesh) -> MeasuredRun:
    """Measure the errors of a run against the mesh of the finest run."""
    if run.mesh is None:
        return MeasuredRun(run, float("nan"), float("nan"), float("nan"))
    made, reference = _solid(run.mesh), _solid(finest)
    mean, worst = deviation(made, reference)
    angle = (normal_angle(made, reference) + normal_angle(reference, made)) / 2
    return MeasuredRun(run, 1000 * mean, 1000 * worst, angle)


def normal_angle(mesh: Mesh, target: Mesh) -> float:
    """Mean angle in degrees between triangles of `mesh` and the nearest ones of `target`, over its surface."""
    import open3d

    points, faces = spread(mesh)
    scene = open3d.t.geometry.RaycastingScene()
    tensor: Any = open3d.core.Tensor
    scene.add_triangles(tensor(target.vertices.copy()), tensor(target.faces.astype(np.uint32)))
    theirs = scene.compute_closest_points(tensor(points))["primitive_normals"].numpy().astype(np.float64)
    a, b, c = (mesh.vertices[mesh.faces[faces, i]].astype(np.float64) for i in range(3))
    ours = np.cross(b - a, c - a)
    ours /= np.maximum(np.linalg.norm(ours, axis=1, keepdims=True), 1e-30)
    return float(np.rad2deg(np.arccos(np.clip((ours * theirs).sum(axis=1), -1, 1))).mean())


def _solid(mesh: TexturedMesh) -> Mesh:
    """Surface of a textured mesh; the copies of vertices along seams do not matter for distances."""
    return Mesh(mesh.vertices, mesh.faces)


def pareto(costs: Sequence[float], errors: Sequence[float]) -> NDArray[np.int64]:
    """Indices of the Pareto-optimal points, by rising cost; points with NaN are excluded."""
    order = sorted(range(len(costs)), key=lambda i: (costs[i], errors[i]))
    front: list[int] = []
    for i in order:
        if np.isfinite(costs[i]) and np.isfinite(errors[i]) and (not front or errors[i] < errors[front[-1]]):
            front.append(i)
    return np.array(front, np.int64)


def knee(costs: Sequence[float], errors: Sequence[float]) -> int:
    """Index of the point of a front furthest below the line between its ends, in log of cost against error.

    After Satopaa et al. 2011, *Finding a "kneedle" in a haystack*. 0 for a front of one or two points.
    """
    x, y = np.log(np.asarray(costs, np.float64)), np.asarray(errors, np.float64)
    if len(x) < 3:
        return 0
    x, y = (x - x[0]) / (x[-1] - x[0]), (y - y[-1]) / max(float(y[0] - y[-1]), 1e-12)
    return int(np.argmax(1 - x - y))
