"""Errors where the answer is known, and the laws of a Pareto front."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from exporters.asset import TexturedMesh
from fig2mesh.records import Mesh
from fig2mesh.tradeoff.measures import knee, measure, normal_angle, pareto
from fig2mesh.tradeoff.sweep import Run

POINTS = st.lists(st.tuples(st.floats(0.1, 100), st.floats(0, 10)), min_size=1, max_size=30)


def ball(radius: float) -> TexturedMesh:
    made = trimesh.creation.icosphere(4, radius)
    vertices = made.vertices.astype(np.float32)
    return TexturedMesh(vertices, made.faces.astype(np.int32), None, np.arange(len(vertices), dtype=np.int32))


def run(mesh: TexturedMesh | None) -> Run:
    return Run("voxel", "0.1", {"parts": 2.0, "solid": 1.0}, 100.0, mesh, failure="" if mesh else "too thin")


def test_distance_of_balls_is_the_difference_of_their_radii() -> None:
    found = measure(run(ball(1.01)), ball(1.0))
    assert found.chamfer_mm == pytest.approx(10, rel=0.02)
    assert found.hausdorff_mm == pytest.approx(10, rel=0.25)
    assert found.normal_deg < 1.5
    assert found.run.total_s == 3.0


def test_a_surface_is_not_off_from_itself() -> None:
    found = measure(run(ball(1.0)), ball(1.0))
    assert found.chamfer_mm < 1e-3
    assert found.normal_deg < 0.05


def test_an_edge_turns_normals() -> None:
    """Of a cube against the ball in it: 0 in the middle of a face, 54.7 degrees at a corner."""
    cube = trimesh.creation.box((2, 2, 2)).subdivide().subdivide().subdivide()
    mesh = Mesh(cube.vertices.astype(np.float32), cube.faces.astype(np.int32))
    sphere = ball(1.0)
    x, y = np.meshgrid(*[(np.arange(400) + 0.5) / 200 - 1] * 2)
    expected = np.rad2deg(np.arccos(1 / np.sqrt(1 + x**2 + y**2))).mean()
    assert normal_angle(mesh, Mesh(sphere.vertices, sphere.faces)) == pytest.approx(expected, abs=1.0)


def test_what_failed_has_no_errors() -> None:
    found = measure(run(None), ball(1.0))
    assert np.isnan([found.chamfer_mm, found.hausdorff_mm, found.normal_deg]).all()


@given(POINTS)
def test_no_point_beats_one_of_the_front(points: list[tuple[float, float]]) -> None:
    costs, errors = zip(*points, strict=True)
    front = pareto(costs, errors)
    assert len(front) > 0
    for i in front:
        better = [c <= costs[i] and e <= errors[i] and (c < costs[i] or e < errors[i]) for c, e in points]
        assert not any(better)
    for k in range(len(points)):
        assert any(costs[i] <= costs[k] and errors[i] <= errors[k] for i in front)
    assert np.all(np.diff([costs[i] for i in front]) > 0)


def test_failed_runs_are_on_no_front() -> None:
    assert pareto([1, 2, 3], [float("nan"), 5, 4]).tolist() == [1, 2]


def test_the_knee_is_where_more_time_stops_helping() -> None:
    assert knee([1, 2, 4, 8, 16], [10, 5, 1, 0.9, 0.8]) == 2
    assert knee([1], [3]) == knee([1, 2], [3, 1]) == 0
