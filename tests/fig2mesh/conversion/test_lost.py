"""Thin things that get lost on the way are reported with place and size."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw
from scipy import ndimage

from fig2mesh.commands.main import main
from fig2mesh.measure import lost
from fig2mesh.measure.lost import lost_specks
from fig2mesh.measure.model import FrontOverlap
from fig2mesh.parse.checks.missed import Box, boxes, detached_pieces, missed_things, named
from fig2mesh.parse.read import read_figure
from fig2mesh.parts.pieces import clean
from tests.drawn import write_figure
from tests.fig2mesh.batch.small import QUICK

WORDS = [word for name, value in QUICK.items() for word in (f"--{name}", str(value))]


@pytest.mark.parametrize(
    ("step", "doubts"), [(1, ("2×150 px at (103, 56) of the drawing: not in the model",)), (2, ())]
)
def test_what_the_model_does_not_cover(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: int, doubts: tuple[str, ...]
) -> None:
    files = write_figure(tmp_path)
    figure = replace(read_figure(files.image, keypoints=files.keypoints), origin_px=(100.0, 50.0))
    drawn = figure.mask.copy()
    drawn[6:156, 3:5] = step == 1
    # A rim is no loss, nor is a spot.
    modelled = ndimage.binary_erosion(figure.mask, iterations=2)
    drawn[590:594, 390:394] = True
    overlap = FrontOverlap(drawn, modelled, (0, 0), 1)
    monkeypatch.setattr(lost, "front_overlap", lambda *_, **__: overlap)
    assert lost.lost_in_model(None, figure, metres_per_pixel=1.0, origin_px=(0.0, 0.0)) == doubts  # type: ignore[arg-type]


def test_the_model_of_a_whole_figure_has_all_of_it(tmp_path: Path) -> None:
    files = write_figure(tmp_path)
    image = Image.open(files.image)
    ImageDraw.Draw(image).rectangle((390, 5, 394, 9), fill=(90, 60, 30, 255))
    image.save(files.image)
    report = tmp_path / "report.json"
    words = [str(files.image), "--keypoints", str(files.keypoints), *WORDS, "-o", str(tmp_path / "a.glb")]
    assert main([*words, "--report", str(report), "-q"]) == 0
    (doubt,) = json.loads(report.read_text())["figure"]["doubts"]
    assert doubt == "5×5 px at (390, 5) of the drawing: detached, and too small to model"


@pytest.mark.parametrize("corner", [(0, 0), (7, 5)])
def test_specks_are_named_with_place_and_size(tmp_path: Path, corner: tuple[int, int]) -> None:
    files = write_figure(tmp_path)
    figure = read_figure(files.image, keypoints=files.keypoints)
    mask = figure.mask.copy()
    mask[20:26, 380:384] = True
    drawn = replace(figure, mask=mask, origin_px=(float(corner[0]), float(corner[1])))
    found = clean(drawn, 0.012, 2048)
    assert found.specks == 1
    (doubt,) = lost_specks(drawn, found.figure)
    assert doubt.startswith(f"4×6 px at ({380 + corner[0]}, {20 + corner[1]}) of the drawing")
    small = clean(drawn, 0.012, 200)
    assert small.figure.step_px > 1
    assert lost_specks(drawn, small.figure) == (doubt,)


def blank() -> tuple[np.ndarray, np.ndarray]:
    """A picture of a body of 60 × 200 px, and its silhouette."""
    rgb = np.full((320, 300, 3), 250, np.uint8)
    mask = np.zeros((320, 300), np.bool_)
    mask[60:260, 100:160] = True
    rgb[mask] = (180, 40, 40)
    return rgb, mask


def test_a_staff_beside_the_silhouette_is_missed() -> None:
    rgb, mask = blank()
    assert missed_things(rgb, mask, (0, 0)) == ()
    rgb[40:250, 172:176] = (90, 60, 30)
    (doubt,) = missed_things(rgb, mask, (1000, 500))
    assert doubt.startswith("4×210 px at (1172, 540) of the drawing: beside the figure")


@pytest.mark.parametrize(
    "thing",
    [
        np.s_[:, 180:184],  # leaves the picture, as lines of a map do
        np.s_[255:262, 60:220],  # the ground
        np.s_[100:104, 250:290],  # far away
        np.s_[150:158, 175:180],  # small
    ],
)
def test_what_is_not_the_figures_is_no_doubt(thing: tuple[slice, slice]) -> None:
    rgb, mask = blank()
    rgb[thing] = (90, 60, 30)
    rgb[mask] = (180, 40, 40)
    assert missed_things(rgb, mask, (0, 0)) == ()


def test_nothing_can_be_known_on_a_busy_background() -> None:
    rgb, mask = blank()
    noise = np.random.default_rng(0).integers(0, 255, rgb.shape, np.uint8)
    assert missed_things(np.where(mask[..., None], rgb, noise), mask, (0, 0)) == ()


def test_prongs_that_float_are_a_doubt() -> None:
    _, mask = blank()
    assert detached_pieces(mask, (0, 0)) == ()
    mask[30:50, 180:183] = True
    assert detached_pieces(mask, (10, 20)) == (
        "3×20 px at (190, 50) of the drawing: detached from the figure in the inferred silhouette",
    )


def test_the_largest_are_named_first_and_not_all() -> None:
    mask = np.zeros((40, 40), np.bool_)
    for size in range(1, 6):
        mask[8 * size - 8 : 8 * size - 8 + size, 3] = True
    found = boxes(mask, 2)
    assert found[0] == Box(3, 32, 1, 5)
    assert len(found) == 4
    assert named(found, "lost")[0].endswith("and 1 more of the drawing: lost")
    assert named([], "lost") == ()
