"""The command, on the cheapest settings that there are."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from fig2mesh.commands.main import main
from fig2mesh.commands.tradeoff import KNOBS as NAMES
from fig2mesh.settings import PRESETS, Settings
from fig2mesh.tradeoff import sweep
from fig2mesh.tradeoff.report import COLUMNS
from fig2mesh.tradeoff.sweep import FINEST, KNOBS, STAGES_OF, requests
from tests.drawn import DrawnFiles, write_figure

CHEAP = replace(PRESETS["draft"], parts="outline", textures="wrap", mesher="isosurface", voxel=0.02, texture_size=128)


@pytest.fixture
def drawn(tmp_path: Path) -> DrawnFiles:
    folder = tmp_path / "figure"
    folder.mkdir()
    return write_figure(folder)


def test_every_value_differs_from_the_standard_in_its_knob_alone() -> None:
    standard = PRESETS["standard"]
    for knob, value, settings in requests(list(KNOBS)):
        if knob in STAGES_OF:
            assert str(getattr(settings, knob)) == value != str(getattr(standard, knob))
            assert replace(settings, **{knob: getattr(standard, knob)}) == standard
    assert tuple(KNOBS) == NAMES
    assert FINEST.voxel < min(KNOBS["voxel"])
    assert FINEST.spacing < min(KNOBS["spacing"])
    assert FINEST.triangles > max(KNOBS["triangles"])


@pytest.mark.slow
def test_table_plots_and_page(drawn: DrawnFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def few(knobs: list[str]) -> Iterator[tuple[str, str, Settings]]:
        yield "finest", "", replace(CHEAP, triangles=20_000)
        yield "", "standard", CHEAP
        yield "triangles", "500", replace(CHEAP, triangles=500)
        yield "textures", "none", replace(CHEAP, textures="none")

    monkeypatch.setattr(sweep, "requests", few)
    out = tmp_path / "out"
    arguments = ["tradeoff", str(drawn.image), "--keypoints", str(drawn.keypoints), "-o", str(out), "-q"]
    assert main(arguments) == 0
    with (out / "tradeoff.csv").open(newline="") as stream:
        rows = {(row["knob"], row["value"]): row for row in csv.DictReader(stream)}
    assert tuple(next(iter(rows.values()))) == COLUMNS
    coarse, standard = rows["triangles", "500"], rows["quality", "standard"]
    assert float(coarse["chamfer_mm"]) > 2 * float(standard["chamfer_mm"]) > 0
    assert float(rows["finest", ""]["chamfer_mm"]) < 1e-3
    assert float(standard["seconds"]) > 0 < float(standard["peak_mb"])
    assert float(standard["front_ssim"]) > 0.5
    assert rows["textures", "none"]["front_ssim"] == ""
    name = drawn.image.stem
    for plot in (f"{name}-front.png", f"{name}-knobs.png"):
        with Image.open(out / plot) as image:
            assert min(image.size) > 200
    page = (out / "README.md").read_text()
    assert "The knee is" in page
    assert page.count("| triangles=500 |") + page.count("| **triangles=500** |") == 1
    assert main(arguments) == 2, "nothing is overwritten"


@pytest.mark.parametrize("case", ["exists", "missing", "two", "knob"])
def test_bad_requests(drawn: DrawnFiles, tmp_path: Path, case: str, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    words = [str(drawn.image), "--keypoints", str(drawn.keypoints), "-o", str(out)]
    if case == "exists":
        out.mkdir()
        (out / "mine.txt").write_text("kept")
    elif case == "missing":
        words[0] = str(tmp_path / "none.png")
    elif case == "two":
        words.insert(0, str(drawn.image))
    else:
        words += ["--knob", "speed"]
    assert main(["tradeoff", *words]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []
    assert not out.exists() or [path.name for path in out.iterdir()] == ["mine.txt"]
