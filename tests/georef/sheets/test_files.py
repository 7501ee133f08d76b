"""Every form of georeference gives the same places; what is damaged or unclear is refused in one line."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pyproj
import pytest
import rasterio
import tifffile
from PIL import Image
from rasterio.control import GroundControlPoint
from rasterio.transform import Affine

from georef.errors import PlacementError
from georef.mapsheet import read_sheet
from georef.sheets.controls import FloatArray
from tests.georef.sheets import sheets
from tests.georef.sheets.sheets import SIZE, SWISS, controls, lonlat, matrix, picture, points_file, swiss, world_file

PROBE = np.array([[0.0, 0.0], [200, 150], [399.5, 0.5], [17.25, 260.75]])

DEG = 1e-9
"""0.1 mm."""


def at_home(sheet: Path, **options: str) -> FloatArray:
    return read_sheet(sheet, **options).lonlat(PROBE)


def expected() -> FloatArray:
    return lonlat(swiss(PROBE))


@pytest.mark.parametrize("name", ["map.pgw", "map.PGW", "map.pngw", "map.wld", "map.png.wld"])
def test_world_files_beside_a_picture(tmp_path: Path, name: str) -> None:
    picture(tmp_path / "map.png")
    world_file(tmp_path / name)
    (tmp_path / "map.prj").write_text(pyproj.CRS(SWISS).to_wkt("WKT1_ESRI"))
    assert at_home(tmp_path / "map.png") == pytest.approx(expected(), abs=DEG)
    assert at_home(tmp_path / name) == pytest.approx(expected(), abs=DEG)


def test_gdal_reads_world_files_alike(tmp_path: Path) -> None:
    sheet = picture(tmp_path / "map.png")
    world_file(tmp_path / "map.pgw")
    with rasterio.open(sheet) as file:
        east, north = file.transform @ PROBE.T
    there = lonlat(np.stack([east, north], axis=1))
    assert at_home(sheet, map_crs=SWISS) == pytest.approx(there, abs=DEG)


def test_the_reference_system_may_be_an_option(tmp_path: Path) -> None:
    sheet = picture(tmp_path / "map.jpg")
    world_file(tmp_path / "map.jgw", comma=True)
    with pytest.raises(PlacementError, match=r"no reference system in the file or in a \.prj file; give --map-crs"):
        read_sheet(sheet)
    assert at_home(sheet, map_crs=SWISS) == pytest.approx(expected(), abs=DEG)
    with pytest.raises(PlacementError, match="'EPSG:999999' is not a reference system"):
        read_sheet(sheet, map_crs="EPSG:999999")
    with pytest.raises(PlacementError, match="on the earth"):
        read_sheet(sheet, map_crs="EPSG:4978")


def test_overriding_the_reference_system_of_the_file_is_reported(tmp_path: Path) -> None:
    picture(tmp_path / "map.png")
    world_file(tmp_path / "map.pgw")
    (tmp_path / "map.prj").write_text(pyproj.CRS("EPSG:21781").to_wkt("WKT1_ESRI"))
    sheet = read_sheet(tmp_path / "map.png", map_crs=SWISS)
    assert "reference system CH1903 / LV03 is overridden by --map-crs" in sheet.notes[0]
    assert sheet.lonlat(PROBE) == pytest.approx(expected(), abs=DEG)


def test_a_system_that_nobody_knows_can_be_overridden(tmp_path: Path) -> None:
    picture(tmp_path / "map.png")
    world_file(tmp_path / "map.pgw")
    (tmp_path / "map.prj").write_text('PROJCS["Feuille 7"')
    with pytest.raises(PlacementError, match="is not a reference system"):
        read_sheet(tmp_path / "map.png")
    assert at_home(tmp_path / "map.png", map_crs=SWISS) == pytest.approx(expected(), abs=DEG)


def test_metres_under_the_name_of_degrees_can_be_overridden(tmp_path: Path) -> None:
    path = points_file(tmp_path / "map.points", controls(), swiss(controls()), "EPSG:4326")
    with pytest.raises(PlacementError, match="is outside the area of WGS 84"):
        read_sheet(path)
    assert at_home(path, map_crs=SWISS) == pytest.approx(expected(), abs=DEG)


def write_geotiff(path: Path, transform: FloatArray | None = None, point: bool = False, **more: object) -> Path:
    """Read with GDAL, whose transforms refer to pixel corners in any case."""
    if transform is not None:
        more["transform"] = Affine(*transform.ravel())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(
            path, "w", driver="GTiff", width=SIZE[0], height=SIZE[1], count=1, dtype="uint8", crs=SWISS, **more
        ) as file:
            if point:
                file.update_tags(AREA_OR_POINT="Point")
    return path


@pytest.mark.parametrize("point", [False, True])
def test_geotiffs_of_gdal(tmp_path: Path, point: bool) -> None:
    turned = write_geotiff(tmp_path / "turned.tif", matrix(), point)
    assert at_home(turned) == pytest.approx(expected(), abs=DEG)
    upright = np.array([[5.0, 0, 2_683_000], [0, -5.0, 1_247_000]])
    plain = write_geotiff(tmp_path / "plain.tif", upright, point)
    assert at_home(plain) == pytest.approx(lonlat(PROBE @ upright[:, :2].T + upright[:, 2]), abs=DEG)
    tags = {tag for tag in (33550, 33922, 34264) if tag in tifffile.TiffFile(plain).pages[0].tags}
    assert tags == {33550, 33922}, "the upright one is scale and tiepoint, the turned one a matrix"
    assert 34264 in tifffile.TiffFile(turned).pages[0].tags


@pytest.mark.parametrize("point", [False, True])
def test_control_points_in_geotiffs(tmp_path: Path, point: bool) -> None:
    pixels = controls()
    points = [
        GroundControlPoint(row=p[1], col=p[0], x=q[0], y=q[1]) for p, q in zip(pixels, swiss(pixels), strict=True)
    ]
    path = write_geotiff(tmp_path / "gcps.tif", point=point, gcps=points)
    sheet = read_sheet(path)
    assert sheet.method == "affine"
    with rasterio.open(path) as file:
        # GDAL 3.10 adds half a pixel to points when it writes and again when it reads; the file means what GDAL reads.
        read = np.array([(each.col, each.row) for each in file.gcps[0]])
    assert sheet.pixels == pytest.approx(read)
    assert sheet.lonlat(PROBE + read[0] - pixels[0]) == pytest.approx(expected(), abs=DEG)


def test_a_big_tiff_is_read_without_its_pixels(tmp_path: Path) -> None:
    """100,000 x 100,000 pixels that are not even there."""
    keys = (1, 1, 0, 2, 1025, 0, 1, 1, 3072, 0, 1, 2056)
    scale, tie = (5.0, 5.0, 0.0), (0.0, 0.0, 0.0, 2_600_000.0, 1_250_000.0, 0.0)
    tags = [(33550, "d", 3, scale, True), (33922, "d", 6, tie, True), (34735, "H", len(keys), keys, True)]
    path = tmp_path / "big.tif"
    tifffile.imwrite(path, np.zeros((1, 1), np.uint8), bigtiff=True, extratags=tags)
    with tifffile.TiffFile(path, mode="r+b") as file:
        file.pages[0].tags["ImageWidth"].overwrite(100_000)
        file.pages[0].tags["ImageLength"].overwrite(100_000)
    sheet = read_sheet(path)
    assert sheet.size == (100_000, 100_000)
    there = lonlat(np.array([[2_600_000 + 5 * 80_000, 1_250_000 - 5 * 20_000]]))
    assert sheet.lonlat(np.array([[80_000, 20_000]])) == pytest.approx(there, abs=DEG)


def test_a_world_file_that_repeats_the_tags_is_no_second_opinion(tmp_path: Path) -> None:
    sheet = write_geotiff(tmp_path / "map.tif", matrix())
    world_file(tmp_path / "map.tfw")
    assert at_home(sheet) == pytest.approx(expected(), abs=DEG)
    world_file(tmp_path / "map.tfw", matrix() + [[0, 0, 50], [0, 0, 0]])
    with pytest.raises(PlacementError, match=r"ambiguous georeference: its tags and map\.tfw; give the one to use"):
        read_sheet(sheet)
    moved = read_sheet(tmp_path / "map.tfw")
    assert moved.crs == "CH1903+ / LV95", "the tags still name the reference system"
    assert moved.lonlat(PROBE) == pytest.approx(lonlat(swiss(PROBE) + (50, 0)), abs=DEG)


@pytest.mark.parametrize("name", ["map.points", "map.png.points"])
def test_points_of_qgis(tmp_path: Path, name: str) -> None:
    picture(tmp_path / "map.png")
    points_file(tmp_path / name, controls(), swiss(controls()))
    assert at_home(tmp_path / "map.png") == pytest.approx(expected(), abs=DEG)
    assert read_sheet(tmp_path / name).picture == tmp_path / "map.png"


VERSIONS = {
    "2.0": ("mapX,mapY,pixelX,pixelY,enable", "{e},{n},{x},{up},1", ","),
    "3.4": ("mapX,mapY,pixelX,pixelY,enable,dX,dY,residual", "{e},{n},{x},{up},1,0.1,-0.2,0.22", ","),
    "tabs": ("mapX\tmapY\tpixelX\tpixelY", "{e}\t{n}\t{x}\t{up}", "\t"),
    "quoted": ('"mapX","mapY","pixelX","pixelY","enable"', '"{e}","{n}","{x}","{up}","1"', ","),
    "downwards": ("mapX,mapY,pixelX,pixelY,enable", "{e},{n},{x},{down},1", ","),
}


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("encoding", "newline"), [("utf-8", "\n"), ("utf-8-sig", "\r\n"), ("utf-16", "\n")])
def test_points_of_all_times(tmp_path: Path, version: str, encoding: str, newline: str) -> None:
    head, form, _ = VERSIONS[version]
    rows = [
        form.format(e=e, n=n, x=x, up=-y, down=y)
        for (x, y), (e, n) in zip(controls().tolist(), swiss(controls()).tolist(), strict=True)
    ]
    path = tmp_path / "map.points"
    path.write_bytes(newline.join([head, *rows, ""]).encode(encoding))
    assert at_home(path, map_crs=SWISS) == pytest.approx(expected(), abs=DEG)


def test_points_switched_off_are_left_out(tmp_path: Path) -> None:
    path = points_file(tmp_path / "map.points", controls(), swiss(controls()))
    lines = path.read_text().splitlines()
    wrong = lines[4].split(",")
    path.write_text("\n".join([*lines[:4], ",".join(["0", "0", *wrong[2:4], "0", "0,0,0"]), *lines[5:]]))
    sheet = read_sheet(path)
    assert len(sheet.pixels) == 8
    assert "1 control points are disabled" in sheet.notes[0]
    assert sheet.lonlat(PROBE) == pytest.approx(expected(), abs=DEG)


def test_duplicate_points_count_once(tmp_path: Path) -> None:
    twice = np.concatenate([controls(), controls()[:4]])
    sheet = read_sheet(points_file(tmp_path / "map.points", twice, swiss(twice)), transform="tps")
    assert len(sheet.pixels) == 9


@pytest.mark.parametrize("wrap", ["annotation", "page", "list", "pixelCoords", "string source"])
def test_annotations(tmp_path: Path, wrap: str) -> None:
    made = sheets.annotation(controls(), lonlat(swiss(controls())))
    document: object = made
    if wrap == "page":
        other = {"type": "Annotation", "motivation": "commenting", "body": {"type": "TextualBody"}}
        document = {"type": "AnnotationPage", "items": [other, made]}
    elif wrap == "list":
        document = [made]
    elif wrap == "pixelCoords":
        document = json.loads(json.dumps(made).replace("resourceCoords", "pixelCoords"))
    elif wrap == "string source":
        svg = '<svg width="400" height="300"><polygon points="0,0 400,0 400,300" /></svg>'
        made["target"] = {"source": "urn:x", "selector": {"type": "SvgSelector", "value": svg}}
    picture(tmp_path / "map.png")
    (tmp_path / "map.json").write_text(json.dumps(document))
    # The grid's own plane is not the one that is fitted in: over 2 km they differ by a millimetre, 1e-8 degrees.
    assert at_home(tmp_path / "map.png") == pytest.approx(expected(), abs=2e-8)
    assert at_home(tmp_path / "map.png", map_crs=SWISS) == pytest.approx(expected(), abs=DEG)


def test_an_annotation_is_rescaled_to_the_picture_at_hand(tmp_path: Path) -> None:
    large = 4 * controls() + 0.0
    sheets.annotation_file(tmp_path / "map.json", large, lonlat(swiss(controls())), (1601, 1199))
    picture(tmp_path / "map.png")
    found = at_home(tmp_path / "map.png")
    assert found == pytest.approx(expected(), abs=5e-5), "its sides were rounded, so by a pixel"
    Image.new("L", (400, 200)).save(tmp_path / "map.png")
    with pytest.raises(PlacementError, match="made for a picture of 1601×1199 px, but the sheet has 400×200 px"):
        read_sheet(tmp_path / "map.png")


def test_the_transformation_an_annotation_asks_for(tmp_path: Path) -> None:
    def method(transformation: object, **options: str) -> tuple[str, tuple[str, ...]]:
        made = sheets.annotation(controls(12), lonlat(swiss(controls(12))), transformation=transformation)
        (tmp_path / "map.json").write_text(json.dumps(made))
        sheet = read_sheet(tmp_path / "map.json", **options)
        return sheet.method, sheet.notes

    assert method({"type": "polynomial", "options": {"order": 2}})[0] == "poly2"
    assert method({"type": "polynomial"})[0] == "poly1"
    assert method({"type": "thinPlateSpline"})[0] == "tps"
    assert method({"type": "thinPlateSpline"}, transform="poly3")[0] == "poly3"
    assert method(None)[0] == "affine"
    unknown = method({"type": "rubberSheet"})
    assert unknown[0] == "affine"
    assert "unknown transformation rubberSheet; affine is used" in unknown[1][0]


def test_a_real_annotation(tmp_path: Path) -> None:
    """The plan of the Paris exposition, see data/README.md."""
    path = Path(__file__).parent / "data" / "paris.json"
    sheet = read_sheet(path)
    assert (sheet.method, sheet.size, len(sheet.pixels)) == ("poly1", (4708.0, 1860.0), 4)
    assert sheet.quality is not None
    assert sheet.quality.degrees_of_freedom == 2
    assert 1 < sheet.quality.rmse_m < 10
    # Its second last point is the Champ de Mars side of the Eiffel Tower's neighbourhood: within its residual.
    tower = sheet.place(1892, 773)
    assert (tower.lon_deg, tower.lat_deg) == pytest.approx((2.2945164, 48.8590133), abs=1e-4)
    # The plan has the Seine's axis upright: its "up" is north-east.
    assert 40 < tower.up_bearing_deg < 50
    assert 0.3 < tower.up_m < 0.4
    # A derivative of a quarter of the size, as IIIF servers give it.
    (tmp_path / "plan.json").write_text(path.read_text())
    picture(tmp_path / "plan.png", (1177, 465))
    small = read_sheet(tmp_path / "plan.png").place(1892 / 4, 773 / 4)
    assert (small.lon_deg, small.lat_deg) == pytest.approx((tower.lon_deg, tower.lat_deg), abs=1e-9)
    assert small.up_m == pytest.approx(4 * tower.up_m, rel=1e-9)


def test_the_projection_of_allmaps(tmp_path: Path) -> None:
    """`resourceCrs` with the values of a map of Europe in Bonne's projection (Allmaps' own test data, MIT)."""
    pixels = np.array([[5645.0, 2302], [6753, 5804], [1785, 4343]])
    places = np.array([[30.3088374, 59.9265149], [34.5756332, 35.6739821], [-9.288174, 43.0615478]])
    bonne = "+proj=bonne +lat_1=60 +lon_0=0 +x_0=0 +y_0=0 +R=6371000 +units=m +no_defs +type=crs"
    made = sheets.annotation(pixels, places, (9147, 6661), resourceCrs={"name": "Bonne", "definition": bonne})
    (tmp_path / "europe.json").write_text(json.dumps(made))
    sheet = read_sheet(tmp_path / "europe.json")
    project = pyproj.Proj(bonne)
    middle = project(*np.mean(project(*places.T), axis=1), inverse=True)
    assert sheet.lonlat(pixels.mean(axis=0))[0] == pytest.approx(middle, abs=1e-7)


HOSTILE = {
    "map.points": {
        "": "the file is empty",
        " \r\n ": "the file is empty",
        "#CRS: EPSG:2056\n": "no header line",
        "mapX,mapY,pixelX,pixelY,enable\n": "no control points",
        "mapX,mapY,pixelX,pixelY,enable\n1,2,3,-4,0\n": "no control points",
        "a,b,c\n1,2,3\n": "unexpected header 'a,b,c'",
        "mapX,mapY,pixelX,pixelY\n1,2,3\n": "line 2 is '1,2,3', not four numbers; give four numbers",
        "mapX,mapY,pixelX,pixelY\n1,2,x,4\n": "line 2 is",
        "mapX,mapY,pixelX,pixelY\n1,5,2,5,3,5,-4,5\n": "line 2 has 8 values for 4 columns; .* decimal point",
        "mapX,mapY,pixelX,pixelY\nnan,2,3,-4\n": r"control point 1 is \[3.0, 4.0, nan, 2.0\]",
        "mapX,mapY,pixelX,pixelY\n1,inf,3,-4\n": "give finite numbers",
        "mapX,mapY,pixelX,pixelY\n1,2,3,-4\n": "1 control point, but affine needs 3; add points",
        "mapX,mapY,pixelX,pixelY\n1,2,3,-4\n1,2,3,-4\n1,2,3,-4\n": "1 control point, but",
        "mapX,mapY,pixelX,pixelY\n" + "1,2,3,-4\n" * 10_001: "10001 control points; give at most 10000",
    },
    "map.json": {
        "": "the file is empty",
        "{": "not JSON",
        "[" * 100_000: "nested too deeply",
        "{}": "no georeference annotations",
        '{"type":"Annotation","body":{"type":"FeatureCollection"}}': "no features",
        '{"body":{"type":"FeatureCollection","features":[{}]}}': "feature 1 has no resourceCoords",
        '{"body":{"type":"FeatureCollection","features":[{"properties":{"resourceCoords":[1,true]}}]}}': "feature 1",
        '{"body":{"type":"FeatureCollection","features":[{"properties":{"resourceCoords":[1,2]},'
        '"geometry":{"type":"Line","coordinates":[1,2]}}]}}': "feature 1 has no Point",
        '{"body":{"type":"FeatureCollection","features":[{"properties":{"resourceCoords":[1,2]},'
        '"geometry":{"type":"Point","coordinates":[47,188]}}]}}': "longitude first",
        '{"body":{"type":"FeatureCollection","features":[{"properties":{"resourceCoords":[NaN,2]},'
        '"geometry":{"type":"Point","coordinates":[47,8]}}]}}': "NaN is not a number",
    },
    "map.pgw": {
        "": "the file is empty",
        "1 2 3": "3 numbers; give a world file of six",
        "1 0 0 -1 north 5": "'north' is not a number",
        "1 0 0 nan 3 5": "not finite",
        "0 0 0 0 3 5": "its map is singular",
        "1 2 2 4 3 5": "its map is singular",
    },
}


@pytest.mark.parametrize(("name", "text", "finding"), [(n, t, f) for n in HOSTILE for t, f in HOSTILE[n].items()])
def test_hostile_files(tmp_path: Path, name: str, text: str, finding: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(PlacementError, match=finding) as caught:
        read_sheet(tmp_path / name, map_crs=SWISS, transform="auto")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("suffix", [".points", ".json", ".pgw", ".png", ".tif", ".jpg"])
@pytest.mark.parametrize(
    "content", [b"\x00\x01\x02" * 999, b"\xff\xfe\x00", b"II*\x00\xff\xff\xff\xff", b"\x89PNG\r\n\x1a\n"]
)
def test_binary_nonsense(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"map{suffix}"
    path.write_bytes(content)
    with pytest.raises(PlacementError, match="map"):
        read_sheet(path, map_crs=SWISS)


def test_a_million_points_are_no_list_of_control_points(tmp_path: Path) -> None:
    path = tmp_path / "map.points"
    path.write_text("mapX,mapY,pixelX,pixelY\n" + "2683000.5,1247000.5,100.25,-200.75\n" * 1_000_000)
    with pytest.raises(PlacementError, match="35 MB, more than the limit of 8 MB"):
        read_sheet(path)


def test_latin_1_and_names_in_the_wrong_encoding(tmp_path: Path) -> None:
    path = points_file(tmp_path / "map.points", controls(), swiss(controls()))
    path.write_bytes("# Zürich, gezählt von Jürg\n".encode("latin-1") + path.read_bytes())
    assert at_home(path) == pytest.approx(expected(), abs=DEG)


def test_what_is_missing_or_ambiguous_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(PlacementError, match=r"--map .*nowhere\.png: no such file"):
        read_sheet(tmp_path / "nowhere.png")
    sheet = picture(tmp_path / "map.png")
    (tmp_path / "map.json").write_text('{"width": 1, "height": 2, "keypoints": {}}')
    with pytest.raises(
        PlacementError, match=r"no georeference in its tags or next to it; add one of map\.pgw, map\.\.?pngw"
    ):
        read_sheet(sheet)
    world_file(tmp_path / "map.pgw")
    points_file(tmp_path / "map.points", controls(), swiss(controls()))
    with pytest.raises(PlacementError, match=r"ambiguous georeference: map\.pgw and map\.points; give the one"):
        read_sheet(sheet)
    picture(tmp_path / "map.jpg")
    with pytest.raises(PlacementError, match=r"ambiguous picture: map\.png and map\.jpg"):
        read_sheet(tmp_path / "map.points")
    (tmp_path / "map.txt").write_text("x")
    with pytest.raises(PlacementError, match=r"unknown suffix '.txt'"):
        read_sheet(tmp_path / "map.txt")
    both = {"type": "AnnotationPage", "items": [sheets.annotation(controls(), lonlat(swiss(controls())))] * 2}
    (tmp_path / "two.json").write_text(json.dumps(both))
    with pytest.raises(PlacementError, match="2 georeference annotations; save the one of this map"):
        read_sheet(tmp_path / "two.json")


def test_points_of_another_picture_are_refused(tmp_path: Path) -> None:
    picture(tmp_path / "map.png")
    points_file(tmp_path / "map.points", controls() + 5000, swiss(controls()))
    with pytest.raises(PlacementError, match="most control points lie far outside the sheet of 400×300 px"):
        read_sheet(tmp_path / "map.png")


def test_a_turned_picture_is_refused(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[274] = 6
    Image.new("L", SIZE).save(tmp_path / "map.jpg", exif=exif)
    world_file(tmp_path / "map.jgw")
    with pytest.raises(PlacementError, match="rotated by its EXIF orientation"):
        read_sheet(tmp_path / "map.jpg", map_crs=SWISS)


def test_a_given_map_is_not_fitted(tmp_path: Path) -> None:
    world_file(tmp_path / "map.pgw")
    with pytest.raises(PlacementError, match=r"--map-transform tps: map\.pgw gives the affine map itself"):
        read_sheet(tmp_path / "map.pgw", map_crs=SWISS, transform="tps")
