"""Laws of the diffusion: maximum principle, constants, symmetry, and colours that go round across a bone."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fig2mesh.texture.diffusion import diffused

SHAPE = (40, 24)


def cylinder(values: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.float64]]:
    """Region, its two sides and their values by row."""
    region = np.zeros(SHAPE, bool)
    region[2:-2, 2:-2] = True
    fixed = np.zeros(SHAPE, bool)
    fixed[2:-2, [2, -3]] = True
    return region, fixed, np.broadcast_to(values[:, None, None], (*SHAPE, 1)).copy()


def along(angle: float) -> NDArray[np.float64]:
    return np.broadcast_to(np.array([np.cos(angle), np.sin(angle)]), (*SHAPE, 2)).copy()


@pytest.mark.parametrize("anisotropy", [1.0, 5.0, 12.0])
@pytest.mark.parametrize("angle", [0.0, 0.4, 1.2])
def test_values_lie_between_those_that_are_fixed(anisotropy: float, angle: float) -> None:
    values = np.random.default_rng(0).uniform(-3.0, 7.0, SHAPE[0])
    region, fixed, given = cylinder(values)
    found = diffused(region, fixed, given, along(angle), anisotropy)
    assert found[region].min() >= given[fixed].min() - 1e-6
    assert found[region].max() <= given[fixed].max() + 1e-6
    np.testing.assert_array_equal(found[fixed], given[fixed])


def test_constants_stay() -> None:
    region, fixed, given = cylinder(np.full(SHAPE[0], 4.0))
    np.testing.assert_allclose(diffused(region, fixed, given, along(0.3), 5.0)[region], 4.0, atol=1e-9)


def test_mirrored_input_gives_mirrored_output() -> None:
    region, fixed, given = cylinder(np.random.default_rng(1).uniform(size=SHAPE[0]))
    given[:, :12] *= 0.5
    axis = along(0.4)
    found = diffused(region, fixed, given, axis, 5.0)
    turned = axis[:, ::-1] * np.array([1.0, -1.0])
    mirrored = diffused(region[:, ::-1], fixed[:, ::-1], given[:, ::-1], turned, 5.0)
    np.testing.assert_allclose(mirrored[:, ::-1], found, atol=1e-9)


def test_a_belt_goes_round_at_the_same_height() -> None:
    belt = np.zeros(SHAPE[0])
    belt[15:20] = 1.0
    region, fixed, given = cylinder(belt)
    found = diffused(region, fixed, given, along(0.0), 12.0)[..., 0] > 0.5
    assert (found[15:20, 2:-2]).all()
    assert not found[:14].any()
    assert not found[21:].any()


def test_nothing_flows_between_pieces_apart() -> None:
    region, fixed, given = cylinder(np.zeros(SHAPE[0]))
    given[:, -3] = 1.0
    apart = np.zeros(SHAPE, int)
    apart[:, 12:] = 1
    found = diffused(region, fixed, given, apart=apart)
    np.testing.assert_allclose(found[2:-2, 2:12], 0.0, atol=1e-6)
    np.testing.assert_allclose(found[2:-2, 12:-2], 1.0, atol=1e-6)
