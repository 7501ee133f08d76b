"""Tables as pandas, GDAL, PostGIS and spreadsheets write them: read as meant, or refused with what to write."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import pyproj
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fig2mesh.batch.collections.read import read_rows
from fig2mesh.batch.collections.rows import Row
from fig2mesh.batch.collections.wkt import wkt_point
from fig2mesh.batch.columns import request_of
from fig2mesh.batch.resolved_row import ResolvedRow
from fig2mesh.conversion.cells import NotNumber, number_of, whole_number_of
from fig2mesh.errors import InputError
from tests.fig2mesh.batch.small import batch_of, task_of


def _read(folder: Path, text: str | bytes, name: str = "t.csv") -> list[Row]:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return list(read_rows(path))


@pytest.mark.parametrize(
    "text",
    [
        ",figure,lon\n0,a.png,8.5\n1,b.png,8.5\n",
        "Unnamed: 0,figure,lon\n0,a.png,8.5\n7,b.png,8.5\n",
        ",Unnamed: 0,figure,lon\n0,0,a.png,8.5\n1,1,b.png,8.5\n",
        "Unnamed: 0.1,Unnamed: 0,figure,lon\n0,0.0,a.png,8.5\n1,1.0,b.png,8.5\n",
        '"","figure","lon"\n"1","a.png","8.5"\n"2","b.png","8.5"\n',
        "figure,lon,Unnamed: 2\na.png,8.5,\nb.png,8.5,\n",
        "\tfigure\tlon\n0\ta.png\t8.5\n1\tb.png\t8.5\n",
    ],
)
def test_row_numbers_without_a_heading_are_left_out(tmp_path: Path, text: str) -> None:
    rows = _read(tmp_path, text)
    assert [row.problem for row in rows] == [None, None]
    assert [dict(row.values) for row in rows] == [{"figure": name, "lon": 8.5} for name in ("a.png", "b.png")]


@pytest.mark.parametrize("text", [",figure\nAnna,a.png\n", "figure,Unnamed: 1\na.png,5\n", "figure,,b\na.png,3,4\n"])
def test_other_values_without_a_heading_are_refused(tmp_path: Path, text: str) -> None:
    (row,) = _read(tmp_path, text)
    assert str(row.problem).endswith("under an empty heading; name the column")


def test_row_numbers_of_features_are_left_out(tmp_path: Path) -> None:
    feature = {"type": "Feature", "geometry": None, "properties": {"Unnamed: 0": 3, "figure": "a.png"}}
    (row,) = _read(tmp_path, json.dumps({"type": "FeatureCollection", "features": [feature]}), "t.geojson")
    assert (row.problem, dict(row.values)) == (None, {"figure": "a.png"})


@pytest.mark.parametrize("empty", ["", "nan", "NaN", "None", "NULL", "<NA>", "NaT", r"\N", "null", " nan "])
def test_what_programs_write_for_nothing_is_nothing(tmp_path: Path, empty: str) -> None:
    (row,) = _read(tmp_path, f"figure,lon,seed,note\na.png,{empty},{empty},{empty}\n")
    assert (row.problem, dict(row.values)) == (None, {"figure": "a.png"})


def test_words_that_mean_something_stay(tmp_path: Path) -> None:
    (row,) = _read(tmp_path, "figure,name,country,effect,lon\na.png,Null,NA,none,NA\n")
    assert dict(row.values) == {"figure": "a.png", "name": "Null", "country": "NA", "effect": "none"}


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        ("5000.0", 5000),
        ("5000.", 5000),
        ("5e3", 5000),
        ("1.5E+04", 15000),
        (" 800 ", 800),
        (5000.0, 5000),
        ("+700", 700),
    ],
)
def test_whole_numbers_of_any_writing(raw: Any, expected: int) -> None:
    assert request_of({"figure": "a.png", "triangles": raw}, {}, "n").triangles == expected


@pytest.mark.parametrize(
    ("column", "raw", "message"),
    [
        ("triangles", "5,000", "column triangles: '5,000' has a comma; write a decimal point"),
        ("triangles", "5'000", 'column triangles: "5\'000" has separators of thousands; write 5000'),
        ("triangles", "5\u202f000", "has separators of thousands; write 5000"),
        ("triangles", "5.000", "column triangles: '5.000' may be 5 or 5000; write it without a point"),
        ("triangles", "5000.5", "column triangles: '5000.5' is not a whole number; give a whole number"),
        ("height_m", "1,79", "column height_m: '1,79' has a comma; write a decimal point"),
        ("height_m", "1.234,5", "has separators of thousands; write 1234.5"),
        ("height_m", "1,234.5", "has separators of thousands; write 1234.5"),
        ("height_m", "12 345 678", "has separators of thousands; write 12345678"),
        ("height_m", "1.79 m", "'1.79 m' has a unit; write the number alone, 1.79, in the unit of the column"),
        ("height_m", "6ft", "'6ft' has a unit; write the number alone, 6, in the unit of the column"),
        ("height_m", "nan", "'nan' is not a number; give a number with a decimal point"),
        ("height_m", "1_000", "'1_000' is not a number; give a number with a decimal point"),
        ("force", "jein", "column force: 'jein' is not a truth value; give true or false"),
    ],
)
def test_numbers_that_would_be_guessed_are_refused_by_what_to_write(column: str, raw: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        request_of({"figure": "a.png", column: raw}, {}, "n")
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"column {column}: ")


@pytest.mark.parametrize(
    ("raw", "expected"),
    [("True", True), ("FALSE", False), ("WAHR", True), ("falsch", False), ("VRAI", True), ("FAUX", False), ("y", True)]
    + [("FALSO", False), ("Vero", True), (1.0, True), ("0.0", False), ("Off", False), ("T", True)],
)
def test_truth_values_of_spreadsheets(raw: Any, expected: bool) -> None:
    assert request_of({"figure": "a.png", "force": raw}, {}, "n").force is expected


@pytest.mark.parametrize(
    ("raw", "expected"),
    [("1893.0", "1893"), (1893.0, "1893"), (1893, "1893"), (" 1893 ", "1893"), ("1893-05-17", "1893-05-17")],
)
def test_years_that_tables_keep_as_numbers(raw: Any, expected: str) -> None:
    assert task_of({"figure": "a.png", "date": raw}).date == expected


@given(st.floats(allow_nan=False, allow_infinity=False), st.integers(-(10**15), 10**15))
@settings(max_examples=100)
def test_numbers_that_programs_write_are_read_back(number: float, whole: int) -> None:
    assert number_of(repr(number), "") == number
    assert whole_number_of(str(whole), "") == whole
    if abs(whole) < 2**53:
        assert whole_number_of(repr(float(whole)), "") == whole


@given(st.text("0123456789.,' +-eENSW°\"m", max_size=12))
@settings(max_examples=200)
def test_texts_are_numbers_or_one_line(text: str) -> None:
    for read in (number_of, whole_number_of):
        message = ""
        try:
            assert read(text, text) == float(text)
        except NotNumber as error:
            message = str(error)
        assert "\n" not in message


@pytest.mark.parametrize(
    ("text", "degrees"),
    [
        ("47°22'36.8\"N", "47.3768889"),
        ("8°32′30″W", "-8.5416667"),
        ("S 33°52.5'", "-33.875"),
        ("47° 22' 36\"", "47.3766667"),
    ]
    + [("8.5°E", "8.5"), ("8.5 E", "8.5"), ("8:32:30", "8.5416667"), ("-8°30'", "-8.5"), ("8d32m30s", "8.5416667")],
)
def test_degrees_and_minutes_are_refused_with_their_number(text: str, degrees: str) -> None:
    with pytest.raises(NotNumber, match=f", {degrees} if these are degrees"):
        number_of(text, text)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("POINT (8.54 47.37)", (8.54, 47.37, None)),
        ("point(8.54 47.37)", (8.54, 47.37, None)),
        ("POINT Z (8.54 47.37 412.5)", (8.54, 47.37, 412.5)),
        ("POINTZ(8.54 47.37 412.5)", (8.54, 47.37, 412.5)),
        ("POINT (8.54 47.37 412.5)", (8.54, 47.37, 412.5)),
        ("POINT M (8.54 47.37 1893)", (8.54, 47.37, None)),
        ("POINT ZM (8.54 47.37 412.5 1893)", (8.54, 47.37, 412.5)),
        ("SRID=4326;POINT(8.54 47.37)", (8.54, 47.37, None)),
        ("MULTIPOINT ((8.54 47.37))", (8.54, 47.37, None)),
        ("MultiPoint (8.54 47.37)", (8.54, 47.37, None)),
        ("MULTIPOINT Z ((8.54 47.37 1e2))", (8.54, 47.37, 100.0)),
        ("POINT EMPTY", None),
        ("POINT (nan nan)", None),
    ],
)
@pytest.mark.parametrize("column", ["WKT", "geometry", "the_geom", "wkt_geom"])
def test_points_as_text_are_places(tmp_path: Path, column: str, text: str, expected: Any) -> None:
    (row,) = _read(tmp_path, f'{column},figure\n"{text}",a.png\n')
    assert row.problem is None
    found = None if expected is None else (row.values["lon"], row.values["lat"], row.values.get("altitude"))
    assert found == expected
    assert column.lower() not in row.values


def test_points_with_a_code_are_transformed() -> None:
    found = wkt_point("SRID=2056;POINT(2683000 1247000)")
    lon, lat = pyproj.Transformer.from_crs(2056, 4326, always_xy=True).transform(2683000, 1247000)
    assert (found.lon, found.lat) == pytest.approx((lon, lat))  # type: ignore[union-attr]
    assert "unknown reference system" in str(wkt_point("SRID=999999;POINT(1 2)"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("POINT (2683000 1247000)", "wkt: 'POINT (2683000 1247000)' is not in degrees; put SRID=2056; or the like"),
        ("LINESTRING (0 0, 1 1)", "wkt: its geometry is a Linestring; give a Point, or give columns lon and lat"),
        ("MULTIPOINT ((1 2), (3 4))", "wkt: its geometry is a MultiPoint of 2; give a Point"),
        ("POLYGON ((0 0, 1 1, 0 1, 0 0))", "wkt: its geometry is a Polygon"),
        ("POINT (8,54 47,37)", "its geometry is a MultiPoint of 3"),
        ("POINT (8.54)", "is not a point as WKT; write POINT (LON LAT)"),
        ("0101000000" + struct.pack("<dd", 8.5, 47.4).hex(), "is not a point as WKT; write POINT (LON LAT)"),
        ('{"type": "Point", "coordinates": [8.5, 47.4]}', "is not a point as WKT; write POINT (LON LAT)"),
        ("POINT (inf 3)", "point at (inf 3); give finite numbers"),
    ],
)
def test_other_geometries_are_refused_by_what_to_write(tmp_path: Path, text: str, message: str) -> None:
    (row,) = _read(tmp_path, 'WKT,figure\n"' + text.replace('"', '""') + '",a.png\n')
    assert message in str(row.problem)


def test_columns_that_are_only_called_geometry_stay(tmp_path: Path) -> None:
    first, second = _read(tmp_path, "figure,geometry,lon,lat\na.png,round,8,47\nb.png,POINT (1 2),8,47\n")
    assert (first.values["geometry"], second.values["geometry"]) == ("round", "POINT (1 2)")
    assert (second.values["lon"], second.values["lat"]) == (8, 47)


@pytest.mark.parametrize(
    "heading", ["longitude,latitude", "lng,lat", "long,lat", "Lon_Deg,lat_deg", "decimalLongitude,decimalLatitude"]
)
def test_names_of_longitude_and_latitude(tmp_path: Path, heading: str) -> None:
    (row,) = _read(tmp_path, f"figure,{heading}\na.png,8.5,47.4\n")
    assert (row.values["lon"], row.values["lat"]) == (8.5, 47.4)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"x": 8.54, "y": 47.37},
            "columns x, y: 8.54 and 47.37 are pixels, but of no map; give map; or name the columns",
        ),
        (
            {"x": 2683000.5, "y": 1247000.0},
            "give map; or, if they are metres, transform them (ogr2ogr -t_srs EPSG:4326)",
        ),
        ({"easting": "2683000", "northing": "1247000"}, "columns easting, northing: are not read as a place"),
        ({"point_x": "8.5", "point_y": "47"}, "name them lon and lat if they are degrees (WGS 84)"),
        ({"coordinates": "47.4 8.5"}, "columns coordinates: are not read as a place"),
        ({"note": "x"}, "columns lon, lat: no place; give lon and lat, or map, x and y; or use --unplaced"),
    ],
)
def test_places_that_are_not_clear_are_named(tmp_path: Path, values: dict[str, Any], message: str) -> None:
    (tmp_path / "a.png").touch()
    with pytest.raises(InputError) as caught:
        ResolvedRow(batch_of(tmp_path, tmp_path / "out"), task_of({"figure": "a.png", **values}))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("lon", "lat", "message"),
    [
        (47.4, 108.5, "column lat: latitude 108.5 is outside -90..90; are lon and lat swapped?"),
        (8.5, 1247000.0, "column lat: latitude 1247000 is outside -90..90; give degrees, or transform it first"),
        (200.0, 47.4, "column lon: longitude 200 is outside -180..180; give degrees"),
    ],
)
def test_degrees_out_of_range(lon: float, lat: float, message: str) -> None:
    with pytest.raises(InputError) as caught:
        request_of({"figure": "a.png", "lon": lon, "lat": lat}, {}, "n")
    assert message in str(caught.value)


@pytest.mark.parametrize(
    "data",
    [
        "figure\tlon\tlat\tname\na.png\t8.5\t47.4\tMüller\n".encode("utf-16"),
        "\ufefffigure;lon;lat;name\r\na.png;8.5;47.4;Müller\r\n".encode(),
        "\ufeffsep=;\r\nfigure;lon;lat;name\r\na.png;8.5;47.4;Müller;;\r\n;;;\r\n".encode(),
        "figure,lon,lat,name\ra.png,8.5e0,47.4,Müller\r".encode(),
        'name,figure,lon,lat\n"Müller",a.png,"8.5","47.4"\n'.encode(),
    ],
)
def test_encodings_and_separators_of_spreadsheets(tmp_path: Path, data: bytes) -> None:
    (row,) = _read(tmp_path, data)
    assert (row.problem, row.values) == (None, {"figure": "a.png", "lon": 8.5, "lat": 47.4, "name": "Müller"})


@pytest.mark.parametrize("coding", ["cp1252", "latin-1", "mac_roman"])
def test_other_encodings_are_refused_by_line(tmp_path: Path, coding: str) -> None:
    with pytest.raises(InputError, match=r"line 2: byte 0x.. is not UTF-8; save the table as CSV UTF-8"):
        _read(tmp_path, "figure,name\na.png,Müller\n".encode(coding))


@pytest.mark.parametrize(
    ("lon", "lat", "problem"),
    [
        (8.5, 47.3, None),
        (8.5, 47.305, None),  # rounded
        (368.5 - 360, 47.3, None),
        (9.9, 40, "columns lon and lat say 9.9 40, but its geometry is at 8.5 47.3"),
        (47.3, 8.5, "columns lon and lat say 47.3 8.5, but its geometry is at 8.5 47.3"),
        (8.5, -47.3, "columns lon and lat say 8.5 -47.3, but its geometry is at 8.5 47.3"),
        (0, 0, "columns lon and lat say 0 0, but its geometry is at 8.5 47.3"),
    ],
)
def test_a_geometry_that_was_moved_without_its_columns(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, lon: float, lat: float, problem: str | None
) -> None:
    place = {"type": "Point", "coordinates": [8.5, 47.3]}
    feature = {"type": "Feature", "geometry": place, "properties": {"figure": "a.png", "lon": lon, "lat": lat}}
    (row,) = _read(tmp_path, json.dumps({"type": "FeatureCollection", "features": [feature]}), "t.geojson")
    assert (row.problem, row.values["lon"], row.values["lat"]) == (None, lon, lat)
    assert (not caplog.text) if problem is None else (f"{problem}; the columns count" in caplog.text)
