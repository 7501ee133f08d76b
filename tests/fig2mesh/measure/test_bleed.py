"""Background on a model's rim is found, and nothing else is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from exporters.asset import Texture
from fig2mesh.measure.bleed import bleed_share
from tests.fig2mesh.measure.test_model import ORIGIN_PX, SCALE, drawing, sphere

RED, PAPER, INK = (180, 40, 40), (235, 225, 200), (10, 10, 10)


def textured(rim: tuple[int, int, int], width: float, fill: tuple[int, int, int] = RED) -> object:
    """The sphere in one colour, and another at its rim: `width` of its radius."""
    grid = (np.arange(1024) + 0.5) / 512 - 1
    x, y = np.meshgrid(grid, grid)
    picture = np.where((np.hypot(x, y) > 1 - width)[..., None], rim, fill).astype(np.uint8)
    return replace(sphere(), texture=Texture(picture))


def scan(fill: tuple[int, int, int] = RED, rim: tuple[int, int, int] = RED, width: float = 0.0) -> tuple:
    """An opaque drawing on paper, and its mask."""
    rgba, mask = drawing()
    y, x = np.mgrid[: mask.shape[0], : mask.shape[1]] + 0.5
    away = np.hypot(x - 100, y - 110) / 80
    colour = np.where((away > 1 - width)[..., None], rim, fill)
    rgba = np.where(mask[..., None], colour, PAPER)
    return np.dstack([rgba, np.full(mask.shape, 255)]).astype(np.uint8), mask


def share(mesh: object, rgba: np.ndarray, mask: np.ndarray) -> float:
    return bleed_share(mesh, rgba, mask, metres_per_pixel=SCALE, origin_px=ORIGIN_PX)  # type: ignore[arg-type]


def test_a_clean_model_has_none() -> None:
    assert share(textured(RED, 0), *scan()) == 0


@pytest.mark.parametrize(("width", "least", "most"), [(0.1, 0.99, 1.0), (0.0125, 0.3, 0.75)])
def test_paper_on_the_rim_counts_as_far_as_it_reaches(width: float, least: float, most: float) -> None:
    """The examined rim is two pixels wide; a rim of one pixel is about half of it."""
    assert least <= share(textured(PAPER, width), *scan()) <= most


def test_ink_of_the_contour_is_the_figures_own() -> None:
    rgba, mask = scan(rim=INK, width=0.05)
    assert share(textured(INK, 0.05), rgba, mask) == 0


def test_figure_and_paper_of_the_same_colour_do_not_count() -> None:
    assert share(textured(PAPER, 0.1, PAPER), *scan(PAPER, PAPER)) == 0


def test_an_empty_mask_has_none() -> None:
    rgba, mask = scan()
    assert share(textured(RED, 0), rgba, np.zeros_like(mask)) == 0


def test_contours_of_cut_out_figures_are_no_background() -> None:
    """Pictures with transparency are mostly black where they show nothing, as thin contours are."""
    rgba, mask = scan(rim=INK, width=0.02)
    rgba[~mask] = 0
    assert share(textured(INK, 0.02), rgba, mask) == 0
    rgba[mask] = (*RED, 255)
    assert share(textured(INK, 0.02), rgba, mask) > 0.3
