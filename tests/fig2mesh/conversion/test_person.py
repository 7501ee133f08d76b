"""Pictures without a person: refused, or, with --force, marked in whatever is written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from PIL import Image, ImageDraw

from exporters.figure_reader import read_figure
from exporters.gis.geojson import feature
from exporters.inspect import inspect
from exporters.placed_figure import doubts_of
from fig2mesh.batch.ledger import Ledger
from fig2mesh.batch.row_job import convert_row
from fig2mesh.batch.summary import REPORTED
from fig2mesh.commands.main import main
from fig2mesh.errors import FigureError
from fig2mesh.parse.checks.person import MIN_SCORE, SURE_SCORE, check_person, person_doubts
from tests.drawn import write_figure
from tests.fig2mesh.batch.small import QUICK, batch_of, task_of

WORDS = [word for name, value in QUICK.items() for word in (f"--{name}", str(value))]


def draw_cat(path: Path) -> Path:
    """A seated cat."""
    image = Image.new("RGB", (420, 560), (240, 238, 230))
    pen = ImageDraw.Draw(image)
    fur = (120, 130, 150)
    pen.ellipse((130, 240, 300, 500), fill=fur, outline=0)
    pen.ellipse((140, 120, 290, 260), fill=fur, outline=0)
    pen.polygon([(150, 150), (160, 80), (200, 130)], fill=fur, outline=0)
    pen.polygon([(230, 130), (270, 80), (280, 150)], fill=fur, outline=0)
    pen.arc((270, 300, 390, 500), 270, 90, fill=fur, width=18)
    for x in (175, 235):
        pen.ellipse((x, 170, x + 20, 195), fill="white", outline=0)
    image.save(path)
    return path


def draw_tree(path: Path) -> Path:
    image = Image.new("RGB", (420, 560), "white")
    pen = ImageDraw.Draw(image)
    pen.rectangle((195, 330, 230, 520), fill=(110, 70, 30))
    for x, y in ((150, 250), (270, 240), (210, 170), (200, 270), (130, 200), (290, 180)):
        pen.ellipse((x - 65, y - 65, x + 65, y + 65), fill=(40, 140, 50), outline=(20, 70, 30))
    image.save(path)
    return path


def draw_text(path: Path) -> Path:
    from PIL import ImageFont

    image = Image.new("RGB", (420, 560), "white")
    pen = ImageDraw.Draw(image)
    for y in range(20, 540, 28):
        pen.text((20, y), "lorem ipsum dolor sit amet consetetur", fill=0, font=ImageFont.load_default(20))
    image.save(path)
    return path


@pytest.mark.parametrize(
    ("draw", "finding"),
    [
        (draw_cat, "hardly a person: score 0.4"),
        (draw_tree, "hardly a person: score 0.3"),
        (draw_text, "no figure found; pass --bbox"),
    ],
)
def test_what_is_not_a_person_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], draw: Any, finding: str
) -> None:
    path = draw(tmp_path / "picture.png")
    assert main([str(path), *WORDS, "-o", str(tmp_path / "a.glb")]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert finding in line
    assert ("--force" in line) == finding.startswith("hardly")
    assert [file.name for file in tmp_path.iterdir()] == ["picture.png"]


def test_force_goes_on_and_every_output_tells(tmp_path: Path) -> None:
    path, report = draw_cat(tmp_path / "cat.png"), tmp_path / "cat.json"
    target = tmp_path / "cat.glb"
    words = [str(path), *WORDS, "--lonlat", "8", "47", "-o", str(target), "-o", str(tmp_path / "cat.usda")]
    assert main([*words, "--report", str(report), "--force", "-q"]) == 0
    found = json.loads(report.read_text())["figure"]
    assert 0 < found["score"] < MIN_SCORE
    assert found["doubts"][0].startswith("hardly a person")
    for output in (target, tmp_path / "cat.usda"):
        facts = inspect(output)["metadata"]
        assert (facts["score"], facts["doubts"]) == (found["score"], found["doubts"])
    properties = feature(read_figure(target), None)["properties"]
    assert properties["score"] == found["score"]
    assert properties["doubts"].startswith("hardly a person")


def test_a_row_is_refused_unless_its_column_says_otherwise(tmp_path: Path) -> None:
    draw_cat(tmp_path / "cat.png")
    values = {"figure": "cat.png", "lon": 8, "lat": 47, **QUICK}
    batch = batch_of(tmp_path, tmp_path / "out")
    refused = convert_row(batch, task_of(values))
    assert refused.status == "failed"
    assert "hardly a person" in str(refused.error)
    assert convert_row(batch, task_of(values | {"force": True})).status == "done"
    record = Ledger(batch.folder).read("person")
    assert record is not None
    assert record["score"] == record["figure"]["score"] < MIN_SCORE
    assert record["doubts"][0].startswith("hardly a person")
    assert {"score", "doubts"} <= set(REPORTED)
    # The picture has been read by now; that must not let it through.
    assert convert_row(batch, task_of(values)).status == "failed"


def test_given_joints_are_not_doubted(tmp_path: Path) -> None:
    files = write_figure(tmp_path, 1)
    report = tmp_path / "report.json"
    words = [str(files.image), "--keypoints", str(files.keypoints), *WORDS, "-o", str(tmp_path / "a.glb")]
    assert main([*words, "--report", str(report), "-q"]) == 0
    found = json.loads(report.read_text())["figure"]
    assert (found["score"], found["doubts"]) == (None, [])


def test_the_limits() -> None:
    check_person("a", None, force=False)
    check_person("a", MIN_SCORE, force=False)
    check_person("a", 0.0, force=True)
    with pytest.raises(FigureError, match=r"a: hardly a person: score 0\.45"):
        check_person("a", MIN_SCORE - 0.01, force=False)
    assert person_doubts(SURE_SCORE) == ()
    assert person_doubts(0.5) == ("perhaps not a person (score 0.50)",)


@pytest.mark.parametrize(
    ("metadata", "found"),
    [
        (None, (None, "")),
        ({"score": "high", "doubts": "all"}, (None, "")),
        ({"score": float("nan")}, (None, "")),
        ({"score": True}, (None, "")),
        ({"score": 1, "doubts": ["a", 3]}, (1.0, "a; 3")),
    ],
)
def test_metadata_of_others_files(metadata: Any, found: tuple[float | None, str]) -> None:
    assert doubts_of(metadata) == found
