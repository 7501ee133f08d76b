"""A painted head: skin with eyes, hair beside it, a hat above."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fig2mesh.texture.heads import DrawnFace, FacePositions, HeadMaterials, covered_rim, head_materials

SKIN, HAIR, HAT, INK = range(4)
COLOUR = np.array([(240, 200, 170), (120, 70, 30), (30, 30, 160), (10, 10, 10)], np.float32)
PITCH = 0.004
RADIUS = 24 * PITCH


def drawn() -> tuple[NDArray[np.int_], NDArray[np.bool_], FacePositions]:
    y, x = np.mgrid[:100, :100] - 50.0
    head = x**2 + y**2 < 40**2
    face = (x / 24) ** 2 + ((y - 6) / 26) ** 2 < 1
    index = np.where(y < -22, HAT, HAIR)
    index = np.where(face, SKIN, index)
    points = np.stack([x, -y], axis=-1) * PITCH
    return index, head, DrawnFace(np.zeros(2), np.array([0.0, 1.0]), RADIUS).at(points)


def found(index: NDArray[np.int_]) -> HeadMaterials | None:
    _, head, face = drawn()
    return head_materials(face, head, index, np.ones_like(head), COLOUR, PITCH)


def test_hair_is_beside_the_face() -> None:
    made = found(drawn()[0])
    assert made is not None
    assert made.hair == HAIR
    assert SKIN in made.skin


def test_hats_hide_heads_without_hair() -> None:
    index = drawn()[0]
    made = found(np.where(index == HAIR, SKIN, index))
    assert made is not None
    assert made.hair == HAT


def test_bald_heads_stay_bald() -> None:
    assert found(np.zeros_like(drawn()[0])) is None


def test_bare_temples_are_covered_and_the_neck_is_not() -> None:
    head = HeadMaterials(np.array([SKIN]), HAIR, -1.0)
    material, above = np.array([SKIN, SKIN, HAT, -1]), np.array([0.0, -2.0, 1.0, 0.0])
    votes = np.eye(len(COLOUR))[np.maximum(material, 0)]
    np.testing.assert_array_equal(covered_rim(material, votes, above, head), [HAIR, SKIN, HAT, -1])
