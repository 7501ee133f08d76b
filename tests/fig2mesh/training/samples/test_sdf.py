"""Signed distances: two ways of computing them, one of knowing them."""

from __future__ import annotations

import sys
from functools import cache

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from fig2mesh.training.bodies.partition import partition
from fig2mesh.training.samples.sdf import signed_distance, signed_distance_torch
from tests.fig2mesh.training.figures import capsule_man

Solid = tuple[NDArray[np.float64], NDArray[np.int64]]

SAG = 0.006
"""Depth of the triangles of `ball` below their sphere of radius 1."""

POINTS = arrays(np.float64, (20, 3), elements=st.floats(-1.5, 1.5, width=32))


@cache
def ball() -> Solid:
    sphere = trimesh.creation.icosphere(subdivisions=3)
    return np.asarray(sphere.vertices), np.asarray(sphere.faces)


@cache
def shell() -> Solid:
    """A ball of radius 1 with a cavity of radius 1/2."""
    vertices, faces = ball()
    return np.concatenate([vertices, vertices / 2]), np.concatenate([faces, faces[:, ::-1] + len(vertices)])


@pytest.mark.parametrize("way", [signed_distance, signed_distance_torch])
@pytest.mark.parametrize("hollow", [False, True])
@settings(max_examples=15, deadline=None)
@given(points=POINTS)
def test_balls_and_cavities(way, hollow: bool, points: NDArray[np.float64]) -> None:  # type: ignore[no-untyped-def]
    radius = np.linalg.norm(points, axis=1)
    exact = np.maximum(radius - 1, 0.5 - radius) if hollow else radius - 1
    found = way(*(shell() if hollow else ball()), points)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, exact, atol=SAG)
    clear = np.abs(exact) > SAG
    np.testing.assert_array_equal(found[clear] < 0, exact[clear] < 0)


@settings(max_examples=15, deadline=None)
@given(points=POINTS)
def test_both_ways_agree_on_a_hand(points: NDArray[np.float64]) -> None:
    man = capsule_man("man")
    hand = partition(man)[6].solid(man.vertices)
    where = hand[0].mean(axis=0) + 0.1 * points
    np.testing.assert_allclose(signed_distance(*hand, where), signed_distance_torch(*hand, where), atol=2e-6)


def test_corners_edges_and_the_middle_of_a_cube() -> None:
    cube = trimesh.creation.box((2, 2, 2))
    points = np.array([[2, 2, 2], [2, 2, 0.3], [2, 0.1, 0.3], [0, 0, 0], [0.9, 0.1, 0.2]])
    expected = [3**0.5, 2**0.5, 1.0, -1.0, -0.1]
    np.testing.assert_allclose(signed_distance_torch(cube.vertices, cube.faces, points), expected, atol=1e-6)


def test_without_open3d_torch_does_it(monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (50, 3))
    monkeypatch.setitem(sys.modules, "open3d", None)
    np.testing.assert_array_equal(signed_distance(*ball(), points), signed_distance_torch(*ball(), points))
