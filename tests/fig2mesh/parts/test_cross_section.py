"""Cross-sections: the networks' thickness and depth, the drawing's outline."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.cross_section import MAX_OFFSET, RATIO, column_extents, measure_cross_section
from fig2mesh.parts.inflate import inflate
from fig2mesh.records import PartSdf

PITCH = 0.005
RADIUS = 0.2
NODES = 48


def canvas() -> Canvas:
    """A disc of radius 0.2 about the origin."""
    side = 2 * int(RADIUS / PITCH) + 21
    corner = -PITCH * (side // 2)
    axis = corner + PITCH * np.arange(side)
    x, y = np.meshgrid(axis, -axis)
    return Canvas(np.hypot(x, y) - RADIUS, np.zeros((side, side), np.uint8), (corner, -corner), PITCH)


def ellipsoid(radii: tuple[float, float, float], centre: tuple[float, float, float]) -> PartSdf:
    """A field that vanishes on an ellipsoid; only where it vanishes matters here."""
    edge = 2.4 * max(radii)
    axis = np.linspace(-edge / 2, edge / 2, NODES)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    level = np.sqrt((x / radii[0]) ** 2 + (y / radii[1]) ** 2 + (z / radii[2]) ** 2) - 1.0
    return PartSdf(1, (level * min(radii)).astype(np.float32), np.array(centre, np.float32), edge)


def reference(disc: Canvas) -> NDArray[np.float64]:
    """Squared half thickness of the ball that the disc inflates to."""
    return inflate(disc.inside, np.full(disc.sdf.shape, 4.0)) * PITCH**2


def torso(disc: Canvas) -> NDArray[np.uint8]:
    """The whole disc labelled as torso."""
    return np.where(disc.inside, np.uint8(1), np.uint8(0))


def middle_of(disc: Canvas) -> tuple[int, int]:
    return disc.sdf.shape[0] // 2, disc.sdf.shape[1] // 2


def test_columns_of_an_ellipsoid_are_as_long_as_its_formula_says() -> None:
    disc = canvas()
    front, back = column_extents(disc, [ellipsoid((RADIUS, RADIUS, 0.3), (0, 0, 0.05))])
    x, y = np.moveaxis(disc.points(), -1, 0)
    core = np.hypot(x, y) < 0.9 * RADIUS
    half = 0.3 * np.sqrt(1 - (np.hypot(x, y)[core] / RADIUS) ** 2)
    np.testing.assert_allclose(front[core], 0.05 + half, atol=0.012)
    np.testing.assert_allclose(back[core], 0.05 - half, atol=0.012)
    assert np.isnan(front[np.hypot(x, y) > 1.1 * RADIUS]).all()
    # Of two parts, the foremost and the rearmost point count.
    both = column_extents(disc, [ellipsoid((0.1, 0.1, 0.1), (0, 0, 0.3)), ellipsoid((0.1, 0.1, 0.1), (0, 0, -0.3))])
    assert both[0][middle_of(disc)] == pytest.approx(0.4, abs=0.01)
    assert both[1][middle_of(disc)] == pytest.approx(-0.4, abs=0.01)


@pytest.mark.parametrize("thickness", [0.7, 1.0, 1.5])
def test_ratio_is_the_square_of_relative_thickness_and_offset_the_shift(thickness: float) -> None:
    """The thickness of the network's part counts in units of the inflated outline's thickness."""
    disc = canvas()
    bone = np.full(disc.sdf.shape, 0.02)
    field = ellipsoid((RADIUS, RADIUS, thickness * RADIUS), (0, 0, 0.06))
    found = measure_cross_section(disc, torso(disc), [field], reference(disc), bone)
    assert found is not None
    assert found.ratio[middle_of(disc)] == pytest.approx(thickness**2, rel=0.1)
    assert found.offset[middle_of(disc)] == pytest.approx(0.04, abs=0.004)
    # Applied to the inflated outline, the outline stays: what was positive is positive, what was zero is zero.
    drawn = reference(disc)
    np.testing.assert_array_equal(found.ratio * drawn > 0, drawn > 0)
    assert np.isfinite(found.offset).all()
    assert (np.abs(found.offset) <= MAX_OFFSET).all()


def test_absurd_parts_are_bounded() -> None:
    disc = canvas()
    absurd = ellipsoid((0.21, 0.21, 0.9), (0, 0, 0.5))
    found = measure_cross_section(disc, torso(disc), [absurd], reference(disc), np.zeros(disc.sdf.shape))
    assert found is not None
    assert found.ratio.max() == pytest.approx(RATIO[1])
    assert found.offset[middle_of(disc)] == pytest.approx(MAX_OFFSET)


def test_where_nothing_is_known_nothing_is_said() -> None:
    disc = canvas()
    far = ellipsoid((0.1, 0.1, 0.1), (3.0, 0, 0))
    assert np.isnan(column_extents(disc, [far])[0]).all()
    assert measure_cross_section(disc, torso(disc), [far], reference(disc), np.zeros(disc.sdf.shape)) is None


def test_parts_that_do_not_explain_the_drawing_are_not_believed() -> None:
    """A network that makes a stick of what is drawn as a disc knows nothing of it (pictograms, blobs)."""
    disc = canvas()
    stick = ellipsoid((0.05, 0.2, 0.2), (0, 0, 0.08))
    found = measure_cross_section(disc, torso(disc), [stick], reference(disc), np.zeros(disc.sdf.shape))
    assert found is not None
    np.testing.assert_allclose(found.ratio, 1.0)
    np.testing.assert_allclose(found.offset, 0.0)


def test_a_head_has_one_ratio_and_one_offset() -> None:
    """Nose and hat of an outline are not repeated in depth, and a head is not sheared."""
    disc = canvas()
    field = ellipsoid((RADIUS, RADIUS, 0.18), (0, 0, 0.03))
    head = replace(field, part=2, grid=field.grid + np.float32(0.02) * np.sin(40 * np.arange(NODES)).astype(np.float32))
    labels = np.where(disc.inside, np.uint8(2), np.uint8(0))
    found = measure_cross_section(disc, labels, [head], reference(disc), np.zeros(disc.sdf.shape))
    assert found is not None
    assert np.ptp(found.ratio) < 1e-9
    assert np.ptp(found.offset) < 1e-9
    assert found.offset.mean() == pytest.approx(0.03, abs=0.01)
