"""Georeferenced sheets as pictures in degrees, laid on the globe."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fig2mesh.commands.main import main
from fig2mesh.errors import InputError
from fig2mesh.globe.drape import drape
from georef.errors import PlacementError
from georef.mapsheet import read_sheet

WIDTH, HEIGHT = 240, 160


def _picture(path: Path) -> Path:
    """Red is the column, green the row, in whole pixels."""
    pixels = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    pixels[..., 0], pixels[..., 1] = np.arange(WIDTH)[None], np.arange(HEIGHT)[:, None]
    Image.fromarray(pixels).save(path)
    return path


def _swiss(folder: Path, world: str = "50 0 0 -50 2680025 1249975") -> Path:
    (folder / "sheet.pgw").write_text(world)
    (folder / "sheet.prj").write_text("EPSG:2056")
    return _picture(folder / "sheet.png")


def _turned(folder: Path) -> Path:
    return _swiss(folder, "40 30 30 -40 2680025 1249975")


def _upside_down(folder: Path) -> Path:
    return _swiss(folder, "-50 0 0 50 2692025 1241975")


def _utm(folder: Path) -> Path:
    (folder / "sheet.pgw").write_text("5000 0 0 -5000 200000 5600000")
    (folder / "sheet.prj").write_text("EPSG:32632")
    return _picture(folder / "sheet.png")


def _points(folder: Path) -> Path:
    rows = [(10, 10), (230, 12), (228, 150), (12, 148), (120, 80)]
    lines = [f"{8.4 + x / 500 + y * y / 4e6},{47.4 - y / 800},{x},{-y},1" for x, y in rows]
    text = "#CRS: EPSG:4326\nmapX,mapY,sourceX,sourceY,enable\n" + "\n".join(lines) + "\n"
    (folder / "sheet.png.points").write_text(text)
    return _picture(folder / "sheet.png")


SHEETS: dict[str, Callable[[Path], Path]] = {
    "Swiss": _swiss,
    "turned": _turned,
    "south up": _upside_down,
    "a country in UTM": _utm,
    "control points": _points,
}


@pytest.mark.parametrize("name", SHEETS)
def test_each_pixel_lies_where_the_sheet_has_it(tmp_path: Path, name: str) -> None:
    path = SHEETS[name](tmp_path)
    laid = drape(path, None, tmp_path, "laid")
    sheet = read_sheet(path)
    found = np.asarray(Image.open(laid.image)).astype(float)
    rows, columns = np.nonzero(found[..., 3] == 255)
    assert len(rows) > 0.4 * found.shape[0] * found.shape[1]
    pixels = found[rows, columns, :2] + 0.5
    # Not the outermost pixels, whose colours are those of the edge itself.
    inner = ((pixels > 2) & (pixels < [WIDTH - 2, HEIGHT - 2])).all(axis=1)
    lon = laid.west + (columns + 0.5) / found.shape[1] * (laid.east - laid.west)
    lat = laid.north - (rows + 0.5) / found.shape[0] * (laid.north - laid.south)
    expected = sheet.lonlat(pixels[inner])
    step = sheet.lonlat(pixels[inner] + [1, 1]) - expected
    away = np.abs(np.stack([lon, lat], axis=1)[inner] - expected)
    # Colours are whole numbers: less than two pixels of the sheet.
    assert (away <= 2 * np.abs(step).max()).all()
    middle = sheet.lonlat(np.array([[WIDTH / 2, HEIGHT / 2]]))[0]
    assert laid.west < middle[0] < laid.east
    assert laid.south < middle[1] < laid.north


def test_a_turned_sheet_is_transparent_beside_its_edges(tmp_path: Path) -> None:
    found = np.asarray(Image.open(drape(_turned(tmp_path), None, tmp_path, "laid").image))
    assert [int(found[row, column, 3]) for row, column in ((0, 0), (-1, -1), (0, -1), (-1, 0))].count(0) >= 2


def test_the_command_drapes_the_sheet(tmp_path: Path) -> None:
    built = tmp_path / "package" / "Build" / "Cesium"
    (built / "Widgets").mkdir(parents=True)
    for name in ("Cesium.js", "Widgets/widgets.css"):
        (built / name).write_text("")
    (tmp_path / "pin.geojson").write_text(
        json.dumps({"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [8.5, 47.4]}})
    )
    (tmp_path / "a").mkdir()
    sheet = _swiss(tmp_path / "a")
    (tmp_path / "a" / "sheet.prj").unlink()
    words = ["globe", str(tmp_path / "pin.geojson"), "-o", str(tmp_path / "out"), "--cesium", str(tmp_path / "package")]
    assert main([*words, "--map", str(sheet)]) == 2, "no reference system"
    assert not (tmp_path / "out").exists()
    assert main([*words, "--map", str(sheet), "--map-crs", "EPSG:2056"]) == 0
    assert (tmp_path / "out" / "overlays" / "0.png").is_file()
    facts = (tmp_path / "out" / "index.html").read_text()
    west, south, east, north = json.loads(facts.partition('"rectangle": ')[2].partition("]")[0] + "]")
    assert 8.4 < west < 8.51 < east < 8.7
    assert 47.3 < south < north < 47.41


def test_sheets_that_cannot_be_draped_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "sheet.pgw").write_text("1 0 0 -1 179.5 10")
    (tmp_path / "sheet.prj").write_text("EPSG:4326")
    path = _picture(tmp_path / "sheet.png")
    with pytest.raises((InputError, PlacementError)):
        drape(path, None, tmp_path, "laid")
    with pytest.raises((InputError, PlacementError)):
        drape(tmp_path / "none.png", None, tmp_path, "laid")
    assert main(["globe", "x.glb", "--map-crs", "EPSG:2056"]) == 2
    assert "--map-crs: there is no sheet" in capsys.readouterr().err
