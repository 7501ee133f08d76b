"""Figures without colours, with one, or with too many."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from exporters.gltf.reader import read_gltf
from exporters.validate import validate
from fig2mesh.texture.materials import find_materials
from fig2mesh.texture.pen import find_pen, lined_pairs, reinked, without_contour
from fig2mesh.texture.sources import _ink, _palette, continued
from tests.drawn import draw_figure
from tests.hard_cases.case import Worst, drawn, hard_case
from tests.hard_cases.figures import Job, drawn_mask, painted

MASK = drawn_mask()
BLACK, WHITE = (0, 0, 0, 255), (255, 255, 255, 255)


def texture(job: Job) -> np.ndarray:
    import io

    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(read_gltf(job.folder / "made.glb").image(0))).convert("RGB"), np.int64)


@pytest.mark.parametrize("colour", [BLACK, WHITE, (200, 40, 40, 255), (1, 2, 3, 255)])
@hard_case(
    "figures of one colour: black, white, red and nearly black",
    "every texel has that colour",
    "a palette of one colour, no pen, and 8-bit rounding of the mean",
    1,
    "of 255",
)
def test_figures_of_one_colour(job: Job, worst: Worst, colour: tuple[int, ...]) -> None:
    made = job(painted(MASK, colour))
    assert made.code == 0, made.error
    worst(np.abs(texture(job) - colour[:3]).max())


@pytest.mark.parametrize("alpha", [0, 1, 127])
@hard_case(
    "alpha of 0, 1 and 127 everywhere inside of --mask",
    "the colours that the picture has under its alpha",
    "straight alpha says how much of a colour there is, not which; the mask says where",
    1,
    "of 255",
)
def test_transparent_figures(job: Job, worst: Worst, alpha: int) -> None:
    picture = painted(MASK, (200, 40, 40, alpha))
    made = job(picture, None, mask=MASK)
    assert made.code == 0, made.error
    worst(np.abs(texture(job) - (200, 40, 40)).max())


@pytest.mark.parametrize("contours", ["keep", "drop"])
@pytest.mark.parametrize("paper", ["white", "transparent"])
@hard_case(
    "a drawing of nothing but black contours, on white and on transparent paper, contours kept and dropped",
    "a valid model of black and white; the validator finds nothing",
    "a palette of two colours, of which one is the pen's",
)
def test_line_drawings(job: Job, contours: str, paper: str) -> None:
    line = MASK & ~ndimage.binary_erosion(MASK, iterations=2)
    picture = np.where(line[..., None], np.array(BLACK, np.uint8), np.array(WHITE, np.uint8))
    if paper == "transparent":
        picture[~line] = 0
    made = job(picture, None, "--contours", contours, mask=MASK)
    assert made.code == 0, made.error
    assert [finding for finding in validate(made.output) if finding.severity != "info"] == []


@hard_case(
    "every pixel another colour, and a ramp of 256 greys",
    "a valid model; the validator finds nothing",
    "palettes have at most 16 colours, whatever a picture has",
)
@pytest.mark.parametrize("kind", ["noise", "ramp"])
def test_more_colours_than_a_palette_holds(job: Job, kind: str) -> None:
    picture = np.array(draw_figure(1))
    values = np.random.default_rng(0).integers(0, 256, (*MASK.shape, 3))
    picture[..., :3] = values if kind == "noise" else np.linspace(0, 255, 300)[:, None, None]
    made = job(picture)
    assert made.code == 0, made.error
    assert [finding for finding in validate(made.output) if finding.severity != "info"] == []


@st.composite
def pictures(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """(h, w, 3) float32 of 1 to 20 colours and (h, w) bool, the figure, of at least one pixel."""
    height, width = draw(st.integers(1, 24)), draw(st.integers(1, 24))
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    colours = rng.integers(0, 256, (draw(st.integers(1, 20)), 3))
    own = rng.random((height, width)) < draw(st.sampled_from([0.05, 0.5, 1.0]))
    own[rng.integers(height), rng.integers(width)] = True
    return colours[rng.integers(len(colours), size=(height, width))].astype(np.float32), own


@given(pictures())
@drawn(60)
@hard_case(
    "pictures of 1 to 24 pixels a side, 1 to 20 colours at random, a figure of one pixel or more",
    "palette, ink, pen and plain areas are finite and of the picture's own colours; no more than 16 of them",
    "a palette's colours are medians of the drawing's: at most halfway between two of them, never beyond",
    0,
    "of 255 beyond the picture's range",
)
def test_palettes_and_pens_of_tiny_pictures(worst: Worst, drawn_picture: tuple[np.ndarray, np.ndarray]) -> None:
    picture, own = drawn_picture
    palette, index = _palette(picture, own, 0)
    assert 1 <= len(palette) <= 16
    assert index.min() >= 0
    assert index.max() < len(palette)
    used = palette[np.unique(index[own])]
    worst(max(float((picture[own].min(axis=0) - used).max()), float((used - picture[own].max(axis=0)).max()), 0.0))
    ink = _ink(palette, index, own, 1.5)
    assert ((ink >= 0) & (ink <= 1)).all()
    pen = find_pen(palette, index, ink, own)
    kind = find_materials(picture, palette, index, own, pen, 0.01).index
    assert set(np.unique(kind)) <= set(range(len(palette)))
    assert np.isfinite(reinked(palette, kind, lined_pairs(palette, kind, own, pen), pen)).all()
    if pen is not None:
        assert np.isfinite(pen.width)
        assert pen.width >= 1
        assert np.isfinite(without_contour(picture, own, pen, pen.width)).all()
    for alpha in (0, 90, 255):
        rgba = np.dstack([picture, np.full(own.shape, alpha)]).astype(np.uint8)
        assert np.isfinite(continued(rgba, own)).all()


@pytest.mark.slow
@pytest.mark.parametrize("colour", [BLACK, (200, 40, 40, 0)])
@hard_case(
    "figures of one colour, opaque and transparent; unseen sides by the networks",
    "every texel has that colour",
    "networks choose places of the drawing, not colours",
    1,
    "of 255",
)
def test_one_colour_with_networks(job: Job, worst: Worst, colour: tuple[int, ...]) -> None:
    made = job(painted(MASK, colour), None, "--parts", "network", "--textures", "wrap", mask=MASK)
    assert made.code == 0, made.error
    worst(np.abs(texture(job) - colour[:3]).max())
