"""Contour ink in side views of boxes whose bands are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from exporters.asset import Texture, TexturedMesh
from fig2mesh.measure.ink import RIM, YAWS, pens_of, side_ink
from tests.fig2mesh.mesh.outlined import PEN, hulled

WIDTH, HEIGHT, DEPTH = 0.6, 1.8, 0.5
LINE = 0.02
SKIN, BLACK = (230, 190, 160), (24, 20, 16)
PENS = np.array([PEN], np.float32)


def box(*bands: tuple[float, float], fill: tuple[int, int, int] = SKIN) -> TexturedMesh:
    """A box whose left and right side have vertical bands of the pen's colour, from and to depths z in metres.

    Front and back have one plain colour; the texture's left half belongs to the sides, column by depth.
    """
    columns = (np.arange(1000) + 0.5) / 1000 * DEPTH - DEPTH / 2
    pixels = np.empty((2, 2000, 3), np.uint8)
    pixels[:] = fill
    for start, end in bands:
        pixels[:, :1000][:, (columns >= start) & (columns < end)] = PEN
    vertices, uv, faces = [], [], []
    half = np.array([WIDTH, HEIGHT, DEPTH]) / 2
    for axis in range(3):
        for side in (-1, 1):
            first, second = (axis + 1) % 3, (axis + 2) % 3
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corner = np.zeros(3)
                corner[axis], corner[first], corner[second] = side, a, b
                vertices.append(corner * half + (0, half[1], 0))
                uv.append(((corner[2] * 0.4999 + 0.5) / 2 if axis == 0 else 0.75, 0.5))
            at = len(vertices) - 4
            quad = [(at, at + 1, at + 2), (at, at + 2, at + 3)]
            faces += quad if side > 0 else [face[::-1] for face in quad]
    places = np.array(vertices, np.float32)
    _, solid = np.unique(places, axis=0, return_inverse=True)
    return TexturedMesh(places, np.array(faces), None, solid.reshape(-1), np.array(uv), Texture(pixels))


def inside(width: float, height: float) -> float:
    return (width - 2 * RIM * LINE) * (height - 2 * RIM * LINE)


def test_band_across_the_side_is_measured() -> None:
    band = 0.08
    found = side_ink(box((0.0, band)), box(), PENS, LINE)
    assert found.share == pytest.approx(band * (HEIGHT - 2 * RIM * LINE) / inside(DEPTH, HEIGHT), rel=0.02)
    assert found.width == pytest.approx(band / LINE, rel=0.1)


def test_ink_in_the_rim_does_not_count() -> None:
    found = side_ink(box((-DEPTH / 2, LINE - DEPTH / 2), (DEPTH / 2 - LINE, DEPTH / 2)), box(), PENS, LINE)
    assert found.share == 0
    assert found.width == 0


def test_hull_counts_nothing_and_two_sided_ink_everything() -> None:
    bare = box()
    assert side_ink(hulled(bare, LINE), bare, PENS, LINE).share == 0
    assert side_ink(hulled(bare, LINE, culled=False), bare, PENS, LINE).share == 1


def test_black_clothes_do_not_count() -> None:
    for fill in (BLACK, PEN):
        assert side_ink(box((0.0, 0.1), fill=fill), box(fill=fill), PENS, LINE).share == 0


def test_lines_inside_the_figure_may_move_a_little() -> None:
    bare = box((0.0, LINE))
    assert side_ink(box((0.004, LINE + 0.004)), bare, PENS, LINE).share == 0
    moved = side_ink(box((0.06, LINE + 0.06)), bare, PENS, LINE)
    assert moved.share == pytest.approx(LINE / (DEPTH - 2 * RIM * LINE), rel=0.1)


@pytest.mark.parametrize("line", [0.002, 0.01, 0.03])
def test_share_of_a_band_grows_only_with_the_band(line: float) -> None:
    found = side_ink(box((0.0, 0.05)), box(), PENS, line)
    clear = DEPTH - 2 * RIM * line
    assert found.share == pytest.approx(0.05 / clear, rel=0.05)
    assert found.width == pytest.approx(0.05 / line, rel=0.15)


def test_views_are_averaged_and_pens_are_several() -> None:
    model, bare = box((0.0, 0.1)), box()
    left, right = (side_ink(model, bare, PENS, LINE, (yaw,)).share for yaw in YAWS)
    assert side_ink(model, bare, PENS, LINE).share == pytest.approx((left + right) / 2)
    blue = np.array([(20, 40, 200)], np.float32)
    assert side_ink(model, bare, blue, LINE).share == 0
    assert side_ink(model, bare, np.concatenate([blue, PENS]), LINE).share == pytest.approx((left + right) / 2)


def test_without_a_pen_there_is_no_ink() -> None:
    assert side_ink(box((0.0, 0.1)), box(), PENS[:0], LINE).share == 0
    assert len(pens_of(box())) == 0
    np.testing.assert_array_equal(pens_of(hulled(box(), LINE)), [PEN])


def test_scale_does_not_matter() -> None:
    def scaled(mesh: TexturedMesh) -> TexturedMesh:
        return replace(mesh, vertices=mesh.vertices * 10)

    small = side_ink(box((0.0, 0.05)), box(), PENS, LINE)
    large = side_ink(scaled(box((0.0, 0.05))), scaled(box()), PENS, 10 * LINE)
    assert small.share == pytest.approx(large.share, abs=0.002)
