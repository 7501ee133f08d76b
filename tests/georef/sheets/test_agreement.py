"""Georeferences that do not belong to the picture they lie beside: refused or reported, never used in silence."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from georef.errors import PlacementError
from georef.mapsheet import MapSheet, read_sheet
from georef.sheets.controls import FloatArray
from tests.fig2mesh.parse import scenes
from tests.georef.sheets import sheets
from tests.georef.sheets.sheets import (
    SIZE,
    SWISS,
    lonlat,
    matrix,
    picture,
    swiss,
    world_file,
)

SPREAD = np.array([[30.0, 25], [370, 30], [380, 280], [25, 270], [200, 150]])
"""Control points of the sheet of 400×300 px."""

HEAD = "mapX,mapY,sourceX,sourceY,enable"


def lines(pixels: FloatArray, coordinates: FloatArray, form: str = "{0},{1},{2},{3},1") -> list[str]:
    return [form.format(*c, x, -y) for (x, y), c in zip(pixels.tolist(), coordinates.tolist(), strict=True)]


def sheet_of(
    folder: Path, rows: list[str], size: tuple[int, int] = SIZE, head: str = HEAD, crs: str = SWISS
) -> MapSheet:
    picture(folder / "map.png", size)
    (folder / "map.points").write_text("\n".join([f"#CRS: {crs}", head, *rows, ""]), encoding="utf-8")
    return read_sheet(folder / "map.png")


def test_the_sheet_as_it_is_needs_no_word(tmp_path: Path) -> None:
    assert sheet_of(tmp_path, lines(SPREAD, swiss(SPREAD))).notes == ()
    corners = np.array([[-1.0, -2], [401, -1], [400, 302], [0, 300]])
    assert sheet_of(tmp_path, lines(corners, swiss(corners))).notes == ()


@pytest.mark.parametrize(("size", "seems"), [((200, 150), "400×300"), ((100, 75), "400×300"), ((133, 100), "399×300")])
def test_a_smaller_version_of_the_picture_is_refused(tmp_path: Path, size: tuple[int, int], seems: str) -> None:
    with pytest.raises(PlacementError, match=r"3 of 5 control|most control points") as caught:
        sheet_of(tmp_path, lines(SPREAD, swiss(SPREAD)), size)
    assert f"as if made for a picture of about {seems} px" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_points_beyond_the_picture_are_reported(tmp_path: Path) -> None:
    sheet = sheet_of(tmp_path, lines(SPREAD, swiss(SPREAD)), (360, 300))
    assert "2 of 5 control points lie outside the sheet of 360×300 px" in sheet.notes[0]
    assert "about 720×600 px" in sheet.notes[0]


def test_a_larger_version_of_the_picture_is_reported(tmp_path: Path) -> None:
    for factor in (2, 4):
        sheet = sheet_of(tmp_path, lines(SPREAD, swiss(SPREAD)), (400 * factor, 300 * factor))
        assert "cover only the upper left 380×280 px of the sheet" in sheet.notes[0]


@pytest.mark.parametrize("size", [(300, 400), (250, 300)])
def test_another_picture_is_reported(tmp_path: Path, size: tuple[int, int]) -> None:
    """A picture turned by 90 degrees, and one of another aspect."""
    sheet = sheet_of(tmp_path, lines(SPREAD, swiss(SPREAD)), size)
    assert "2 of 5 control points lie outside" in sheet.notes[0]


DEGREES = np.array([[8.51, 47.37], [8.55, 47.37], [8.55, 47.40], [8.51, 47.40]])


@pytest.mark.parametrize(
    ("source", "crs", "finding"),
    [
        (DEGREES, "EPSG:4326", "all control points lie within one pixel"),
        ((DEGREES - DEGREES[0]) * 100 + (8, 47), "EPSG:4326", "all control points lie within 4×3 px of a sheet"),
        (DEGREES * (1, -1), "EPSG:4326", "sourceX and sourceY are map coordinates"),
    ],
)
def test_degrees_are_no_pixels(tmp_path: Path, source: FloatArray, crs: str, finding: str) -> None:
    rows = lines(source, DEGREES + 0.005)
    with pytest.raises(PlacementError, match=finding) as caught:
        sheet_of(tmp_path, rows, (1000, 800), crs=crs)
    assert "give pixels of the picture" in str(caught.value)
    if "one pixel" in finding:
        (tmp_path / "map.png").unlink()
        with pytest.raises(PlacementError, match="within one pixel"):
            read_sheet(tmp_path / "map.points")


def test_map_units_are_no_pixels(tmp_path: Path) -> None:
    map_units = swiss(SPREAD)
    rows = [f"{e + 3},{n - 2},{e},{n},1" for e, n in map_units.tolist()]
    (tmp_path / "map.points").write_text("\n".join([f"#CRS: {SWISS}", HEAD, *rows]))
    with pytest.raises(PlacementError, match="sourceX and sourceY are map coordinates"):
        read_sheet(tmp_path / "map.points")
    wide = np.array([[-60.0, -30], [80, -40], [100, 50], [-50, 60]])
    rows = [f"{e + 1},{n + 1},{e},{n},1" for e, n in wide.tolist()]
    (tmp_path / "map.points").write_text("\n".join(["#CRS: EPSG:4326", HEAD, *rows]))
    with pytest.raises(PlacementError, match="sourceX and sourceY are map coordinates"):
        read_sheet(tmp_path / "map.points")


def test_a_map_of_the_world_of_a_pixel_a_degree_is_right(tmp_path: Path) -> None:
    pixels = np.array([[10.0, 10], [350, 10], [350, 170], [10, 170], [180, 90]])
    places = np.stack([pixels[:, 0] - 180, 90 - pixels[:, 1]], axis=1)
    sheet = sheet_of(tmp_path, lines(pixels, places), (360, 180), crs="EPSG:4326")
    assert sheet.lonlat(np.array([[200.0, 60.0]])) == pytest.approx(np.array([[20.0, 30.0]]), abs=1e-6)
    assert sheet.notes == ()


PROBE = np.array([[123.5, 210.0]])

FORMS = {
    "semicolons and decimal commas": (";", "{0};{1};{2};{3};1", True, HEAD.replace(",", ";")),
    "tabs and decimal commas": ("\t", "{0}\t{1}\t{2}\t{3}\t1", True, HEAD.replace(",", "\t")),
    "quoted decimal commas": (",", '"{0}","{1}","{2}","{3}","1"', True, HEAD),
    "thousands": (";", "{0};{1};{2};{3};1", "thousands", HEAD.replace(",", ";")),
    "WKT of a point": (",", "{0},{1},{2},{3},1,0,0,0,POINT (1, 2)", False, HEAD + ",dX,dY,residual,wkt"),
    "WKT first": (",", '"POINT (1 2)",{0},{1},{2},{3},1', False, "WKT," + HEAD),
    "WKT of the reference system behind the headings": (
        ",", '{0},{1},{2},{3},1,0,0,0,PROJCS["CH1903+ / LV95",GEOGCS["CH1903+",DATUM["x"]]]', False,
        HEAD + ",dX,dY,residual",
    ),
    "a comma behind": (",", "{0},{1},{2},{3},1,", False, HEAD),
    "headings with blanks and case": (",", "{0},{1},{2},{3},1", False, "MapX , MapY,Source_X,Source_Y, Enabled"),
    "other columns between": (",", "7,{2},{3},x,{0},{1}", False, "id,pixelX,pixelY,name,mapX,mapY"),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("encoding", "newline"), [("utf-8-sig", "\r\n"), ("utf-8", "\r")])
def test_points_as_programs_write_them(tmp_path: Path, form: str, encoding: str, newline: str) -> None:
    _, row, commas, head = FORMS[form]
    rows = []
    for (x, y), (e, n) in zip(SPREAD.tolist(), swiss(SPREAD).tolist(), strict=True):
        numbers = [f"{value:.6f}" for value in (e, n, x, -y)]
        if commas == "thousands":
            numbers = [f"{value:,.6f}".replace(",", "'").replace(".", ",") for value in (e, n, x, -y)]
        elif commas:
            numbers = [number.replace(".", ",") for number in numbers]
        rows.append(row.format(*numbers))
    text = newline.join([f"#CRS: {SWISS}", "# set by hand", head, *rows, "", ""])
    (tmp_path / "map.points").write_bytes(text.encode(encoding))
    sheet = read_sheet(tmp_path / "map.points")
    assert len(sheet.pixels) == 5
    assert sheet.lonlat(PROBE) == pytest.approx(lonlat(swiss(PROBE)), abs=1e-9)


@pytest.mark.parametrize("word", ["0", "0.0", "false", "False", "no", ""])
def test_disabled_points_of_all_kinds(tmp_path: Path, word: str) -> None:
    rows = [*lines(SPREAD, swiss(SPREAD)), f"0,0,5,-5,{word}"]
    sheet = sheet_of(tmp_path, rows)
    assert len(sheet.pixels) == 5
    assert "1 control points are disabled" in sheet.notes[0]


def given(folder: Path, affine: FloatArray, crs: str = SWISS, size: tuple[int, int] = SIZE) -> MapSheet:
    picture(folder / "map.png", size)
    world_file(folder / "map.pgw", affine)
    (folder / "map.prj").write_text(crs)
    return read_sheet(folder / "map.png")


def test_sheets_outside_the_area_of_their_reference_system_are_reported(tmp_path: Path) -> None:
    assert given(tmp_path, matrix()).notes == ()
    shifted = matrix() + [[0, 0, 700_000], [0, 0, 0]]
    assert "km outside the area of CH1903+ / LV95" in given(tmp_path, shifted).notes[0]
    old = matrix() - [[0, 0, 2_000_000], [0, 0, 1_000_000]]  # of LV03, under the name of LV95
    with_old = given(tmp_path, old)
    assert "outside the area" in with_old.notes[0]
    (tmp_path / "map.pgw").unlink()
    far = sheet_of(tmp_path, lines(SPREAD, swiss(SPREAD) + (0, 500_000)))
    assert "km outside the area" in far.notes[0]


@pytest.mark.parametrize("which", ["map axes", "pixel axes", "rows counted from below", "longitude and latitude"])
def test_mirrored_and_swapped_points_are_refused_or_reported(tmp_path: Path, which: str) -> None:
    pixels, coordinates, crs = SPREAD, swiss(SPREAD), SWISS
    if which == "map axes":
        coordinates = coordinates[:, ::-1]
    elif which == "pixel axes":
        pixels = pixels[:, ::-1]
    elif which == "rows counted from below":
        pixels = pixels * (1, -1) + (0, SIZE[1])
    else:
        coordinates, crs = lonlat(coordinates)[:, ::-1], "EPSG:4326"
    try:
        sheet = sheet_of(tmp_path, lines(pixels, coordinates), crs=crs)
        notes = (*sheet.notes, *sheet.place(200, 150).notes)
    except PlacementError:
        return
    assert any("mirrored" in note or "outside the area" in note for note in notes)


def test_stretched_maps_are_reported(tmp_path: Path) -> None:
    assert given(tmp_path, matrix()).place(200, 150).notes == ()
    notes = given(tmp_path, matrix() * [[2, 1, 1], [2, 1, 1]]).place(200, 150).notes
    assert "the map is stretched 2 times" in notes[0]


def test_the_size_in_exif_data(tmp_path: Path) -> None:
    made = Image.Exif()
    made.get_ifd(0x8769)[40962], made.get_ifd(0x8769)[40963] = 800, 600
    Image.new("L", SIZE).save(tmp_path / "map.jpg", exif=made)
    world_file(tmp_path / "map.jgw")
    notes = read_sheet(tmp_path / "map.jpg", map_crs=SWISS).notes
    assert "its EXIF data are of a picture of 800×600 px, it has 400×300 px" in notes[0]
    made.get_ifd(0x8769)[40962], made.get_ifd(0x8769)[40963] = 401, 300
    Image.new("L", SIZE).save(tmp_path / "map.jpg", exif=made)
    assert read_sheet(tmp_path / "map.jpg", map_crs=SWISS).notes == ()


def test_overviews_of_another_size(tmp_path: Path) -> None:
    given(tmp_path, matrix())
    (tmp_path / "map.png.ovr").write_bytes(scenes.tiff(np.zeros((150, 200), np.uint8), subfiletype=1))
    assert read_sheet(tmp_path / "map.png").notes == ()
    (tmp_path / "map.png.ovr").write_bytes(scenes.tiff(np.zeros((300, 400), np.uint8), subfiletype=1))
    assert "400×300 px is no overview of a picture of 400×300 px" in read_sheet(tmp_path / "map.png").notes[0]


def test_auxiliary_files_that_contradict(tmp_path: Path) -> None:
    given(tmp_path, matrix())
    (a, b, c), (d, e, f) = matrix().tolist()
    aux = tmp_path / "map.png.aux.xml"
    aux.write_text(f"<PAMDataset><GeoTransform> {c!r}, {a!r}, {b!r}, {f!r}, {d!r}, {e!r}</GeoTransform></PAMDataset>")
    assert read_sheet(tmp_path / "map.png").notes == ()
    aux.write_text(
        f"<PAMDataset><GeoTransform> {c!r}, {2 * a!r}, {b!r}, {f!r}, {d!r}, {2 * e!r}</GeoTransform></PAMDataset>"
    )
    assert "its GeoTransform is another map than the one used" in read_sheet(tmp_path / "map.png").notes[0]


def test_an_annotation_on_a_picture_of_unknown_size(tmp_path: Path) -> None:
    made = sheets.annotation(SPREAD * 2, lonlat(swiss(SPREAD)))
    made["target"] = "https://example.org/picture"
    (tmp_path / "map.json").write_text(json.dumps(made))
    picture(tmp_path / "map.png")
    with pytest.raises(PlacementError, match="control points lie outside the sheet of 400×300 px"):
        read_sheet(tmp_path / "map.png")
    del made["target"]
    sheets.annotation_file(tmp_path / "map.json", SPREAD * 2, lonlat(swiss(SPREAD)), (800, 600))
    spot = read_sheet(tmp_path / "map.png")
    assert spot.lonlat(PROBE) == pytest.approx(lonlat(swiss(PROBE)), abs=2e-8)


@pytest.mark.parametrize("way", [way for way in scenes.ORIENTED if way != "avif"])
@pytest.mark.parametrize("orientation", [3, 6])
def test_a_turned_sheet_is_refused_wherever_it_says_so(tmp_path: Path, way: str, orientation: int) -> None:
    sheet = scenes.write(tmp_path, way, scenes.ORIENTED[way](scenes.scene(), orientation))
    world_file(sheet.with_suffix(".wld"))
    with pytest.raises(PlacementError, match="rotated by its EXIF orientation; save it upright"):
        read_sheet(sheet, map_crs=SWISS)


def test_the_sheet_is_the_page_that_figures_are_read_from(tmp_path: Path) -> None:
    for way in ("tiff thumbnail first", "tiff picture below its thumbnail", "tiff overviews behind"):
        sheet = scenes.write(tmp_path, way, scenes.WAYS[way](scenes.scene()))
        world_file(sheet.with_suffix(".wld"))
        assert read_sheet(sheet, map_crs=SWISS).size == (48, 36)
