"""Rims between pixel centres: distances, the inflation that knows them, the continuation of u outside."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fig2mesh.image_frame import image_frame
from fig2mesh.parts.canvas import Canvas, make_canvas, raster_distance
from fig2mesh.parts.inflate import inflate
from fig2mesh.parts.rim import MIN_SLOPE, OVERLAP, RIM_BLUR, extended, rim_distance
from tests.drawn import Sketch

PITCH = 0.008
SIDE = 121


def polar(x0: float = 0.0, y0: float = 0.0, side: int = SIDE) -> NDArray[np.float64]:
    """(side, side) distance of pixel centres from (x0, y0), pixels, the middle of the raster the origin."""
    axis = np.arange(side) - side // 2
    x, y = np.meshgrid(axis, axis)
    return np.asarray(np.hypot(x - x0, y - y0))


def canvas(sdf: NDArray[np.float64]) -> Canvas:
    """A canvas whose contour is known; `sdf` in pixels."""
    half = PITCH * (sdf.shape[1] // 2)
    return Canvas(sdf * PITCH, np.zeros(sdf.shape, np.uint8), (-half, half), PITCH)


def test_rim_of_a_drawn_disc_is_known_to_a_fraction_of_a_pixel() -> None:
    """The disc is 281 pixels wide, on the canvas a quarter of that: its rim is far finer than the canvas's pixels."""
    figure = Sketch().disc((100, 150), 70).figure()
    frame = image_frame(figure)
    drawn = make_canvas(figure, frame, 70)
    centre, radius = frame.figure_from_image(np.array([200.5, 300.5])), 140.5 * frame.units_per_px
    exact = np.linalg.norm(drawn.points() - centre, axis=-1) - radius
    near = np.abs(exact) < 3 * drawn.pitch
    error = np.abs(rim_distance(drawn, drawn.inside, None) - exact)[near]
    # A picture knows its contour to half a pixel, an eighth of the canvas's.
    assert error.max() < 0.15 * drawn.pitch
    stairs = np.abs(raster_distance(drawn.inside) * drawn.pitch - exact)[near]
    assert error.mean() < 0.4 * stairs.mean(), "the canvas's own pixels are less exact"


@pytest.mark.parametrize("radius", [20.3, 31.7])
def test_rim_inside_the_silhouette_is_smooth_and_reaches_a_little_further(radius: float) -> None:
    """Only pixels are known there: a disc's stairs are smoothed away, and it grows by the overlap of layers."""
    sheet = canvas(polar() - 55.0)
    distance = rim_distance(sheet, polar() < radius, None)
    near = np.abs(polar() - radius) < 4
    grown = (polar() - radius) * PITCH - OVERLAP
    # Blurring a cone by s raises it by s² / 2r; half a pixel is what a raster knows.
    bias = RIM_BLUR**2 / (2 * radius * PITCH)
    assert np.abs(distance - grown)[near].max() < 0.5 * PITCH + bias
    assert np.abs(np.median((distance - grown)[near])) < 0.2 * PITCH + bias


def test_a_layer_meets_the_drawn_contour_where_it_is_drawn() -> None:
    """Half of a disc: its round side keeps the drawn contour exactly, its straight side overlaps the other half."""
    sheet = canvas(polar() - 40.3)
    x = np.broadcast_to(np.arange(SIDE) - SIDE // 2, (SIDE, SIDE))
    left, right = (rim_distance(sheet, sheet.inside & half, None) for half in (x < 0, x >= 0))
    away = (x < -12) & (np.abs(sheet.sdf) < 4 * PITCH)
    np.testing.assert_array_equal(left[away], sheet.sdf[away])
    both = (left < 0) & (right < 0)
    assert both[SIDE // 2 - 30 : SIDE // 2 + 30].any(axis=1).all(), "layers side by side overlap all along"
    assert np.array_equal((left < 0) | (right < 0), sheet.inside), "and leave nothing of the silhouette out"


def test_a_layer_does_not_reach_across_a_gap_of_the_drawing() -> None:
    """Two bars a pixel apart: what belongs to one of them has nothing on the other."""
    x = np.abs(np.arange(SIDE) - SIDE // 2).astype(float)
    sdf = np.broadcast_to(np.maximum(0.7 - x, x - 20.0), (SIDE, SIDE)).copy()
    sheet = canvas(sdf)
    left = sheet.inside & (np.arange(SIDE) < SIDE // 2)
    distance = rim_distance(sheet, left, None)
    assert (distance[:, SIDE // 2 :] >= 0).all()
    assert (distance[left] < 0).all()


@pytest.mark.parametrize("radius", [7.35, 20.2, 33.85])
@pytest.mark.parametrize("load", [2.0, 4.0])
def test_inflation_that_knows_its_rim_is_exact_between_pixels(radius: float, load: float) -> None:
    """Of a disc u = c/4 (r² − d²): the rim's place counts to second order, not by whole pixels."""
    distance = polar() - radius
    inside = distance < 0
    exact = np.where(inside, load / 4 * (radius**2 - polar() ** 2), 0.0)
    loads = np.full(inside.shape, load)
    knowing = np.abs(inflate(inside, loads, distance=distance) - exact)[inside].max() / exact.max()
    guessing = np.abs(inflate(inside, loads) - exact)[inside].max() / exact.max()
    # The solver stops at a residual of a thousandth; the rim's curvature is second order in the pixel.
    assert knowing < 2e-3 + 0.5 / radius**2
    assert knowing < 0.3 * guessing


def test_inflation_grows_without_steps_with_the_radius() -> None:
    """A rim that moves by a tenth of a pixel moves the middle by as much as the formula gives, not by nought or one."""
    radii = np.arange(15.0, 16.05, 0.1)
    middles = []
    for radius in radii:
        distance = polar(side=41) - radius
        middles.append(inflate(distance < 0, np.full(distance.shape, 4.0), distance=distance).max())
    growth = np.diff(np.sqrt(middles))
    assert growth.mean() == pytest.approx(0.1, rel=0.05)
    assert growth.min() > 0.0
    assert growth.max() < 0.3


@pytest.mark.parametrize("radius", [12.4, 35.6])
def test_continued_outside_a_disc_stays_the_same_paraboloid(radius: float) -> None:
    """u = r² − d² on both sides of the rim: no step and no kink, which would show as a ridge of the solid's rim."""
    distance = (polar() - radius) * PITCH
    whole = (radius**2 - polar() ** 2) * PITCH**2
    found = extended(distance, np.maximum(whole, 0.0), PITCH)
    inside = distance < 0
    np.testing.assert_allclose(found[inside], whole[inside], rtol=1e-9)
    near = ~inside & (distance < 4 * PITCH)
    assert (found[near] < 0).all(), "outside nothing is solid"
    # The slope at the rim is known from a few pixels about it.
    np.testing.assert_allclose(found[near], whole[near], rtol=0.1)


def test_continuous_at_any_rim() -> None:
    """u falls through the rim: outside it is nought at no distance and as steep as it is inside, corners included."""
    axis = np.arange(SIDE) - SIDE // 2
    x, y = np.meshgrid(axis, axis)
    distance = np.minimum(np.hypot(x + 15, y) - 22.3, np.hypot(x - 20, y - 8) - 17.6)
    inside = distance < 0
    u = inflate(inside, np.full(inside.shape, 3.0), distance=distance)
    found = extended(distance * PITCH, u * PITCH**2, PITCH) / PITCH**2
    # −(s d + d²) on both sides: the slope s outside is an average of those a few pixels further in.
    rim, beyond = inside & (distance > -8), ~inside & (distance < 3)
    within = (u[rim] + distance[rim] ** 2) / -distance[rim]
    outside = -(found[beyond] + distance[beyond] ** 2) / np.maximum(distance[beyond], 1e-9)
    assert outside.min() > within.min() - 1e-6
    assert outside.max() < within.max() + 1e-6


def test_the_thinnest_strokes_keep_a_least_slope() -> None:
    """Strokes hardly thicker than a pixel are made deeper than wide, so that grids hold them."""
    x = np.abs(np.arange(SIDE) - SIDE // 2) - 1.2
    distance = np.broadcast_to(x, (SIDE, SIDE)) * PITCH
    u = extended(distance, np.zeros((SIDE, SIDE)), PITCH)
    assert u[SIDE // 2, SIDE // 2] == pytest.approx(MIN_SLOPE * 1.2 * PITCH)
    assert (u[distance > 0] < 0).all()
