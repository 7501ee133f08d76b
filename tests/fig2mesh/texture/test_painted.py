"""Colours of surfaces whose four sides have one colour each."""

from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.field.camera import VIEW_YAW_DEG, axes
from fig2mesh.texture.painted import BlendedSides

SIZE, PITCH = 64, 0.02
COLOURS = np.array([(200, 0, 0), (0, 200, 0), (0, 0, 200), (200, 200, 0)], np.float32)
"""Front, left, back, right."""
WAYS = np.array([axes(yaw)[2] for yaw in VIEW_YAW_DEG.values()])


def ball(radius: float = 0.5, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> BlendedSides:
    x = (np.arange(SIZE) + 0.5 - SIZE / 2) * PITCH
    across = np.hypot(*np.meshgrid(x, x))
    depth = np.where(across < radius, np.sqrt(np.maximum(radius**2 - across**2, 0)), -np.inf)
    pictures = np.broadcast_to(COLOURS[:, None, None], (4, SIZE, SIZE, 3)).copy()
    along = WAYS @ np.array(centre)
    return BlendedSides(pictures, (depth + along[:, None, None]).astype(np.float32), np.array(centre), (PITCH,) * 4)


@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.0), (0.3, -0.2, 0.1)])
def test_each_side_has_its_own_colour(centre: tuple[float, float, float]) -> None:
    found = ball(centre=centre).colours(0.5 * WAYS + centre, WAYS)
    np.testing.assert_allclose(found, COLOURS, atol=1)


def test_between_two_sides_colours_blend_by_angle() -> None:
    angle = np.linspace(0, np.pi / 2, 19)
    normals = np.cos(angle)[:, None] * WAYS[0] + np.sin(angle)[:, None] * WAYS[1]
    found = ball().colours(0.5 * normals, normals)
    red, green = found[:, 0], found[:, 1]
    assert (np.diff(red) <= 1e-6).all()
    assert (np.diff(green) >= -1e-6).all()
    np.testing.assert_allclose(found[9], (100, 100, 0), atol=1)


def test_hidden_points_take_no_colour_from_sides_that_do_not_show_them() -> None:
    # A point inside, facing the front: hidden from it by the ball's own front, so nothing shows it, and the facing
    # side decides; a point that only the left side shows has that side's colour, whatever its normal.
    inside = ball().colours(np.zeros((1, 3)), WAYS[:1])
    np.testing.assert_allclose(inside[0], COLOURS[0], atol=5)
    only_left = ball()
    hidden = BlendedSides(
        only_left.pictures,
        np.where(np.arange(4)[:, None, None] == 1, only_left.depth, np.float32(9)),
        only_left.centre,
        only_left.pitch,
    )
    slanted = (WAYS[0] + WAYS[1]) / np.sqrt(2)
    found = hidden.colours(0.5 * slanted[None], slanted[None])
    np.testing.assert_allclose(found[0], COLOURS[1], atol=5)


def test_pictures_are_not_mirrored() -> None:
    body = ball()
    pictures = np.zeros_like(body.pictures)
    pictures[:, :, SIZE // 2 :] = 255
    marked = BlendedSides(pictures, body.depth, body.centre, body.pitch)
    for yaw in VIEW_YAW_DEG.values():
        right, _, back = axes(yaw)
        sides = np.array([0.1 * right + 0.49 * back, -0.1 * right + 0.49 * back])
        found = marked.colours(sides, np.array([back, back]))[:, 0]
        assert found[0] > 240
        assert found[1] < 15
