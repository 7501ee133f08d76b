"""The inflation: closed forms for disc and strip, agreement with a direct sparse solver."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from fig2mesh.parts.inflate import inflate


def disc(radius: float) -> np.ndarray:
    size = int(radius) + 4
    y, x = np.mgrid[-size : size + 1, -size : size + 1]
    return x * x + y * y < radius * radius


def solve_directly(inside: np.ndarray, load: np.ndarray) -> np.ndarray:
    """The same five-point equations by a sparse factorisation."""
    number = np.full(inside.shape, -1)
    number[inside] = np.arange(inside.sum())
    rows, columns, values = [], [], []
    for row, column in np.argwhere(inside):
        here = number[row, column]
        rows.append(here), columns.append(here), values.append(4.0)
        for y, x in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
            if number[y, x] >= 0:
                rows.append(here), columns.append(number[y, x]), values.append(-1.0)
    matrix = coo_matrix((values, (rows, columns))).tocsc()
    result = np.zeros(inside.shape)
    result[inside] = spsolve(matrix, load[inside])
    return result


@pytest.mark.parametrize("radius", [12.5, 60.5])
def test_disc_becomes_a_ball(radius: float) -> None:
    inside = disc(radius)
    half = np.sqrt(inflate(inside, np.full(inside.shape, 4.0)))
    size = inside.shape[0] // 2
    y, x = np.mgrid[-size : size + 1, -size : size + 1]
    # The raster's rim is uncertain by half a pixel, and so is the thickness where the ball is steep.
    expected = np.sqrt(np.maximum(radius**2 - x * x - y * y, 0.0))
    core = x * x + y * y < (0.8 * radius) ** 2
    assert np.abs(half - expected)[core].max() < 1.0


def test_strip_becomes_a_cylinder() -> None:
    inside = np.zeros((61, 400), bool)
    inside[10:51] = True
    inside[:, [0, -1]] = False
    half = np.sqrt(inflate(inside, np.full(inside.shape, 2.0)))[:, 200]
    radius = 21.0
    expected = np.sqrt(np.maximum(radius**2 - (np.arange(61) - 30.0) ** 2, 0.0))
    assert np.abs(half - expected)[inside[:, 200]].max() < 0.05


def test_agrees_with_a_direct_solver() -> None:
    random = np.random.default_rng(3)
    inside = np.zeros((70, 90), bool)
    inside[5:40, 5:50] = inside[30:65, 40:85] = True
    inside &= random.random(inside.shape) > 0.02
    load = random.uniform(0.5, 4.0, inside.shape)
    direct = solve_directly(inside, load)
    # The solver stops at a relative residual of 1e-3; the largest value is known an order better.
    assert np.abs(inflate(inside, load) - direct).max() < 2e-3 * direct.max()


def test_scaling_law() -> None:
    """Twice the load doubles u; twice the size quadruples it."""
    small, large = disc(20.5), disc(41.0)
    one = inflate(small, np.full(small.shape, 2.0)).max()
    assert inflate(small, np.full(small.shape, 4.0)).max() == pytest.approx(2 * one, rel=2e-3)
    assert inflate(large, np.full(large.shape, 2.0)).max() == pytest.approx(4 * one, rel=0.03)


def test_nothing_and_one_pixel() -> None:
    empty = np.zeros((8, 8), bool)
    assert not inflate(empty, np.ones((8, 8))).any()
    empty[3, 4] = True
    assert inflate(empty, np.full((8, 8), 2.0))[3, 4] == pytest.approx(0.5)
