"""The table of a sheet's figures is a collection as it is."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fig2mesh.commands.main import main
from fig2mesh.commands.parse import feet_on_sheet, georeference_of
from fig2mesh.parse.files import write_sheet
from fig2mesh.parse.infer import Inference
from fig2mesh.parse.keypoints import read_keypoints
from fig2mesh.parse.sheet import SheetFigure
from fig2mesh.parse.sheet_table import MAX_OVERVIEW_PX, overview
from tests.drawn import write_figure

CORNER = (40, 30)


@pytest.fixture
def sheet(tmp_path: Path) -> Path:
    """A sheet with one drawn figure, in a folder of its own."""
    files = write_figure(tmp_path, 1, "person")
    drawn = Image.open(files.image).convert("RGBA")
    whole = Image.new("RGB", (drawn.width + 100, drawn.height + 80), (238, 229, 203))
    whole.paste(drawn, CORNER, drawn)
    (tmp_path / "maps").mkdir()
    whole.save(tmp_path / "maps" / "sheet, 1.png")
    return tmp_path / "maps" / "sheet, 1.png"


@pytest.fixture
def figure(sheet: Path) -> SheetFigure:
    """The figure, as the search would find it."""
    folder = sheet.parents[1]
    rgba = np.asarray(Image.open(folder / "person.png").convert("RGBA"))
    joints = read_keypoints(folder / "person.json")
    mask = rgba[..., 3] > 127
    labels = np.where(mask, np.uint8(1), np.uint8(0))
    found = Inference(
        mask, labels, joints.points_px, joints.visible, np.full(21, 0.9, np.float32), ("unsure of r_hand",)
    )
    (x, y), (height, width) = CORNER, mask.shape
    return SheetFigure((x, y, x + width, y + height), 0.876543, found)


def _write(folder: Path, sheet: Path, figure: SheetFigure, overwrite: bool = False) -> list[dict[str, str]]:
    rgb = np.asarray(Image.open(sheet).convert("RGB"))
    beside = georeference_of(sheet)
    feet = None if beside is None else [feet_on_sheet(figure)]
    write_sheet(folder, [figure], sheet, rgb, "fig2mesh", overwrite, feet, beside or ())
    with (folder / "figures.csv").open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.parametrize("georeferenced", [True, False])
def test_the_table_is_a_collection(
    sheet: Path, figure: SheetFigure, georeferenced: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if georeferenced:
        sheet.with_suffix(".pgw").write_text("5 0 0 -5 2680002.5 1249997.5")
        sheet.with_suffix(".prj").write_text("EPSG:2056")
    out = tmp_path / "out"
    (row,) = _write(out, sheet, figure)
    assert (row["name"], row["figure"], row["found_score"]) == ("figure_01", sheet.name, "0.877")
    assert row["bbox"] == " ".join(map(str, figure.bbox))
    options = ["--parts", "outline", "--dry-run"]
    if georeferenced:
        assert row["map"] == sheet.name
        x0, _, x1, y1 = figure.bbox
        assert x0 < float(row["x"]) < x1
        assert float(row["y"]) == pytest.approx(y1, abs=40)
        assert (float(row["x"]), float(row["y"])) == pytest.approx(feet_on_sheet(figure), abs=0.01)
    else:
        assert (row["lon"], row["lat"]) == ("", "")
        options.append("--unplaced")
    assert main(["batch", str(out / "figures.csv"), *options]) == 0
    assert "1 rows: 1 valid, 0 invalid" in capsys.readouterr().err


def test_a_sheet_below_the_folder_is_not_linked(sheet: Path, figure: SheetFigure, tmp_path: Path) -> None:
    (row,) = _write(tmp_path, sheet, figure)
    assert row["figure"] == f"maps/{sheet.name}"
    assert not (tmp_path / sheet.name).exists()


def test_the_overview_shows_boxes_and_is_small(sheet: Path, figure: SheetFigure) -> None:
    rgb = np.full((600, 3000, 3), 255, np.uint8)
    shown = np.asarray(overview(rgb, [figure]))
    assert shown.shape == (400, MAX_OVERVIEW_PX, 3)
    red = (np.abs(shown.astype(int) - (220, 20, 60)) < 30).all(axis=2)
    x0, y0, x1, _ = (round(edge * 2 / 3) for edge in figure.bbox)
    rows, columns = np.flatnonzero(red.any(axis=1)), np.flatnonzero(red.any(axis=0))
    assert (columns[0], columns[-1]) == pytest.approx((x0, x1), abs=3)
    assert rows[0] == pytest.approx(y0, abs=3)


def test_the_coco_file_is_refused_by_naming_the_table(
    sheet: Path, figure: SheetFigure, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _write(tmp_path / "out", sheet, figure)
    coco = tmp_path / "out" / "figures.json"
    for remedy in ("give figures.csv, the table beside it", "fig2mesh parse --all writes one, figures.csv"):
        assert main(["batch", str(coco), "--dry-run"]) == 2
        printed = capsys.readouterr().err
        assert "is a COCO file of annotations, not a collection" in printed
        assert remedy in printed
        (tmp_path / "out" / "figures.csv").unlink(missing_ok=True)


def test_a_second_run_replaces_the_first(sheet: Path, figure: SheetFigure, tmp_path: Path) -> None:
    first = _write(tmp_path / "out", sheet, figure)
    before = sheet.read_bytes()
    assert _write(tmp_path / "out", sheet, figure, overwrite=True) == first
    assert sheet.read_bytes() == before == (tmp_path / "out" / sheet.name).read_bytes()
    assert not [path for path in (tmp_path / "out").iterdir() if path.name.startswith(".")]
