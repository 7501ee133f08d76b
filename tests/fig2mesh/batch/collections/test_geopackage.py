"""GeoPackages as GDAL writes them, and as they should not be."""

from __future__ import annotations

import hashlib
import os
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pyogrio.raw
import pytest
from pyproj import CRS, Transformer

from fig2mesh.batch.collections import geopackage_rows
from fig2mesh.batch.collections.read import columns, read_rows
from fig2mesh.batch.collections.rows import Row
from fig2mesh.errors import InputError
from tests.fig2mesh.batch.collections.tables import wkb, write_layer


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.gpkg"


def read(path: Path, layer: str | None = None) -> list[Row]:
    return list(read_rows(path, layer))


def texts(*values: str | None) -> np.ndarray:
    return np.array([*values, None], object)[:-1]


def change(path: Path, *statements: str) -> None:
    """Change a file behind GDAL's back; its triggers need functions that SQLite alone has not."""
    with closing(sqlite3.connect(path)) as connection, connection:
        for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            connection.execute(f'DROP TRIGGER "{name}"')
        for statement in statements:
            connection.execute(statement)


def test_columns_of_every_type_are_as_gdal_reads_them(path):
    columns = {
        "figure": texts("a.png", "b.png"),
        "whole": np.array([1, -(2**31)], np.int32),
        "long": np.array([2**63 - 1, -(2**63)], np.int64),
        "short": np.array([1, 2], np.int16),
        "real": np.array([1.5, -0.25]),
        "single": np.array([0.1, np.nan], np.float32),
        "truth": np.array([True, False]),
        "day": np.array(["2024-02-29", "1900-01-01"], "datetime64[D]"),
        "moment": np.array(["2024-02-29T12:34:56.789", "1900-01-01T00:00:00"], "datetime64[ms]"),
        "text": texts("Ä\n'\"", None),
    }
    write_layer(path, columns, [wkb(8.5, 47.25), None])
    first, second = read(path)
    assert (first.where, second.where) == ("fid 1", "fid 2")
    assert (first.problem, second.problem) == (None, None)
    assert dict(first.values) == {
        "figure": "a.png",
        "whole": 1,
        "long": 2**63 - 1,
        "short": 1,
        "real": 1.5,
        "single": float(np.float32(0.1)),
        "truth": True,
        "day": "2024-02-29",
        "moment": "2024-02-29T12:34:56.789",
        "text": "Ä\n'\"",
        "lon": 8.5,
        "lat": 47.25,
    }
    assert dict(second.values) == {
        "figure": "b.png",
        "whole": -(2**31),
        "long": -(2**63),
        "short": 2,
        "real": -0.25,
        "truth": False,
        "day": "1900-01-01",
        "moment": "1900-01-01T00:00:00",
    }
    assert [type(first.values[name]) for name in ("whole", "real", "truth")] == [int, float, bool]
    meta, _, _, fields = pyogrio.raw.read(path)
    for name, values in zip(meta["fields"], fields, strict=True):
        if values.dtype.kind in "iuf":
            found = [row.values.get(name, np.nan) for row in (first, second)]
            np.testing.assert_array_equal(np.array(found, values.dtype), values)


def test_binary_columns_are_left_out(path):
    write_layer(path, {"figure": texts("a.png")}, None)
    change(
        path, "ALTER TABLE figures ADD COLUMN picture BLOB", "UPDATE figures SET picture = x'00ff', figure = 'a.png'"
    )
    (row,) = read(path)
    assert (dict(row.values), row.problem) == ({"figure": "a.png"}, None)


@pytest.mark.parametrize("crs", ["EPSG:2056", "EPSG:3857", "EPSG:32632", "EPSG:4258", "EPSG:27572", "ESRI:54030"])
def test_points_of_any_reference_system_come_on_wgs_84(path, crs):
    lonlat = np.array([[8.5417, 47.3769], [7.4386, 46.9511], [2.35, 48.85]])
    forward = Transformer.from_crs("EPSG:4326", crs, always_xy=True, allow_ballpark=False)
    places = np.stack(forward.transform(*lonlat.T), axis=1)
    points = [wkb(*place, 400.5 + i) for i, place in enumerate(places.tolist() * 100)]
    write_layer(path, {"figure": texts(*["a.png"] * 300)}, points, crs)
    found = read(path)
    assert [row.problem for row in found] == [None] * 300
    np.testing.assert_allclose(
        [[row.values["lon"], row.values["lat"]] for row in found], np.tile(lonlat, (100, 1)), atol=1e-8
    )
    assert [row.values["altitude"] for row in found] == [400.5 + i for i in range(300)]


def test_a_system_known_by_its_text_alone_is_read(path):
    crs = CRS.from_proj4("+proj=tmerc +lat_0=47 +lon_0=8 +k=1 +x_0=1000 +y_0=2000 +datum=WGS84 +units=m")
    write_layer(path, {"figure": texts("a.png")}, [wkb(1000, 2000)], crs.to_wkt())
    (row,) = read(path)
    assert row.problem is None
    np.testing.assert_allclose([row.values["lon"], row.values["lat"]], [8, 47], atol=1e-12)


def test_heights_with_a_datum_are_converted_or_rejected(path):
    # Heights on the ellipsoid of another datum: a conversion without a grid. Above sea level there is none.
    write_layer(path, {"figure": texts("a.png", "b.png")}, [wkb(8.5, 47.25, 400.0), wkb(8.5, 47.25)], "EPSG:4937")
    found = read(path)
    assert [row.problem for row in found] == [None, None]
    assert found[0].values["altitude"] == pytest.approx(400.0, abs=1e-3)
    path.unlink()
    write_layer(path, {"figure": texts("a.png", "b.png")}, [wkb(2683000, 1247000, 400.0), None], "EPSG:2056+5728")
    found = read(path)
    assert "heights" in found[0].problem
    assert found[0].problem.endswith("; drop z, and give columns altitude and altitude_datum")
    assert found[1].problem is None


@pytest.mark.parametrize(
    ("code", "finding"),
    [
        (0, "its layer has no reference system; assign one, or give columns lon and lat"),
        (-1, "its layer has no reference system; assign one, or give columns lon and lat"),
        (77, "unknown reference system of its layer; reproject it to WGS 84, or give columns lon and lat"),
    ],
)
def test_points_of_no_reference_system_are_no_places(path, code, finding):
    write_layer(path, {"figure": texts("a.png"), "lon": np.array([np.nan]), "lat": np.array([np.nan])}, [wkb(1, 2)])
    change(path, f"UPDATE gpkg_geometry_columns SET srs_id = {code}")
    (row,) = read(path)
    assert row.problem == finding
    change(path, "UPDATE figures SET lon = 8.5, lat = 47")
    (row,) = read(path)
    assert (row.problem, row.values["lon"]) == (None, 8.5)


def test_a_point_outside_of_its_reference_system_is_one_row(path):
    write_layer(path, {"figure": texts("a.png", "b.png")}, [wkb(1e30, 2e30), wkb(500000, 5000000)], "EPSG:32632")
    found = read(path)
    assert [row.problem for row in found] == [
        "point outside the area of WGS 84 / UTM zone 32N; check the reference system of its layer",
        None,
    ]


POLYGON = b"\1\3\0\0\0\1\0\0\0\4\0\0\0" + np.array([0, 0, 1, 0, 1, 1, 0, 0], "<f8").tobytes()
MULTI = b"\1\4\0\0\0"


@pytest.mark.parametrize(
    ("shape", "problem", "place"),
    [
        (POLYGON, "its geometry is a Polygon; give a Point, or columns lon and lat", None),
        (
            MULTI + b"\2\0\0\0" + wkb(1, 2) * 2,
            "its geometry is a MultiPoint of 2; give a Point, or columns lon and lat",
            None,
        ),
        (MULTI + b"\1\0\0\0" + wkb(1, 2), None, (1, 2)),
        (MULTI + b"\0\0\0\0", None, None),
        (wkb(np.nan, np.nan), None, None),
        (wkb(1, np.inf), "point at 1.0 inf; give finite numbers", None),
        (wkb(1, 2, np.nan), None, (1, 2)),
        (wkb(1, 2, 3), None, (1, 2, 3)),
        (b"\0\0\0\3\xe9" + np.array([1, 2, 3], ">f8").tobytes(), None, (1, 2, 3)),
        (b"\1\1\0\0\x80" + np.array([1, 2, 3], "<f8").tobytes(), None, (1, 2, 3)),
        (b"\1\xd1\x07\0\0" + np.array([1, 2, 9], "<f8").tobytes(), None, (1, 2)),
        (b"\1\1\0\0\0", "invalid geometry; save the layer again", None),
        (b"", "invalid geometry; save the layer again", None),
    ],
)
@pytest.mark.parametrize("envelope", [0, 1, 2, 4])
def test_shapes(path, shape, problem, place, envelope):
    write_layer(path, {"figure": texts("a.png")}, [wkb(1, 2)])
    header = b"GP\0" + bytes([envelope << 1 | 1]) + b"\xe6\x10\0\0" + bytes((0, 32, 48, 48, 64)[envelope])
    change(path, f"UPDATE figures SET geom = x'{(header + shape).hex()}'")
    (row,) = read(path)
    assert row.problem == problem
    assert tuple(row.values[name] for name in ("lon", "lat", "altitude") if name in row.values) == (place or ())


def test_what_is_no_geometry_is_one_row(path):
    write_layer(path, {"figure": texts("a.png")}, [wkb(1, 2)])
    for value, problem in (
        ("x'4750'", "invalid geometry; save the layer again"),
        ("'POINT'", None),
        ("7", None),
    ):
        change(path, f"UPDATE figures SET geom = {value}")
        (row,) = read(path)
        assert row.problem == problem


def test_the_layer_is_the_only_one_with_a_figure(path):
    write_layer(path, {"note": texts("x")}, [wkb(1, 2)], layer="places")
    write_layer(path, {"figure": texts("a.png")}, None, layer='the "good" one; --', append=True)
    assert columns(path) == ("figure",)
    assert read(path)[0].values == {"figure": "a.png"}
    assert read(path, 'the "good" one; --')[0].where == "fid 1"
    write_layer(path, {"figure": texts("c.png")}, None, layer="third", append=True)
    assert read(path, "third")[0].values == {"figure": "c.png"}
    for layer, message in (
        (None, 'several layers with a column figure: the "good" one; --, third; name one with --layer'),
        ("fourth", "no layer 'fourth' among places, the \"good\" one; --, third; name one of them"),
        ("places", "no column figure among note; name the column with the pictures figure"),
    ):
        with pytest.raises(InputError) as refused:
            read(path, layer)
        assert str(refused.value) == f"{path}: {message}"


def test_views_are_layers(path):
    write_layer(path, {"figure": texts("a.png", "b.png"), "size": np.array([1, 2])}, [wkb(1, 2), wkb(3, 4)])
    change(
        path,
        "CREATE VIEW large AS SELECT fid AS OGC_FID, geom, figure, size * 10 AS size FROM figures WHERE size > 1",
        "INSERT INTO gpkg_contents (table_name, identifier, data_type, srs_id) VALUES ('large', 'l', 'features', 4326)",
        "INSERT INTO gpkg_geometry_columns VALUES ('large', 'geom', 'POINT', 4326, 0, 0)",
        "CREATE VIEW broken AS SELECT ST_X(geom) AS figure FROM figures",
        "INSERT INTO gpkg_contents (table_name, identifier, data_type) VALUES ('broken', 'b', 'attributes')",
        "CREATE VIEW endless AS WITH RECURSIVE n(figure) AS (SELECT 1 UNION ALL SELECT figure + 1 FROM n) "
        "SELECT figure FROM n WHERE figure < 0",
        "INSERT INTO gpkg_contents (table_name, identifier, data_type) VALUES ('endless', 'e', 'attributes')",
    )
    assert read(path, "large") == [Row(1, "fid 2", {"figure": "b.png", "size": 20, "lon": 3.0, "lat": 4.0})]
    with pytest.raises(InputError, match=r"cannot be read \(no such function: ST_X\)"):
        read(path, "broken")


def test_a_view_that_never_ends_is_given_up(path, monkeypatch):
    monkeypatch.setattr(geopackage_rows, "MAX_WAITS", 3)
    write_layer(path, {"figure": texts("a.png")}, None)
    change(
        path,
        "CREATE VIEW endless AS WITH RECURSIVE n(figure) AS (SELECT 1 UNION ALL SELECT figure + 1 FROM n) "
        "SELECT figure FROM n WHERE figure < 0",
        "INSERT INTO gpkg_contents (table_name, identifier, data_type) VALUES ('endless', 'e', 'attributes')",
    )
    with pytest.raises(InputError, match="view takes too long; save the layer as a table"):
        read(path, "endless")


def test_values_that_are_too_much_are_one_row(path):
    write_layer(
        path,
        {"figure": texts("a.png", "b.png", "c.png", "d.png", "e.png"), "note": texts(*"abcde"), "size": np.zeros(5)},
        None,
    )
    change(
        path,
        "UPDATE figures SET note = printf('%.*c', 70000, 'x') WHERE fid = 1",
        "UPDATE figures SET note = printf('%.*c', 2000000, 'x') WHERE fid = 2",
        "UPDATE figures SET size = 9e999 WHERE fid = 3",
        "UPDATE figures SET note = CAST(x'61ff62' AS TEXT) WHERE fid = 4",
        "UPDATE figures SET note = CAST(x'610062' AS TEXT) WHERE fid = 5",
    )
    assert [row.problem for row in read(path)] == [
        "note: more than 65,536 characters; give a shorter text",
        "note: more than 65,536 characters; give a shorter text",
        "size: not a finite number; leave it empty",
        "note: bytes that are not UTF-8; save the text as UTF-8",
        "note: NUL character; remove it",
    ]


def test_reading_leaves_no_trace(path):
    write_layer(path, {"figure": texts("a.png")}, [wkb(1, 2)])
    change(path, "PRAGMA journal_mode = WAL")
    before = (hashlib.sha256(path.read_bytes()).digest(), path.stat().st_mtime_ns)
    path.chmod(0o444)
    path.parent.chmod(0o555)
    try:
        rows = read_rows(path)
        next(rows)
        assert os.listdir(path.parent) == ["a.gpkg"]
        assert list(rows) == []
    finally:
        path.parent.chmod(0o755)
    assert os.listdir(path.parent) == ["a.gpkg"]
    assert (hashlib.sha256(path.read_bytes()).digest(), path.stat().st_mtime_ns) == before


def test_changes_that_are_not_written_back_are_not_missed(path):
    write_layer(path, {"figure": texts("a.png")}, None)
    change(path, "PRAGMA journal_mode = WAL")
    with closing(sqlite3.connect(path)) as editor:
        editor.execute("UPDATE gpkg_contents SET description = 'x'")
        editor.commit()
        with pytest.raises(InputError) as refused:
            read(path)
        finding = (
            "has changes in a.gpkg-wal that are not yet written back; save and close it in the program that edits it"
        )
        assert str(refused.value) == f"{path}: {finding}"
    assert len(read(path)) == 1
    journal = path.with_name("a.gpkg-journal")
    journal.write_bytes(bytes(512))
    assert len(read(path)) == 1
    journal.write_bytes(geopackage_rows.JOURNAL_MAGIC + bytes(504))
    with pytest.raises(InputError, match=r"changes in a\.gpkg-journal"):
        read(path)


def test_names_of_files_are_only_names(tmp_path):
    for name in ("a?mode=rwc&b.gpkg", "100%20#1.gpkg", "zip!x.gpkg", "ä b.gpkg"):
        path = tmp_path / name
        write_layer(tmp_path / "a.gpkg", {"figure": texts("a.png")}, None)
        (tmp_path / "a.gpkg").rename(path)
        assert len(read(path)) == 1
        path.unlink()
    assert os.listdir(tmp_path) == []


def test_other_databases_and_damaged_files_are_rejected_in_one_line(path):
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("CREATE TABLE figures (figure TEXT)")
    with pytest.raises(
        InputError, match="an SQLite database, but not a GeoPackage; give a file written by QGIS or GDAL"
    ):
        read(path)
    path.unlink()
    write_layer(path, {"other": texts("a.png")}, None)
    with pytest.raises(InputError, match="no layer with a column figure, of figures; name the column"):
        read(path)
    change(path, "DELETE FROM gpkg_contents")
    with pytest.raises(InputError, match="no layers; name the column"):
        read(path)
    path.unlink()
    write_layer(path, {"figure": texts(*["a.png"] * 5_000)}, [wkb(1, 2)] * 5_000)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match=r"cannot be read \(database disk image is malformed\)"):
        read(path)
    path.write_bytes(data[:100])
    with pytest.raises(InputError, match="cannot be read"):
        read(path)


def test_columns_with_one_name_are_rejected(path):
    write_layer(path, {"figure": texts("a.png"), "height-m": texts("1"), "height_m": texts("2")}, None)
    with pytest.raises(InputError, match="two columns named height_m; remove or rename one of them"):
        read(path)
