"""Lines: found where a drawing has them, repeated where areas meet, left out of drawings without."""

from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.field import analytic
from fig2mesh.field.body import Body
from fig2mesh.mesh.bake import crease_ink
from fig2mesh.texture.pen import Pen, find_pen, lined_pairs, reinked, without_contour

PALETTE = np.array([[250, 250, 250], [200, 40, 40], [40, 200, 60], [10, 10, 10], [215, 60, 50]], np.float32)
WHITE, RED, GREEN, INK, PINK = range(5)
WEIGHT = np.array([1.0, 1.0, 1.0, 0.01, 1.0])
LINE = 4


def flag(lines: bool = True, lower: int = GREEN) -> tuple[np.ndarray, np.ndarray]:
    """Colour of each pixel and the figure: red over another colour, with or without contours."""
    kind = np.full((80, 60), WHITE)
    kind[10:40, 10:50] = RED
    kind[40:70, 10:50] = lower
    own = kind != WHITE
    if lines:
        kind[38:42, 10:50] = INK
        kind[10:14, 10:50] = kind[66:70, 10:50] = INK
        kind[10:70, 10:14] = kind[10:70, 46:50] = INK
    return kind, own


def plain(lower: int = GREEN) -> np.ndarray:
    """The two areas without lines, carried on beyond the figure."""
    return np.repeat([RED, lower], 40)[:, None] * np.ones((1, 60), int)


def test_the_pen_is_found_with_its_width() -> None:
    kind, own = flag()
    pen = find_pen(PALETTE, kind, WEIGHT, own)
    assert pen is not None
    assert pen.width == pytest.approx(LINE, rel=0.25)
    assert np.array_equal(pen.colour, PALETTE[INK])


def test_drawings_without_contours_have_no_pen() -> None:
    kind, own = flag(lines=False)
    assert find_pen(PALETTE, kind, WEIGHT, own) is None
    kind[20:24, 20:40] = INK
    assert find_pen(PALETTE, kind, WEIGHT, own) is None, "a stroke inside is no contour"


def test_areas_meet_in_a_line_where_they_do_in_the_drawing() -> None:
    kind, own = flag()
    pen = find_pen(PALETTE, kind, WEIGHT, own)
    picture = reinked(PALETTE, plain(), lined_pairs(PALETTE, plain(), own, pen), pen)
    column = np.linalg.norm(picture[:, 30] - PALETTE[INK], axis=1)
    dark = np.flatnonzero(column < 60)
    assert 38 <= dark.min() <= dark.max() <= 42
    assert LINE - 1 <= len(dark) <= LINE + 1
    np.testing.assert_array_equal(picture[20, 30], PALETTE[RED])


@pytest.mark.parametrize("lower", [PINK, INK], ids=["a shade of the same", "the pen's own colour"])
def test_shades_do_not_meet_in_lines(lower: int) -> None:
    _, own = flag()
    pen = Pen(PALETTE[INK], LINE, np.ones(own.shape, bool))
    np.testing.assert_array_equal(
        reinked(PALETTE, plain(lower), lined_pairs(PALETTE, plain(lower), own, pen), pen), PALETTE[plain(lower)]
    )


def test_borders_that_are_not_drawn_stay_without_lines() -> None:
    _, own = flag()
    pen = Pen(PALETTE[INK], LINE, np.zeros(own.shape, bool))
    np.testing.assert_array_equal(
        reinked(PALETTE, plain(), lined_pairs(PALETTE, plain(), own, pen), pen), PALETTE[plain()]
    )


def test_corners_between_limbs_are_inked_and_round_limbs_are_not() -> None:
    trunk = analytic.sample(analytic.capsule((0, -0.4, 0), (0, 0.4, 0), 0.2), 1, (0, 0, 0), 1.4, 96)
    arm = analytic.sample(analytic.capsule((-0.4, 0, 0.22), (0.4, 0, 0.22), 0.08), 3, (0, 0, 0.22), 1.2, 96)
    body = Body((trunk, arm))
    # Where the arm's upper side meets the trunk, in the plane x = 0: both distances are 0 there.
    y = np.linspace(0.0, 0.2, 2001)
    front = np.column_stack([np.zeros_like(y), y, np.full_like(y, 0.2)])
    corner = front[np.argmin(np.abs(body.distance(front.astype(np.float32))))]
    normal = np.array([[0.0, 0.0, 1.0]])
    far = np.array([[0.0, 0.35, 0.2]])
    assert crease_ink(body, corner[None] + [[0, 0.004, 0]], normal, 0.03)[0] > 0.9
    assert crease_ink(body, far, normal, 0.03)[0] == 0
    assert crease_ink(Body((trunk,)), corner[None], normal, 0.03)[0] == 0


def _ringed(fill: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray, Pen]:
    """A disc of one colour with a contour of six pixels and a line across, on white."""
    y, x = np.mgrid[:120, :120] - 60.0
    away = np.hypot(x, y)
    picture = np.full((120, 120, 3), 255, np.float32)
    picture[away < 50] = fill
    picture[(away < 50) & ((away > 44) | ((abs(y) < 3) & (away < 30)))] = 10
    return picture, away < 50, Pen(np.float32([10, 10, 10]), 6.0, away < 50)


def test_the_contour_goes_and_lines_inside_stay() -> None:
    picture, own, pen = _ringed((200, 60, 60))
    bare = without_contour(picture, own, pen, pen.width)
    y, x = np.mgrid[:120, :120] - 60.0
    rim = own & (np.hypot(x, y) > 38)
    assert (bare[rim] == (200, 60, 60)).all()
    inside = np.hypot(x, y) < 36
    assert (bare[inside] == picture[inside]).all()
    # Beyond the silhouette there is no ink to be mixed in either.
    assert (bare[60, 111] == (200, 60, 60)).all()


def test_clothes_as_dark_as_ink_stay() -> None:
    picture, own, pen = _ringed((20, 20, 20))
    bare = without_contour(picture, own, pen, pen.width)
    assert (np.abs(bare[own] - picture[own]) <= 10).all()
