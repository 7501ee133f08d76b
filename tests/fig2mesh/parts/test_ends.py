"""Flat ends: which rims are ends, what goes on below them, where they are cut."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.ends import DOWN, MIN_WIDTH, Ends, clip_distance, flat_ends
from fig2mesh.parts.rim import rim_distance

PITCH = 0.006
HEIGHT, WIDTH = 190, 160
ROWS, COLUMNS = np.mgrid[0:HEIGHT, 0:WIDTH].astype(float)
TOP, BOTTOM, LEFT, RIGHT = 30, 100, 40, 110
"""First row and column of the box, and the first ones after it."""


def sheet(distance: NDArray[np.float64]) -> Canvas:
    """A canvas with this signed distance, pixels, to its contour."""
    return Canvas(distance * PITCH, np.zeros(distance.shape, np.uint8), (0.0, 0.0), PITCH)


def box() -> Canvas:
    across = np.maximum(LEFT - 0.5 - COLUMNS, COLUMNS - (RIGHT - 0.5))
    along = np.maximum(TOP - 0.5 - ROWS, ROWS - (BOTTOM - 0.5))
    outside = np.hypot(np.maximum(across, 0), np.maximum(along, 0))
    return sheet(outside + np.minimum(np.maximum(across, along), 0))


def found(canvas: Canvas, chosen: NDArray[np.bool_] | None = None) -> Ends:
    ends = flat_ends(canvas, canvas.inside, canvas.inside if chosen is None else chosen)
    assert ends is not None
    return ends


def test_a_box_ends_at_its_bottom_edge() -> None:
    ends = found(box())
    inner = np.s_[LEFT + 8 : RIGHT - 8]
    assert (ends.source[inner] == BOTTOM - 1).all()
    assert (ends.source[:LEFT] == -1).all()
    assert (ends.source[RIGHT:] == -1).all()
    # Corners point sideways too; they shorten the end by no more than they are smoothed.
    assert (ends.source >= 0).sum() >= RIGHT - LEFT - 12


def test_what_goes_on_is_below_the_end_and_no_longer_than_what_is_above() -> None:
    ends = found(box())
    rows, columns = np.nonzero(ends.beyond)
    assert rows.min() == BOTTOM
    assert (rows > ends.source[columns]).all()
    assert ends.beyond.shape == (HEIGHT + ends.extra, WIDTH)
    assert 0 < rows.max() - BOTTOM + 1 <= BOTTOM - TOP
    assert not (ends.beyond[:HEIGHT] & box().inside).any()


@pytest.mark.parametrize("radius", [35.4, 50.0])
def test_a_disc_ends_where_it_looks_down_and_not_at_its_sides(radius: float) -> None:
    """The rim's normal makes an angle with straight down; columns beyond the stated one are sides."""
    canvas = sheet(np.hypot(COLUMNS - WIDTH / 2, ROWS - HEIGHT / 2) - radius)
    ends = found(canvas)
    sideways = np.abs(np.arange(WIDTH) - WIDTH / 2)
    limit = radius * np.sqrt(1 - DOWN**2)
    # The direction of a raster's rim is known to a few degrees.
    margin = 0.1 * radius
    assert (ends.source[sideways < limit - margin] > HEIGHT / 2).all()
    assert (ends.source[sideways > limit + margin] == -1).all()


def test_only_what_may_end_flat_does() -> None:
    canvas = box()
    assert flat_ends(canvas, canvas.inside, np.zeros_like(canvas.inside)) is None
    half = canvas.inside & (COLUMNS < 70)
    ends = found(canvas, half)
    assert (ends.source[75:] == -1).all()
    assert (ends.source[LEFT + 8 : 68] == BOTTOM - 1).all()


def test_points_and_edges_that_look_up_are_no_ends() -> None:
    thin = sheet(np.abs(COLUMNS - 80) - 0.3 * MIN_WIDTH / PITCH + np.maximum(0, ROWS - 90) + np.maximum(0, 20 - ROWS))
    assert flat_ends(thin, thin.inside, thin.inside) is None
    # A wedge that stands on its tip has two sides steeper than the limit, and no bottom.
    wedge = sheet((np.abs(COLUMNS - 80) - 0.4 * (110 - ROWS)) / np.hypot(1, 0.4) + 1e3 * (ROWS < 30))
    ends = flat_ends(wedge, wedge.inside, wedge.inside)
    assert ends is None or (ends.source >= 0).sum() * PITCH < 2 * MIN_WIDTH


def test_scallops_are_bridged() -> None:
    """A hem with a notch narrower than what is bridged is one end, from side to side."""
    notched = (box().inside) & ~((np.abs(COLUMNS - 75) < 3) & (ROWS > 92))
    canvas = Canvas(np.where(notched, -1.0, 1.0) * PITCH, np.zeros(notched.shape, np.uint8), (0.0, 0.0), PITCH)
    ends = found(canvas)
    assert (ends.source[LEFT + 8 : RIGHT - 8] > 85).all()


def test_cut_is_positive_below_the_end_and_negative_in_the_layer() -> None:
    canvas = box()
    ends = found(canvas)
    clip = clip_distance(canvas, canvas.inside, ends)
    columns = np.s_[LEFT + 15 : RIGHT - 15]
    assert (clip[BOTTOM + 2 : BOTTOM + 30, columns] > 0).all()
    assert (clip[TOP + 5 : BOTTOM - 2, columns] < 0).all()
    # Near the drawn end it is the distance to the drawn contour, and so to a fraction of a pixel.
    near = np.s_[BOTTOM - 3 : BOTTOM + 3, columns]
    np.testing.assert_allclose(clip[near], canvas.sdf[near], atol=0.5 * PITCH)
    # Far from the end it takes nothing away.
    assert clip[TOP + 5, 75] < -0.2


def test_below_its_end_a_layer_is_gone_however_far_the_drawing_goes_on() -> None:
    """A leg that comes out of a garment, of any length: nothing of the garment is left at its sole."""
    canvas = box()
    ends = found(canvas)
    for length in range(4, HEIGHT - BOTTOM - 4):
        leg = np.maximum(np.abs(COLUMNS - 75.0) - 8.5, ROWS - (BOTTOM + length - 0.5))
        drawn = sheet(np.minimum(canvas.sdf / PITCH, leg))
        clip = clip_distance(drawn, canvas.inside, ends)
        assert (clip[BOTTOM + 3 :, LEFT:RIGHT] > 0).all(), f"leg of {length} pixels"


def test_a_layer_with_an_end_is_inflated_as_if_it_went_on() -> None:
    """Its rim does not turn in at the end: beside the bottom edge the nearest rim is the side's."""
    canvas = box()
    ends = found(canvas)
    open_ended, closed = rim_distance(canvas, canvas.inside, ends), rim_distance(canvas, canvas.inside, None)
    assert open_ended.shape == (HEIGHT + ends.extra, WIDTH)
    middle = (LEFT + RIGHT) // 2
    assert closed[BOTTOM - 2, middle] > -3 * PITCH
    assert open_ended[BOTTOM - 2, middle] < -15 * PITCH
    # The sides stay where they are drawn.
    side = np.s_[TOP + 10 : BOTTOM - 10, LEFT - 2 : LEFT + 3]
    np.testing.assert_allclose(open_ended[side], closed[side], atol=1e-12)
