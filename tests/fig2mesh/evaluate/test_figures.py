"""`fig2mesh evaluate figures` on a small drawing, and its tables."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from fig2mesh.commands.main import main
from fig2mesh.evaluate.figures import COLUMNS, FigureRow, as_json, as_markdown, find_drawings, summary
from tests.drawn import write_figure


def facts(**changes: float) -> dict[str, float]:
    return {column.key: 1 for column in COLUMNS} | changes


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|\n").split(" | ")]


def test_one_figure_is_measured_and_the_other_fails_with_a_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_figure(tmp_path, name="fine")
    (tmp_path / "joints missing").mkdir()
    Image.new("RGBA", (40, 60), (9, 9, 9, 255)).save(tmp_path / "joints missing" / "image.png")
    out = tmp_path / "made" / "table.md"
    arguments = ["evaluate", "figures", str(tmp_path), "--quality", "draft", "--parts", "outline", "-o", str(out)]
    assert main(arguments) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.splitlines() == ["1 of 2: fine", "2 of 2: joints missing"]
    header, _, fine, failed, median, worst = (cells(line) for line in out.read_text().splitlines())
    found = dict(zip(header, fine, strict=True))
    assert float(found["IoU %"]) > 97
    assert float(found["gap %"]) < 2
    assert float(found["q < 0.05 %"]) == 0
    assert (found["closed"], found["manifold"]) == ("yes", "yes")
    assert (found["pieces"], found["drawn"], found["inner shells"]) == ("1", "1", "0")
    assert 0 < float(found["level 0 mean mm"]) < float(found["level 2 mean mm"])
    assert float(found["5,000 max mm"]) < 20
    assert failed[0] == "joints missing"
    assert failed[1].startswith("failed: ")
    assert "keypoints.json: No such file" in failed[1]
    assert median[1:] == worst[1:] == fine[1:]
    # The answer is there now.
    assert main(arguments) == 2
    assert "already exists" in capsys.readouterr().err


def test_folders_and_pairs_are_found(tmp_path: Path) -> None:
    write_figure(tmp_path, name="pair")
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "image.png").touch()
    (tmp_path / "sheet.png").touch()
    (tmp_path / "nothing").mkdir()
    found = find_drawings(tmp_path)
    assert [(drawing.name, drawing.mask) for drawing in found] == [
        ("folder", None),
        ("pair", tmp_path / "pair_mask.png"),
    ]
    assert found[0].keypoints == folder / "keypoints.json"


@pytest.mark.parametrize("name", ["nowhere", "empty"])
def test_a_folder_without_figures_is_rejected_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    (tmp_path / "empty").mkdir()
    assert main(["evaluate", "figures", str(tmp_path / name), "-o", str(tmp_path / "new" / "table.md")]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith("fig2mesh: ")
    assert printed.count("\n") == 1
    assert name in printed
    assert not (tmp_path / "new").exists()


def test_median_and_worst_are_over_what_was_made() -> None:
    rows = [
        FigureRow("a", facts(silhouette_iou=0.9, gap_share=0.01, components=1, closed=True)),
        FigureRow("b", facts(silhouette_iou=0.8, gap_share=0.04, components=4, closed=False)),
        FigureRow("c", {}, "c.png: broken | for good"),
    ]
    median, worst = summary(rows)
    assert median["silhouette_iou"] == pytest.approx(0.85)
    assert (worst["silhouette_iou"], worst["gap_share"], worst["components"]) == (0.8, 0.04, 4)
    assert worst["closed"] is False
    assert isinstance(median["components"], int)
    table = as_markdown(rows)
    assert "c.png: broken \\| for good" in table
    assert "**no**" in table
    report = json.loads(as_json(rows))
    assert report["figures"]["c"] == {"failure": "c.png: broken | for good"}
    assert report["worst"]["gap_share"] == 0.04


def test_nothing_made_has_no_median() -> None:
    table = as_markdown([FigureRow("a", {}, "empty")]).splitlines()
    assert len(table) == 3
    assert {line.count(" | ") for line in (table[0], table[2])} == {len(COLUMNS)}


@pytest.mark.parametrize("command", [[], ["networks"], ["figures"]])
def test_help_imports_nothing_heavy(command: list[str]) -> None:
    program = (
        f"import sys\nfrom fig2mesh.commands.main import main\ncode = main(['evaluate', *{command}, '--help'])\n"
        "print(code, [n for n in ('numpy', 'torch', 'open3d') if n in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "0 []"
    assert "Usage: fig2mesh evaluate" in done.stdout
