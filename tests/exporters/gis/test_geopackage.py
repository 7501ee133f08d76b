"""The GeoPackage of figures, read by GDAL and by SQLite: the same as index.geojson, in order, to the byte."""

from __future__ import annotations

import json
import sqlite3
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio
import pyproj
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from exporters.errors import ExportError
from exporters.gis import table_spool
from exporters.gis.geojson import OWN_PROPERTIES, write_collection
from exporters.gis.geopackage import Failure, write_geopackage
from exporters.placed_figure import PlacedFigure, ecef_matrix
from georef.placement import GeoPlacement
from tests.exporters.analytic import ZURICH
from tests.exporters.tables import figure, many, tables, whole_numbers

CLAMPED = GeoPlacement(8.5, 47.4, 0.0, altitude_mode="clamp")


def _rows(path: Path, table: str = "figures") -> list[dict[str, Any]]:
    """The rows of a table as SQLite has them, in the order of their ids, without id and geometry."""
    with closing(sqlite3.connect(path)) as database:
        cursor = database.execute(f'SELECT * FROM "{table}" ORDER BY 1')
        names = [column[0] for column in cursor.description]
        hidden = 2 if table == "figures" else 1
        rows = cursor.fetchall()
    assert [row[0] for row in rows] == list(range(1, len(rows) + 1))
    return [dict(zip(names[hidden:], row[hidden:], strict=True)) for row in rows]


def _coordinates(path: Path) -> list[list[float]]:
    """Of the points, as GDAL gives them in well-known binary."""
    _, _, geometry, _ = pyogrio.raw.read(path, layer="figures")
    return [np.frombuffer(each[5:], np.float64).tolist() for each in geometry]


def _geojson(figures: list[PlacedFigure], path: Path) -> list[dict[str, Any]]:
    with path.open("w", encoding="utf-8") as stream:
        write_collection(figures, stream)
    features: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["features"]
    return features


def _same(stored: Any, expected: Any) -> bool:
    """Whether a column holds a value; one that must hold text as well has numbers as JSON writes them."""
    if isinstance(stored, str) and not isinstance(expected, str) and expected is not None:
        return stored == json.dumps(expected)
    return bool(stored == expected)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(figures=tables())
def test_the_layer_equals_geojson(tmp_path: Path, figures: list[PlacedFigure]) -> None:
    path = tmp_path / "index.gpkg"
    assert write_geopackage(figures, path) == len(figures)
    features = _geojson(figures, tmp_path / "index.geojson")
    rows = _rows(path)
    assert len(rows) == len(features)
    for row, expected in zip(rows, features, strict=True):
        assert list(row) == list(expected["properties"])
        assert all(_same(row[name], value) for name, value in expected["properties"].items())
    assert _coordinates(path) == [expected["geometry"]["coordinates"] for expected in features]


def _is_stored(stored: Any, value: Any) -> bool:
    """Whether a value is held to the last digit, as a number or as text; a whole number may be one with a fraction."""
    if isinstance(stored, str):
        return type(value)(stored) == value
    return bool(stored == value)


# GDAL takes the largest whole number of 64 bits, which it reads as it is, for a clamped one.
@pytest.mark.filterwarnings("ignore:Integer values probably ranging out of 64bit:RuntimeWarning")
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.one_of(
        st.lists(st.one_of(st.none(), whole_numbers), min_size=1, max_size=6),
        st.lists(st.one_of(st.none(), whole_numbers, st.floats(allow_nan=False, allow_infinity=False)), min_size=1),
    )
)
@example([2**53 + 1, None])
@example([2**53 + 1, 0.5])
@example([None, 2**53 + 1, 0.5])
@example([2**53, 0.5, None])
@example([-(2**53) - 1, 0.0])
@example([2**63 - 1, -(2**63), None])
@example([2**63, None, 1])
@example([2**64, -(2**64)])
@example([2**63 - 1, 1e300])
def test_whole_numbers_keep_all_digits(tmp_path: Path, column: list[int | float | None]) -> None:
    figures = [figure("a", ZURICH, {"x": value}) for value in column]
    write_geopackage(figures, tmp_path / "a.gpkg")
    stored = [row["x"] for row in _rows(tmp_path / "a.gpkg")]
    expected = [each["properties"]["x"] for each in _geojson(figures, tmp_path / "a.geojson")]
    for value, *found in zip(column, stored, expected, strict=True):
        assert all(each is None if value is None else _is_stored(each, value) for each in found)
    whole = [value for value in column if value is not None]
    if whole and all(type(value) is int and -(2**63) <= value < 2**63 for value in whole):
        assert all(type(each) is int for each in stored if each is not None)
        assert expected == column
    # One number that GDAL does not know makes the whole file unreadable.
    assert pyogrio.read_info(tmp_path / "a.geojson")["features"] == len(column)


@pytest.mark.parametrize("places", [[ZURICH], [CLAMPED], [ZURICH, CLAMPED], [CLAMPED, ZURICH]])
def test_gdal_reads_the_same_layer_from_both(tmp_path: Path, places: list[GeoPlacement]) -> None:
    figures = [figure("a", place, {"year": 1893, "share": 0.5, "artist": "=A", "sure": True}) for place in places]
    write_geopackage(figures, tmp_path / "index.gpkg")
    _geojson(figures, tmp_path / "index.geojson")
    one, other = (pyogrio.read_info(tmp_path / name) for name in ("index.gpkg", "index.geojson"))
    for key in ("crs", "geometry_type", "features", "total_bounds"):
        assert one[key] == other[key], key
    assert one["layer_name"] == "figures"
    assert one["capabilities"]["fast_spatial_filter"]
    types = dict(zip(one["fields"], zip(one["ogr_types"], one["ogr_subtypes"], strict=True), strict=True))
    assert list(types) == list(other["fields"])
    assert types["year"] == ("OFTInteger64", "OFSTNone")
    assert types["share"] == types["heading_deg"] == ("OFTReal", "OFSTNone")
    assert types["artist"] == types["name"] == ("OFTString", "OFSTNone")
    assert types["sure"] == ("OFTInteger", "OFSTBoolean")
    with closing(sqlite3.connect(tmp_path / "index.gpkg")) as database:
        heights = {place.altitude_mode == "absolute" for place in places}
        flag = {(True,): 1, (False,): 0, (False, True): 2}[tuple(sorted(heights))]
        assert database.execute("SELECT z, m FROM gpkg_geometry_columns").fetchall() == [(flag, 0)]


def test_the_stored_reference_system_places_figures_correctly(tmp_path: Path) -> None:
    figures = [each for each in many(300) if each.placement.altitude_mode == "absolute"]
    write_geopackage(figures, tmp_path / "a.gpkg")
    crs = pyproj.CRS.from_user_input(pyogrio.read_info(tmp_path / "a.gpkg")["crs"])
    assert crs == pyproj.CRS("EPSG:4979")
    with closing(sqlite3.connect(tmp_path / "a.gpkg")) as database:
        query = "SELECT organization, organization_coordsys_id, definition_12_063 FROM gpkg_spatial_ref_sys"
        ((authority, code, definition),) = [row for row in database.execute(query) if row[1] == 4979]
    assert (authority, code) == ("EPSG", 4979)
    assert len(pyproj.CRS.from_wkt(definition).axis_info) == 3
    to_ecef = pyproj.Transformer.from_crs(crs, "EPSG:4978", always_xy=True)
    found = np.stack(to_ecef.transform(*np.array(_coordinates(tmp_path / "a.gpkg")).T), axis=1)
    wanted = np.array([ecef_matrix(each.placement)[:3, 3] for each in figures])
    assert np.abs(found - wanted).max() < 1e-6


def test_the_bytes_do_not_depend_on_the_time(tmp_path: Path) -> None:
    figures, failed = list(many(50)), [(3, "x", "no hand")]
    write_geopackage(figures, tmp_path / "one.gpkg", failed=failed)
    time.sleep(1.1)  # GDAL's stamps count milliseconds, SQLite's seconds
    write_geopackage(iter(figures), tmp_path / "two.gpkg", failed=iter(failed))
    assert (tmp_path / "one.gpkg").read_bytes() == (tmp_path / "two.gpkg").read_bytes()
    assert pyogrio.get_gdal_config_option("OGR_CURRENT_DATE") is None
    with closing(sqlite3.connect(tmp_path / "one.gpkg")) as database:
        stamps = {row[0] for row in database.execute("SELECT last_change FROM gpkg_contents")}
    assert stamps == {"1970-01-01T00:00:00.000Z"}


def test_gdal_settings_are_restored(tmp_path: Path) -> None:
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": "2001-01-01T00:00:00.000Z"})
    try:
        write_geopackage([], tmp_path / "a.gpkg")
        assert pyogrio.get_gdal_config_option("OGR_CURRENT_DATE") == "2001-01-01T00:00:00.000Z"
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": None})


@pytest.fixture
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Chunks of seven rows, on the disk from the first kilobyte on."""
    monkeypatch.setattr(table_spool, "CHUNK_ROWS", 7)
    monkeypatch.setattr(table_spool, "IN_MEMORY_BYTES", 1024)


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("count", [6, 7, 8, 100])
def test_rows_keep_their_order_over_chunks(tmp_path: Path, count: int) -> None:
    path = tmp_path / "a.gpkg"
    assert write_geopackage(many(count), path, failed=((n, f"{n}", "e") for n in range(count))) == count
    assert [row["name"] for row in _rows(path)] == [f"figure {number}" for number in range(count)]
    assert [row["row"] for row in _rows(path, "failed")] == list(range(count))
    with closing(sqlite3.connect(path)) as database:
        assert database.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        assert database.execute("PRAGMA foreign_key_check").fetchall() == []
        assert database.execute("PRAGMA application_id").fetchall() == [(int.from_bytes(b"GPKG"),)]
        assert database.execute("SELECT count(*) FROM rtree_figures_geom").fetchall() == [(count,)]
        assert database.execute("SELECT feature_count FROM gpkg_ogr_contents").fetchall() == [(count,), (count,)]


@pytest.mark.usefixtures("small_chunks")
def test_the_index_finds_what_a_search_finds(tmp_path: Path) -> None:
    write_geopackage(many(200), tmp_path / "a.gpkg")
    points = np.array([each[:2] for each in _coordinates(tmp_path / "a.gpkg")])
    box = (-60.0, -20.0, 45.0, 50.0)
    fids = pyogrio.raw.read(tmp_path / "a.gpkg", bbox=box, return_fids=True)[1]
    inside = ((points >= box[:2]) & (points <= box[2:])).all(axis=1)
    assert 10 < inside.sum() < 190
    assert sorted(fids.tolist()) == (np.flatnonzero(inside) + 1).tolist()


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize(
    ("late", "kind", "first"),
    [
        (None, "INTEGER", 5),
        (7, "INTEGER", 5),
        (0.5, "REAL", 5.0),
        ("ca. 1893", "TEXT", "5"),
        (2**63, "TEXT", "5"),
        (True, "INTEGER", 5),
    ],
)
def test_a_column_holds_its_last_value_too(tmp_path: Path, late: Any, kind: str, first: Any) -> None:
    figures = [figure("a", ZURICH, {"year": 5 if number < 20 else late}) for number in range(21)]
    write_geopackage(figures, tmp_path / "a.gpkg")
    rows = _rows(tmp_path / "a.gpkg")
    assert rows[0]["year"] == first
    assert type(rows[0]["year"]) is type(first)
    assert _same(rows[-1]["year"], late)
    with closing(sqlite3.connect(tmp_path / "a.gpkg")) as database:
        types = {row[1]: row[2] for row in database.execute("PRAGMA table_info(figures)")}
    assert types["year"] == kind


def test_rows_need_not_have_the_same_columns(tmp_path: Path) -> None:
    write_geopackage([figure("a", ZURICH, {"x": 1}), figure("b", ZURICH, {"y": "z", "X": 2})], tmp_path / "a.gpkg")
    assert [(row["x"], row["y"]) for row in _rows(tmp_path / "a.gpkg")] == [(1, None), (2, "z")]


def test_without_figures_the_columns_are_there(tmp_path: Path) -> None:
    assert write_geopackage([], tmp_path / "a.gpkg", failed=[]) == 0
    found = pyogrio.read_info(tmp_path / "a.gpkg", layer="figures")
    assert found["features"] == 0
    assert found["geometry_type"] == "Point Z"
    assert found["fields"].tolist() == list(OWN_PROPERTIES)
    assert pyogrio.list_layers(tmp_path / "a.gpkg").tolist() == [["figures", "Point Z"], ["failed", None]]
    write_geopackage([], tmp_path / "a.gpkg")
    assert pyogrio.list_layers(tmp_path / "a.gpkg").tolist() == [["figures", "Point Z"]]


def test_failures_are_a_table_without_geometry(tmp_path: Path) -> None:
    failed: list[Failure] = [(2, "anna", "no.png: no such file or folder; check the path"), (9, "", "=x")]
    write_geopackage(many(3), tmp_path / "a.gpkg", failed=failed)
    assert _rows(tmp_path / "a.gpkg", "failed") == [
        {"row": 2, "name": "anna", "error": "no.png: no such file or folder; check the path"},
        {"row": 9, "name": "", "error": "=x"},
    ]
    assert pyogrio.read_info(tmp_path / "a.gpkg", layer="failed")["geometry_type"] is None


def test_models_are_named_or_not(tmp_path: Path) -> None:
    write_geopackage([figure("a b", ZURICH)], tmp_path / "a.gpkg")
    assert _rows(tmp_path / "a.gpkg")[0]["model"] == "a%20b/a%20b.glb"
    write_geopackage([figure("a b", ZURICH)], tmp_path / "a.gpkg", models=False)
    assert _rows(tmp_path / "a.gpkg")[0]["model"] is None


@pytest.mark.parametrize("name", ["a!b.gpkg", "a!b/c.gpkg", "ä 龍/#?%;.gpkg", "x.zip!/y.gpkg"])
def test_names_that_gdal_might_misread(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True, parents=True)
    write_geopackage(many(3), path)
    assert len(_rows(path)) == 3
    assert [each for each in tmp_path.rglob("*") if each.is_file()] == [path]


def test_failures_leave_nothing(tmp_path: Path) -> None:
    def broken() -> Iterator[PlacedFigure]:
        yield from many(3)
        raise ExportError("x.glb", "is broken", "make it again")

    (tmp_path / "a.gpkg").write_bytes(b"old")
    with pytest.raises(ExportError, match=r"x\.glb: is broken"):
        write_geopackage(broken(), tmp_path / "a.gpkg")
    with pytest.raises(ExportError, match=r"none/a\.gpkg: cannot be written"):
        write_geopackage(many(3), tmp_path / "none" / "a.gpkg")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_memory_does_not_grow_with_the_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_spool, "CHUNK_ROWS", 1000)
    monkeypatch.setattr(table_spool, "IN_MEMORY_BYTES", 1 << 16)
    peaks = []
    for count in (2000, 20_000):
        tracemalloc.start()
        write_geopackage(many(count), tmp_path / "a.gpkg", failed=((n, "x", "e" * 100) for n in range(0, count, 10)))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.25 * peaks[0]
    assert peaks[1] < 3_000_000


def test_the_version_is_one_that_old_readers_know(tmp_path: Path) -> None:
    write_geopackage(many(3), tmp_path / "a.gpkg", failed=[(1, "x", "e")])
    with closing(sqlite3.connect(tmp_path / "a.gpkg")) as database:
        ((version,),) = database.execute("PRAGMA user_version")
        ((application,),) = database.execute("PRAGMA application_id")
    assert (version, application) == (10200, int.from_bytes(b"GPKG"))
