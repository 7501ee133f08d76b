"""The same table gives the same rows, whatever the format of its file; GDAL is the reference reader and writer."""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pyogrio
import pyogrio.raw
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fig2mesh.batch.collections import read as collection
from fig2mesh.batch.collections import rows
from fig2mesh.batch.collections.read import columns, read_rows
from fig2mesh.batch.collections.rows import Row
from fig2mesh.errors import InputError
from tests.fig2mesh.batch.collections.tables import WRITERS, write_csv, write_geojson

FARMER = {"figure": "farmer.png", "name": "Farmer", "lon": 8.5417, "lat": 47.3769}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("collections")


def read(path: Path, **more) -> list[Row]:
    return list(read_rows(path, **more))


def as_typed(values, like):
    """Texts of a CSV as the values that they were written from."""
    return {
        name: type(like[name])(value) if isinstance(value, str) and name in like else value
        for name, value in values.items()
    }


# What a text file can hold, and no blanks at its ends, which are not kept; csv makes line ends of \r alone its own.
texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=30).filter(
    lambda text: text == text.strip()
)
degrees = st.one_of(st.floats(-180, 180), st.sampled_from([0.0, -0.0, 180.0, 1e-300, 5e-324, 8.5]))
tables = st.lists(
    st.fixed_dictionaries(
        {
            "figure": texts,
            "name": texts,
            "lon": degrees,
            "lat": degrees,
            "triangles": st.integers(-(2**63), 2**63 - 1),
            # SQLite keeps whole numbers as integers, which have no negative zero; geometries do.
            "height_m": st.floats(allow_nan=False, allow_infinity=False).map(lambda number: number + 0.0),
        }
    ),
    min_size=1,
    max_size=4,
)


@settings(max_examples=60, deadline=None)
@given(table=tables)
def test_the_same_table_gives_the_same_rows(folder, table):
    for file, write in WRITERS.items():
        path = folder / file
        write(path, table)
        found = read(path)
        assert [row.number for row in found] == list(range(1, len(table) + 1))
        assert [row.problem for row in found] == [None] * len(table)
        for row, expected in zip(found, table, strict=True):
            values = as_typed(row.values, expected)
            assert values == expected
            # Equal, and of the same sign and kind.
            assert {name: repr(value) for name, value in values.items()} == {
                name: repr(value) for name, value in expected.items()
            }


@pytest.mark.parametrize("file", WRITERS)
def test_what_is_absent_is_left_out(folder, file):
    table = [{**FARMER, "name": None}, {"figure": "b.png", "name": "B"}, {**FARMER, "altitude": 412.5}]
    path = folder / f"absent-{file}"
    WRITERS[file](path, table)
    found = read(path)
    assert [row.problem for row in found] == [None] * 3
    assert [set(row.values) for row in found] == [
        {"figure", "lon", "lat"},
        {"figure", "name"},
        {"figure", "name", "lon", "lat", "altitude"},
    ]
    assert float(found[2].values["altitude"]) == 412.5


@pytest.mark.parametrize("file", WRITERS)
def test_names_of_columns_are_those_of_options(folder, file):
    path = folder / f"names-{file}"
    WRITERS[file](
        path, [{" Figure": "a.png", "Height-M": "2", "Longitude": "8.5", "LATITUDE ": "47", "x": "3", "Ä b": "1"}]
    )
    (row,) = read(path)
    assert row.values == {"figure": "a.png", "height_m": "2", "lon": 8.5, "lat": 47.0, "x": 3.0, "ä b": "1"}
    expected = None if "json" in file else ("figure", "height_m", "lon", "lat", "x", "ä b")
    assert columns(path) == expected


@pytest.mark.parametrize("file", [file for file in WRITERS if "gpkg" not in file])
def test_one_bad_row_does_not_stop_the_others(folder, file):
    good = {"figure": "a.png", "lon": 8.5, "lat": 47.0, "note": "x"}
    path = folder / f"bad-{file}"
    WRITERS[file](path, [good, {**good, "figure": None}, good, {**good, "note": "n" * (rows.MAX_TEXT + 1)}, good])
    found = read(path)
    assert [row.problem for row in found] == [
        None,
        "no figure; give the path of its picture as figure",
        None,
        "note: more than 65,536 characters; give a shorter text",
        None,
    ]
    assert found[1].values["lon"] == 8.5
    assert found[3].values["figure"] == "a.png"


@pytest.mark.parametrize(
    ("text", "finding"),
    [
        ("8,5", "lon: '8,5' has a comma; write a decimal point"),
        ("8°30'", 'lon: "8°30\'" is not a number; give a number with a decimal point, 8.5 if these are degrees'),
        ("nan.", "lon: 'nan.' is not a number; give a number with a decimal point"),
        ("1e999", "lon: not a finite number; leave it empty"),
        ("1_0", "lon: '1_0' is not a number; give a number with a decimal point"),
        ("٣", "lon: '٣' is not a number; give a number with a decimal point"),
        ("x\ny", "lon: 'x\\\\ny' is not a number; give a number with a decimal point"),
    ],
)
@pytest.mark.parametrize("file", ["c.txt", "e.geojson"])
def test_places_are_numbers(folder, file, text, finding):
    path = folder / f"number-{file}"
    if file == "c.txt":
        write_csv(path, [{"figure": "a.png", "lon": text, "lat": "47"}], ";")
    else:
        path.write_text(
            '{"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": null, '
            f'"properties": {{"figure": "a.png", "lon": {json.dumps(text)}, "lat": 47}}}}]}}'
        )
    (row,) = read(path)
    assert row.problem == finding
    assert row.values == {"figure": "a.png", "lat": 47.0}


@pytest.mark.parametrize("suffix", [".csv", ".geojson"])
def test_gdal_reads_the_same(folder, suffix):
    table = [{**FARMER, "name": f'Farmer {i}, the "old"', "triangles": i * 1000, "lon": i / 7} for i in range(50)]
    path = folder / f"ordinary{suffix}"
    (write_csv if suffix == ".csv" else write_geojson)(path, table)
    options = {"AUTODETECT_TYPE": "YES"} if suffix == ".csv" else {}
    meta, _, geometry, fields = pyogrio.raw.read(path, **options)
    named = dict(zip(meta["fields"], fields, strict=True))
    for index, row in enumerate(read(path)):
        for name, values in named.items():
            value = row.values[name]
            assert (
                type(values[index].item() if isinstance(values, np.ndarray) and values.dtype != object else "")(value)
                == values[index]
            )
        if geometry is not None:
            assert np.frombuffer(geometry[index][5:], "<f8").tolist() == [row.values["lon"], row.values["lat"]]


@settings(max_examples=300, deadline=None)
@given(
    data=st.binary(max_size=300), file=st.sampled_from(["a.csv", "b.geojson", "c.geojsonl", "d.gpkg", "e.json", "f"])
)
def test_any_bytes_are_rows_or_one_line(folder, data, file):
    path = folder / f"any-{file}"
    path.write_bytes(data)
    check_outcome(path)


@settings(max_examples=200, deadline=None)
@given(data=st.data(), file=st.sampled_from(list(WRITERS)))
def test_damaged_files_are_rows_or_one_line(folder, data, file):
    path = folder / f"damaged-{file}"
    WRITERS[file](path, [FARMER] * 3)
    content = bytearray(path.read_bytes())
    places = st.integers(0, len(content) - 1)
    if file == "h.gpkg":
        # Most of the pages are empty.
        places = st.sampled_from([i for i, byte in enumerate(content) if byte])
    for place, new in data.draw(st.lists(st.tuples(places, st.binary(min_size=1, max_size=3)), min_size=1, max_size=8)):
        content[place : place + len(new)] = new
    path.write_bytes(content)
    check_outcome(path)


def check_outcome(path: Path) -> None:
    """Nothing but rows, and InputError of one line."""
    message = ""
    try:
        for number, row in enumerate(read_rows(path), start=1):
            assert row.number == number
            assert row.problem is None or ("; " in row.problem and row.problem.isprintable())
            assert row.problem is not None or isinstance(row.values["figure"], str)
    except InputError as error:
        message = str(error)
    assert "\n" not in message


@pytest.mark.parametrize(
    ("file", "data", "message"),
    [
        ("a.csv", b"", "empty; give a table with a column 'figure'"),
        ("a.gpkg", b"figure\n", "not a GeoPackage; give a file written by QGIS or GDAL"),
        ("a.xlsx", b"PK\3\4....", "is a workbook or archive; save the table as CSV UTF-8"),
        ("a.csv", b"PK\3\4....", "is a workbook or archive; save the table as CSV UTF-8"),
        ("a.shp", b"\0\0\x27\x0a", "unknown suffix .shp; give a collection as CSV, GeoJSON or GeoPackage"),
    ],
)
def test_other_files_are_rejected(tmp_path, file, data, message):
    path = tmp_path / file
    path.write_bytes(data)
    with pytest.raises(InputError) as refused:
        read(path)
    assert str(refused.value) == f"{path}: {message}"


def test_missing_files_folders_and_layers_of_tables_are_rejected(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read(tmp_path / "a.csv")
    with pytest.raises(InputError, match="not a file"):
        read(tmp_path)
    path = tmp_path / "a.csv"
    write_csv(path, [FARMER])
    with pytest.raises(InputError, match="--layer 'b' requires a GeoPackage; leave it out"):
        read(path, layer="b")


def test_the_content_decides_the_kind_of_other_suffixes(tmp_path):
    for file in ("h.gpkg", "e.geojson", "g.json"):
        path = tmp_path / file
        WRITERS[file](path, [FARMER])
        other = path.rename(tmp_path / f"{path.stem}.collection")
        assert read(other)[0].values == FARMER


def test_too_many_rows_are_rejected(tmp_path, monkeypatch):
    monkeypatch.setattr(collection, "MAX_ROWS", 3)
    path = tmp_path / "a.csv"
    write_csv(path, [FARMER] * 3)
    assert len(read(path)) == 3
    write_csv(path, [FARMER] * 4)
    with pytest.raises(InputError, match="more than 3 rows; split the collection"):
        read(path)


@pytest.mark.parametrize("file", ["a.csv", "e.geojson", "f.geojsonl", "h.gpkg"])
def test_memory_does_not_grow_with_the_rows(tmp_path, file):
    def peak(count: int) -> int:
        path = tmp_path / f"{count}-{file}"
        WRITERS[file](path, [FARMER] * count)
        gc.collect()
        tracemalloc.start()
        try:
            assert sum(row.values["lon"] == FARMER["lon"] for row in read_rows(path)) == count
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    peak(10)
    small, large = peak(300), peak(5_000)
    # A row that were kept would cost half a kilobyte, all of them two megabytes.
    assert large < small + 500_000


def test_reading_tables_imports_no_heavy_library(tmp_path):
    for file in ("a.csv", "e.geojson", "h.gpkg"):
        WRITERS[file](tmp_path / file, [FARMER])
    code = (
        "import sys\nfrom pathlib import Path\nfrom fig2mesh.batch.collections.read import read_rows\n"
        "for path in sys.argv[1:]:\n    assert len(list(read_rows(Path(path)))) == 1\n"
        "print(sorted({'numpy', 'torch', 'pyogrio', 'pyproj', 'open3d'} & set(sys.modules)))"
    )
    paths = [str(tmp_path / file) for file in ("a.csv", "e.geojson", "h.gpkg")]
    run = subprocess.run([sys.executable, "-c", code, *paths], capture_output=True, text=True, env=os.environ)
    assert run.stdout == "[]\n", run.stderr
