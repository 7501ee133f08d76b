"""Layers that float are found; strokes too thin for a grid are thickened, corners are not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from fig2mesh.parts.hairlines import thicken
from fig2mesh.parts.joining import floating

INSIDE = np.zeros((40, 60), bool)
INSIDE[5:35, 5:55] = True


def plate(columns: slice, thickness: float = 1.0) -> np.ndarray:
    half = np.zeros(INSIDE.shape)
    half[10:30, columns] = thickness
    return half


def flat(depth: float) -> np.ndarray:
    return np.full(INSIDE.shape, depth)


def test_overlapping_layers_at_one_depth_hold() -> None:
    assert floating([plate(slice(6, 30)), plate(slice(25, 50))], [flat(0), flat(0)], INSIDE) == set()


@pytest.mark.parametrize(("depth", "expected"), [(1.3, set()), (1.5, {1}), (-1.5, {1})])
def test_depth_decides_whether_layers_touch(depth: float, expected: set[int]) -> None:
    """Two plates of half thickness 1 must come within 0.7 of 2 to be joined."""
    assert floating([plate(slice(6, 30)), plate(slice(25, 50))], [flat(0), flat(depth)], INSIDE) == expected


def test_layers_side_by_side_do_not_hold() -> None:
    assert floating([plate(slice(6, 30)), plate(slice(30, 50))], [flat(0), flat(0)], INSIDE) == {1}


def test_a_chain_holds_its_last_link() -> None:
    halves = [plate(slice(6, 25)), plate(slice(20, 40)), plate(slice(35, 54))]
    assert floating(halves, [flat(0), flat(1), flat(2)], INSIDE) == set()
    # The core is the smaller group then; what should hold it is the limb that passes it.
    assert floating(halves, [flat(0), flat(3), flat(4)], INSIDE) == {1}


def test_an_island_of_the_core_is_held_by_the_limb_that_crosses_it() -> None:
    core = plate(slice(6, 20)) + plate(slice(40, 54))
    assert floating([core, plate(slice(15, 45))], [flat(0), flat(0)], INSIDE) == set()
    assert floating([core, plate(slice(15, 45))], [flat(0), flat(5)], INSIDE) == {1}


def test_drawn_pieces_need_not_hold_each_other() -> None:
    apart = INSIDE.copy()
    apart[:, 29:31] = False
    assert floating([plate(slice(6, 28)), plate(slice(32, 50))], [flat(0), flat(9)], apart) == set()


def test_a_bridge_of_one_pixel_is_thickened() -> None:
    mask = np.zeros((40, 80), bool)
    mask[10:30, 5:30] = mask[10:30, 50:75] = True
    mask[20, 30:50] = True
    distance = thicken(mask, 2.0)
    assert ndimage.label((distance < 0) | mask)[1] == 1
    assert (distance[18:23, 40] < 0).tolist() == [False, True, True, True, False]


def test_a_diagonal_line_becomes_connected() -> None:
    mask = np.eye(50, dtype=bool)
    distance = thicken(mask, 0.9)
    assert ndimage.label((distance < 0) | mask)[1] == 50, "0.9 pixels do not reach the diagonal's neighbours"
    distance = thicken(mask, 1.5)
    assert ndimage.label(distance < 0)[1] == 1


@pytest.mark.parametrize("shape", ["square", "disc"])
def test_thick_shapes_and_their_corners_stay(shape: str) -> None:
    y, x = np.mgrid[-30:31, -30:31]
    mask = (np.abs(x) < 20) & (np.abs(y) < 20) if shape == "square" else x * x + y * y < 400
    assert np.isinf(thicken(mask, 2.0)).all()


def test_a_lone_dot_is_kept() -> None:
    mask = np.zeros((20, 20), bool)
    mask[10, 10] = True
    distance = thicken(mask, 1.5)
    assert distance[10, 10] < 0


def test_nothing() -> None:
    assert np.isinf(thicken(np.zeros((8, 8), bool), 1.0)).all()
