"""A painted head: skin with eyes, hair beside it, a hat above, a rucksack behind."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fig2mesh.texture.heads import back_of_head

SKIN, HAIR, HAT, INK, SHADOW, BAG = range(6)
PALETTE = np.array(
    [(240, 200, 170), (120, 70, 30), (30, 30, 160), (10, 10, 10), (222, 180, 150), (20, 140, 60)], np.float32
)
WEIGHT = np.array([1, 1, 1, 0.01, 1, 1])
LINE, RADIUS = 2.0, 12.0


@pytest.fixture
def drawn() -> tuple[NDArray[np.int_], NDArray[np.bool_], NDArray[np.bool_]]:
    """(index, head, face)"""
    y, x = np.mgrid[:100, :100] - 50.0
    head = x**2 + y**2 < 40**2
    face = (x / 24) ** 2 + ((y - 6) / 26) ** 2 < 1
    index = np.where(y < -22, HAT, np.where(abs(x) > 34, BAG, HAIR))
    index = np.where(face, np.where(y > 20, SHADOW, SKIN), index)
    index = np.where(face & (abs(abs(x) - 10) < 2) & (abs(y) < 2), INK, index)
    return index, head, face


def test_the_face_becomes_the_hair_beside_it(
    drawn: tuple[NDArray[np.int_], NDArray[np.bool_], NDArray[np.bool_]],
) -> None:
    index, head, face = drawn
    made = back_of_head(index, head, face, PALETTE, index, WEIGHT, LINE, RADIUS)
    assert (made[face] == HAIR).all()
    hat = head & (index == HAT)
    assert (made[hat] == HAT).all()
    assert (made[~head] == index[~head]).all()


def test_without_hair_the_back_is_skin_without_marks(
    drawn: tuple[NDArray[np.int_], NDArray[np.bool_], NDArray[np.bool_]],
) -> None:
    index, head, face = drawn
    index = np.where(head & (index != INK), np.where(index == SHADOW, SHADOW, SKIN), index)
    made = back_of_head(index, head, face, PALETTE, index, WEIGHT, LINE, RADIUS)
    assert (made[head] == SKIN).all()


def test_strokes_alone_leave_the_areas_as_they_are(
    drawn: tuple[NDArray[np.int_], NDArray[np.bool_], NDArray[np.bool_]],
) -> None:
    index, head, face = drawn
    weight = np.full(len(PALETTE), 0.01)
    assert (back_of_head(index, head, face, PALETTE, index, weight, LINE, RADIUS) == index).all()
