"""Silhouettes that are hardly there, everywhere, or full of holes: closed solids with as many pieces as drawn."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, ImageDraw
from scipy import ndimage

from fig2mesh.field import analytic
from fig2mesh.field.body import Body
from fig2mesh.measure.model import load_textured
from fig2mesh.mesh.isosurface import isosurface
from fig2mesh.mesh.simplify import simplify
from fig2mesh.mesh.topology import check_solid, join
from fig2mesh.parts.pieces import clean
from fig2mesh.settings import PRESETS
from tests.hard_cases.case import Worst, drawn, hard_case
from tests.hard_cases.figures import Job, drawn_mask, figure_of, joints_on, painted, refused, solid_of, stick_figure

EIGHT = np.ones((3, 3))


def closed_as_drawn(measures: dict) -> None:
    assert measures["watertight"]
    assert measures["winding_consistent"]
    assert measures["volume_m3"] > 0
    assert measures["components"] == measures["pieces_drawn"]


@pytest.mark.parametrize(("width", "head"), [pytest.param(1, 0.1, marks=pytest.mark.slow), (1, 0.2), (3, 0.2)])
@hard_case(
    "a head of 1/5 or 2/5 of the height on limbs of 1 and 3 pixels, 3 and 9 mm of a figure 1.79 m high",
    "one closed solid; its arms and legs reach as far as they are drawn",
    "draft draws strokes 14 mm wide so that its grids hold them; a tip may stop a node (10 mm) and a mesh's cell short",
    0.03,
    "of the height",
)
def test_giant_head_on_hair_thin_limbs(job: Job, worst: Worst, width: int, head: float) -> None:
    mask = stick_figure(width, head)
    made = job(painted(mask), joints_on(400, 600))
    assert made.code == 0, made.error
    closed_as_drawn(made.measures)
    assert made.measures["pieces_drawn"] == 1
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    vertices = load_textured(made.output).vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    tall, wide = rows[-1] - rows[0] + 1, columns[-1] - columns[0] + 1
    worst(abs((high[1] - low[1]) / 1.79 - 1))
    worst(abs((high[0] - low[0]) / 1.79 - wide / tall))


def ring(inner: float, outer: float) -> np.ndarray:
    y, x = np.mgrid[:300, :200]
    distance = np.hypot(x - 100, y - 150)
    return (distance < outer) & (distance > inner)


def window(rows: slice, columns: slice) -> np.ndarray:
    mask = np.zeros((300, 200), bool)
    mask[rows, columns] = True
    return mask


def with_specks(share: float) -> np.ndarray:
    return drawn_mask() | (np.random.default_rng(1).random((300, 200)) < share)


SILHOUETTES = {
    "one pixel": window(slice(150, 151), slice(100, 101)),
    "one row": window(slice(150, 151), slice(None)),
    "one column": window(slice(None), slice(100, 101)),
    "two pixels in a diagonal": np.eye(2, dtype=bool),
    "whole picture": np.ones((300, 200), bool),
    "many specks": with_specks(0.02),
    "nothing but specks": np.random.default_rng(1).random((300, 200)) < 0.02,
    "chessboard of single pixels": np.indices((300, 200)).sum(axis=0) % 2 == 0,
    "outline of one pixel": drawn_mask() & ~ndimage.binary_erosion(drawn_mask()),
}


@pytest.mark.parametrize("name", SILHOUETTES)
@hard_case(
    ", ".join(SILHOUETTES),
    "closed, oriented and manifold, as many solids as pieces that are no specks",
    "topology is counted, not measured",
)
def test_hard_silhouettes(job: Job, name: str) -> None:
    mask = SILHOUETTES[name]
    made = job(painted(mask), None, mask=mask)
    assert made.code == 0, made.error
    closed_as_drawn(made.measures)


@pytest.mark.parametrize("width", [35, 2])
@hard_case(
    "rings of 35 and of 2 pixels",
    "closed as drawn, genus 1, and the silhouette without the hole",
    "a thin ring is drawn 14 mm wide instead of 10 to be held, and its contour is known to a pixel of the canvas",
    0.35,
    "(1 − IoU)",
)
def test_rings_keep_their_hole(job: Job, worst: Worst, width: int) -> None:
    made = job(painted(ring(95 - width, 95)))
    assert made.code == 0, made.error
    closed_as_drawn(made.measures)
    assert made.measures["genus"] == 1
    worst(1 - made.measures["silhouette_iou"])


@pytest.mark.parametrize("by_mask", [False, True])
@hard_case(
    "an empty silhouette, by alpha and by --mask",
    "one line, exit code 2, nothing written",
    "there is no solid of nothing",
)
def test_empty_silhouette(job: Job, by_mask: bool) -> None:
    nothing = np.zeros((300, 200), bool)
    picture = painted(drawn_mask()) if by_mask else painted(nothing)
    refused(job(picture, None, mask=nothing if by_mask else None), "silhouette is empty")


@st.composite
def scribbles(draw: st.DrawFn) -> np.ndarray:
    """Up to six thick strokes and discs anywhere on a picture of 120 x 180 pixels."""
    image = Image.new("L", (120, 180))
    pen = ImageDraw.Draw(image)
    place = st.tuples(st.integers(4, 115), st.integers(4, 175))
    for _ in range(draw(st.integers(1, 6))):
        if draw(st.booleans()):
            pen.line([draw(place), draw(place)], fill=255, width=draw(st.integers(1, 12)))
        else:
            (x, y), r = draw(place), draw(st.integers(1, 30))
            pen.ellipse((x - r, y - r, x + r, y + r), fill=255)
    return np.asarray(image) > 0


@given(scribbles())
@drawn(5)
@hard_case(
    "up to six strokes and discs anywhere, with the joints of a figure that is not there",
    "closed, oriented, manifold; every piece that is no speck is one solid",
    "topology is counted, not measured",
)
def test_scribbles(mask: np.ndarray) -> None:
    figure, pieces, _ = clean(figure_of(mask), PRESETS["draft"].voxel, 2048)
    report = check_solid(solid_of(figure, pieces).mesh)
    assert report.outward
    assert report.components == pieces


@pytest.mark.parametrize("triangles", [200, 64, 4])
@hard_case(
    "twelve balls of 1 to 1/40 of each other's size, simplified to 200, 64 and 4 triangles together",
    "twelve closed solids; each keeps 64 triangles if it had them",
    "topology is counted; volume of a ball of 64 triangles is that of its inscribed polyhedron, 30 % less at worst",
    0.3,
    "of the volume",
)
def test_simplifying_many_small_pieces(worst: Worst, triangles: int) -> None:
    pieces = []
    for index in range(12):
        radius = 0.4 * 40 ** (-index / 11)
        centre = (float(index), 0.0, 0.0)
        part = analytic.sample(analytic.sphere(centre, radius), 1, centre, 3 * radius, 25)
        pieces.append(isosurface(Body((part,)), spacing=radius / 6))
    mesh = join(pieces)
    before, after = check_solid(mesh), check_solid(simplify(mesh, triangles))
    assert after.outward
    assert after.components == before.components == 12
    assert after.triangles >= 12 * 64
    worst(1 - after.volume / before.volume)
