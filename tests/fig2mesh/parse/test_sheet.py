"""Whole sheets: every figure once, nothing where there is none; files that the main job and others read."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fig2mesh.commands.main import main
from fig2mesh.parse.read import read_figure
from fig2mesh.parse.sheet import STEP, _centres, _edges, _shared
from fig2mesh.skeleton import JOINT

EXAMPLES = Path(__file__).parents[3] / "examples" / "figures"

CORNERS = {"farmer": (60, 150), "footballer": (420, 40)}


@pytest.mark.parametrize(("longest", "smallest"), [(1000, 100), (1000, 990), (50, 400)])
def test_some_window_fits_every_size(longest: float, smallest: float) -> None:
    edges = _edges(longest, smallest)
    assert edges[0] == longest
    assert all(a > b for a, b in itertools.pairwise(edges))
    assert edges[-1] >= min(1.15 * smallest, longest)


@pytest.mark.parametrize(("height", "width", "edge"), [(700, 1000, 200.0), (90, 1000, 300.0), (400, 400, 400.0)])
def test_a_figure_anywhere_is_whole_in_some_window(height: int, width: int, edge: float) -> None:
    centres = _centres((height, width), edge)
    tall = (1 - STEP) * edge
    for x in np.linspace(0, max(width - tall, 0), 23):
        for y in np.linspace(0, max(height - tall, 0), 23):
            box = np.array([x, y, min(x + tall, width), min(y + tall, height)])
            inside = (centres - edge / 2 <= box[:2] + 1e-6).all(axis=1) & (centres + edge / 2 >= box[2:] - 1e-6).all(
                axis=1
            )
            assert inside.any(), box


def test_shared_is_of_the_smaller_box() -> None:
    large, inner, apart = (np.array(box, float) for box in ((0, 0, 10, 10), (2, 2, 4, 4), (20, 0, 30, 10)))
    assert _shared(large, inner) == _shared(inner, large) == 1
    assert _shared(large, apart) == 0


@pytest.mark.slow
def test_two_people_on_a_sheet_are_found_and_become_models(tmp_path: Path) -> None:
    sheet = Image.new("RGB", (760, 620), (238, 229, 203))
    pen = np.asarray(sheet).copy()
    pen[:, 380:384] = (120, 90, 60)  # a road
    sheet = Image.fromarray(pen)
    places = {}
    for name, corner in CORNERS.items():
        image = Image.open(EXAMPLES / name / "image.png").convert("RGBA")
        factor = 400 / image.height
        small = image.resize((round(image.width * factor), 400), Image.Resampling.BOX)
        sheet.paste(small, corner, small)
        places[name] = (corner, small, factor)
    path = tmp_path / "sheet.png"
    sheet.save(path)
    out = tmp_path / "out"
    assert main(["parse", str(path), "--all", "--smallest", "300", "-o", str(out), "-q"]) == 0
    document = json.loads((out / "figures.json").read_text())
    assert document["images"][0]["width"] == 760
    assert len(document["annotations"]) == 2
    made = {"figures.json", "figures.csv", "overview.jpg", "sheet.png", "figure_01", "figure_02"}
    assert {folder.name for folder in out.iterdir()} == made
    for annotation in document["annotations"]:
        x, y, width, height = annotation["bbox"]
        box = (x, y, x + width, y + height)
        folder = out / annotation["folder"]
        figure = read_figure(path, mask=folder / "mask.png", keypoints=folder / "keypoints.json", bbox=box)
        middle = figure.joints_px[JOINT["pelvis"]] + [x, y]
        name = min(CORNERS, key=lambda each: abs(CORNERS[each][0] + 150 - middle[0]))
        corner, small, factor = places[name]
        truth = np.zeros((620, 760), bool)
        alpha = np.asarray(small)[..., 3] > 128
        truth[corner[1] : corner[1] + 400, corner[0] : corner[0] + small.width] = alpha
        found = np.zeros_like(truth)
        found[y : y + height, x : x + width] = figure.mask
        assert (truth & found).sum() / (truth | found).sum() > 0.8, name
        drawn = json.loads((EXAMPLES / name / "keypoints.json").read_text())["keypoints"]
        right = [
            np.hypot(*(np.array(drawn[joint][:2]) * factor + corner - figure.joints_px[index] - [x, y])) < 40
            for joint, index in JOINT.items()
        ]
        assert np.mean(right) > 0.75, name
        # The same file is COCO: the box selects the figure.
        again = read_figure(path, mask=folder / "mask.png", keypoints=out / "figures.json", bbox=box)
        np.testing.assert_allclose(again.joints_px, figure.joints_px, atol=0.02)
        assert len(annotation["segmentation"]) >= 1


REFUSED = {
    "one figure": (["--all", "--bbox", "0", "0", "9", "9"], "--all: cannot be combined with"),
    "one": (["--smallest", "50"], "--smallest: requires --all"),
    "there": (["--all"], "figures.json: already exists"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refusals_are_one_line(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Image.new("RGB", (80, 120), "white").save(tmp_path / "sheet.png")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "figures.json").write_text("{}")
    options, message = REFUSED[case]
    assert main(["parse", str(tmp_path / "sheet.png"), "-o", str(tmp_path / "out"), *options]) == 2
    output = capsys.readouterr().err
    assert message in output
    assert len(output.strip().splitlines()) == 1


def test_a_blank_sheet_has_nobody(tmp_path: Path) -> None:
    Image.new("RGB", (300, 200), (240, 235, 215)).save(tmp_path / "sheet.png")
    assert main(["parse", str(tmp_path / "sheet.png"), "--all", "-o", str(tmp_path / "out"), "-q"]) == 0
    assert json.loads((tmp_path / "out" / "figures.json").read_text())["annotations"] == []
    assert [file.name for file in (tmp_path / "out").iterdir()] == ["figures.json"]
