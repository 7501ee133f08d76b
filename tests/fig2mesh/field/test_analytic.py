from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.field import analytic
from fig2mesh.field.body import Body
from fig2mesh.skeleton import FIGURE_HEIGHT, PART_NAMES


def hull_of_balls(start, end, first, second, points, steps=4001):
    """A capsule by definition: the nearest of many balls between its ends (outside of it)."""
    best = np.full(len(points), np.inf)
    for share in np.linspace(0, 1, steps):
        middle = (1 - share) * np.asarray(start) + share * np.asarray(end)
        best = np.minimum(best, np.linalg.norm(points - middle, axis=1) - ((1 - share) * first + share * second))
    return best


@pytest.mark.parametrize(("first", "second"), [(0.1, 0.1), (0.2, 0.05), (0.03, 0.25), (0.5, 0.05)])
def test_capsules(first, second):
    points = np.random.default_rng(0).uniform(-1, 1, (400, 3))
    start, end = (-0.2, 0.1, 0.0), (0.15, -0.2, 0.1)
    function = analytic.capsule(start, end, first, second)
    assert np.allclose(function(points), hull_of_balls(start, end, first, second, points), atol=1e-6)


def test_ellipsoid_vanishes_on_its_surface_and_has_slope_one_there():
    radii, centre = np.array([0.3, 0.5, 0.2]), np.array([0.1, 0.0, -0.2])
    direction = np.random.default_rng(1).normal(size=(200, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    surface, normal = centre + direction * radii, direction / radii
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    function = analytic.ellipsoid(centre, radii)
    assert np.allclose(function(surface), 0, atol=1e-12)
    assert np.allclose((function(surface + 1e-5 * normal) - function(surface - 1e-5 * normal)) / 2e-5, 1, atol=1e-3)
    assert function(centre[None])[0] == -0.2


def test_samples_sit_on_the_nodes():
    part = analytic.sample(lambda points: points @ (1, 10, 100) - 300, 4, (1, 2, 3), 2.0, 5)
    assert part.part == 4
    assert part.grid[0, 0, 0] == pytest.approx(0 + 10 + 200 - 300)
    assert part.grid[4, 0, 0] == pytest.approx(2 + 10 + 200 - 300)
    assert part.grid[0, 4, 2] == pytest.approx(0 + 30 + 300 - 300)
    inside = np.random.default_rng(0).uniform((0, 1, 2), (2, 3, 4), (50, 3))
    # linear functions are reproduced by the interpolant
    assert np.allclose(Body((part,)).evaluate(inside)[0], inside @ (1, 10, 100) - 300, atol=1e-3)


def test_mannequin_has_fourteen_parts_and_the_papers_height():
    parts = analytic.mannequin(40)
    assert [PART_NAMES[part.part] for part in parts] == list(analytic.MANNEQUIN)
    assert sorted(part.part for part in parts) == list(range(1, 15))
    low, high = Body(parts).bounds()
    assert (high - low)[1] == pytest.approx(FIGURE_HEIGHT, abs=3e-3)
