"""GeoJSON as programs write it, and as it should not be; with the parser in C and the one in Python."""

from __future__ import annotations

import json
from pathlib import Path

import ijson
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fig2mesh.batch.collections import geojson_rows
from fig2mesh.batch.collections.read import read_rows
from fig2mesh.batch.collections.rows import Row
from fig2mesh.errors import InputError

POINT = {"type": "Point", "coordinates": [8.5, 47.25]}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.geojson"


@pytest.fixture(params=["yajl2_c", "python"])
def parser(request, monkeypatch):
    try:
        backend = ijson.get_backend(request.param)
    except ImportError:
        pytest.skip("ijson is without its parser in C here")
    monkeypatch.setattr(ijson, "basic_parse_coro", backend.basic_parse_coro)
    return request.param


def feature(geometry: object = None, **properties: object) -> str:
    return json.dumps({"type": "Feature", "geometry": geometry, "properties": {"figure": "a.png", **properties}})


def document(*features: str, before: str = "", after: str = "") -> str:
    return f'{{"type": "FeatureCollection", {before} "features": [{", ".join(features)}]{after}}}'


def rows_of(path: Path, text: str | bytes) -> list[Row]:
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return list(read_rows(path))


values = st.recursive(
    st.one_of(
        st.booleans(),
        st.integers(-(2**64), 2**64),
        st.floats(allow_nan=False, allow_infinity=False),
        st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1).filter(
            lambda text: text == text.strip()
        ),
    ),
    lambda inner: st.lists(inner, min_size=1, max_size=4).map(tuple),
    max_leaves=12,
)


@given(value=values)
def test_values_keep_their_kind(tmp_path_factory, value):
    path = tmp_path_factory.getbasetemp() / "kinds.geojson"
    (row,) = rows_of(path, document(feature(value=value)))
    if row.problem is None:
        assert repr(row.values["value"]) == repr(value)
    else:
        assert row.problem == "value: lists nested deeper than 8; flatten them"


def test_points_give_places_where_properties_give_none(path, parser):
    z = {"type": "Point", "coordinates": [8.5, 47.25, 412]}
    multi = {"type": "MultiPoint", "coordinates": [[8.5, 47.25]]}
    found = rows_of(
        path,
        document(
            feature(POINT),
            feature(z),
            feature(multi),
            feature(POINT, lon=1, lat="2"),
            feature(z, altitude=3),
            feature(POINT, map="sheet.tif", x=1, y=2.5),
            feature({"type": "Point", "coordinates": []}),
            feature({"type": "Point", "coordinates": [8.5, 47.25, 1, 2]}),
            feature({"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]]]}, lon=1, lat=2),
        ),
    )
    assert [row.problem for row in found] == [None] * 9
    place = {"figure": "a.png", "lon": 8.5, "lat": 47.25}
    assert [dict(row.values) for row in found] == [
        place,
        {**place, "altitude": 412.0},
        place,
        {"figure": "a.png", "lon": 1.0, "lat": 2.0},
        {**place, "altitude": 3},
        {"figure": "a.png", "map": "sheet.tif", "x": 1.0, "y": 2.5},
        {"figure": "a.png"},
        {**place, "altitude": 1.0},
        {"figure": "a.png", "lon": 1.0, "lat": 2.0},
    ]
    assert [row.where for row in found] == [f"feature {i + 1}" for i in range(9)]


LINE = {"type": "LineString", "coordinates": [[i, i] for i in range(5_000)]}

# fmt: off
BAD_FEATURES = {
    feature(LINE): "its geometry is a LineString; give a Point, or columns lon and lat",
    feature({"type": "GeometryCollection", "geometries": [POINT]}):
        "its geometry is a GeometryCollection; give a Point, or columns lon and lat",
    feature({"type": "Point", "coordinates": [1]}):
        "point with fewer than two coordinates; give longitude and latitude",
    feature({"type": "Point", "coordinates": ["a", 2]}): "point at ('a', 2); give finite numbers",
    feature({"type": "Point", "coordinates": [True, 2]}): "point at (True, 2); give finite numbers",
    feature({"type": "Point"}): "point with fewer than two coordinates; give longitude and latitude",
    feature({}): "its geometry is a None; give a Point, or columns lon and lat",
    feature(7): "geometry: not an object; give an object, or null",
    feature(POINT).replace("8.5", "1e999999999"):
        "point at (Decimal('1E+999999999'), Decimal('47.2…; give finite numbers",
    feature(size=1).replace("1", "1e999999999"): "size: not a finite number; leave it empty",
    feature(size=10**30): "size: integer of more than 64 bits; write it as text",
    feature(tags={"a": {"b": []}}): "tags: an object as a value; give text, a number, or a list of these",
    feature(tags=[{"a": 1}]): "tags: an object as a value; give text, a number, or a list of these",
    feature(tags=[1, None]): "tags: empty item in a list; fill the list, or leave it out",
    feature(tags=json.loads("[" * 40 + "1" + "]" * 40)): "tags: lists nested deeper than 8; flatten them",
    feature(tags=list(range(2_000))): "tags: a list of more than 1,000 items; shorten it",
    feature(tags=["x" * 70_000]): "tags: more than 65,536 characters; give a shorter text",
    feature(**{f"note{i}": "x" * 60_000 for i in range(20)}):
        "more than 1,048,576 characters in its properties; leave some out",
    feature(**{f"note{i}": i for i in range(2_000)}): "more than 1,000 properties; leave some out",
    feature(note="a\0b"): "note: NUL character; remove it",
    feature(note=1, Note=2): "note: given twice; give it once",
    feature(figure=7): "figure: 7 is not a path; give the path of a file as text",
    feature(**{" ": 1}): ": property without a name; name it",
    '{"type": "Feature", "properties": {"figure": "a", "figure": "b"}}': "figure: given twice; give it once",
    '{"type": "Feature", "properties": {"figure": "a"}, "properties": {"x": 1}}':
        "properties: given twice; give it once",
    '{"type": "Feature", "properties": null}': "no figure; give the path of its picture as figure",
    '{"type": "Feature", "properties": [1]}': "properties: not an object; give an object, or null",
    '{"type": "Point", "coordinates": [1, 2]}': "type Point where a Feature is expected; give features",
    '{"properties": {"figure": "a"}}': "no type where a Feature is expected; give features",
    "null": "not an object where a Feature is expected; give features",
    "[[1], {}]": "not an object where a Feature is expected; give features",
}
# fmt: on


@pytest.mark.parametrize("bad", BAD_FEATURES, ids=lambda bad: bad[:40])
@pytest.mark.parametrize("kind", ["collection", "lines", "records"])
def test_a_bad_feature_is_one_row(path, parser, bad, kind):
    features = [feature(POINT), bad, feature(POINT)]
    text = {
        "collection": document(*features),
        "lines": "\n".join(features),
        "records": "".join(f"\x1e{each}\n" for each in features),
    }[kind]
    found = rows_of(path, text)
    assert [row.problem for row in found] == [None, BAD_FEATURES[bad], None]
    word = {"collection": "feature", "lines": "line", "records": "record"}[kind]
    assert [row.where for row in found] == [f"{word} {i}" for i in (1, 2, 3)]


@pytest.mark.parametrize(
    "bad", ['{"type": ', "{", "x", "NaN", feature(a=1)[:-1], feature(a=1).replace("1", "NaN"), feature(a=1) + "1"]
)
def test_broken_json_is_the_problem_of_its_line(path, parser, bad):
    found = rows_of(path, "\n".join([feature(POINT), "", bad, feature(POINT)]))
    assert [row.where for row in found] == ["line 1", "line 3", "line 4"]
    assert found[0].problem is None
    assert found[2].problem is None
    assert found[1].problem.startswith("not JSON (")
    assert found[1].problem.endswith("); give valid JSON in UTF-8, with null for NaN")


def test_a_line_that_is_too_long_is_one_row(path, parser, monkeypatch):
    monkeypatch.setattr(geojson_rows, "MAX_LINE", 300)
    for separator in ("", "\x1e"):
        long = feature(POINT, note="x" * 200_000)
        found = rows_of(path, "".join(f"{separator}{each}\n" for each in (feature(POINT), long, feature(POINT))))
        assert [row.problem for row in found] == [None, "more than 300 bytes; simplify its geometry", None]


def test_features_of_any_order_and_layout_are_read(path, parser):
    assert len(rows_of(path, "\ufeff\n" + document(feature(), feature()))) == 2
    assert len(rows_of(path, feature(POINT))) == 1
    assert len(rows_of(path, json.dumps(json.loads(feature(POINT)), indent=2))) == 1
    assert len(rows_of(path, "\ufeff" + feature(POINT) + "\r\n\r\n" + feature(POINT))) == 2
    assert rows_of(path, document()) == []
    assert len(rows_of(path, '{"features": [' + feature() + '], "type": "FeatureCollection"}')) == 1
    pretty = json.dumps(json.loads(feature(POINT)), indent=2)
    assert len(rows_of(path, f"\x1e{pretty}\n\x1e\n\x1e{pretty}\n")) == 2
    lines = path.with_suffix(".geojsonl")
    assert len(rows_of(lines, json.dumps(json.loads(document(feature(), feature())), indent=2))) == 2
    assert [row.problem is None for row in rows_of(lines, "{\n" + feature())] == [False, True]


@pytest.mark.parametrize(
    "crs",
    [
        "urn:ogc:def:crs:OGC:1.3:CRS84",
        "urn:ogc:def:crs:OGC::CRS84",
        "OGC:CRS84",
        "EPSG:4326",
        "urn:ogc:def:crs:EPSG::4326",
        "http://www.opengis.net/def/crs/OGC/1.3/CRS84",
        "http://www.opengis.net/def/crs/EPSG/0/4326",
    ],
)
def test_wgs_84_by_any_name_is_read(path, parser, crs):
    member = json.dumps({"type": "name", "properties": {"name": crs}})
    assert len(rows_of(path, document(feature(POINT), before=f'"crs": {member},'))) == 1
    assert len(rows_of(path, document(feature(POINT), after=f', "crs": {member}'))) == 1
    assert len(rows_of(path, document(feature(POINT, crs="x"), before='"crs": null,'))) == 1


@pytest.mark.parametrize(
    ("crs", "shown"),
    [
        ({"type": "name", "properties": {"name": "EPSG:2056"}}, "EPSG:2056"),
        ({"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::43260"}}, "urn:ogc:def:crs:EPSG::43260"),
        ({"type": "link", "properties": {"href": "x"}}, "unknown"),
        ("EPSG:4326", "unknown"),
        (json.loads('{"a":' * 100 + "1" + "}" * 100), "unknown"),
    ],
)
@pytest.mark.parametrize("place", ["before", "after"])
def test_other_reference_systems_are_rejected_before_a_row_is_read(path, parser, crs, shown, place):
    text = f'"crs": {json.dumps(crs)},' if place == "before" else f', "crs": {json.dumps(crs)}'
    path.write_text(document(*[feature(POINT)] * 1_000, **{place: text}))
    with pytest.raises(InputError) as refused:
        next(read_rows(path))
    assert str(refused.value) == f"{path}: its crs is {shown}, not WGS 84; export it in WGS 84 (RFC 7946)"


JSON = "give valid JSON in UTF-8, with null for NaN"

# fmt: off
BROKEN = {
    document(feature(POINT))[:-2]: f"after feature 1, not JSON (*); {JSON}",
    document(feature(POINT), feature(a=1).replace("1", "NaN")): f"after feature 1, not JSON (*); {JSON}",
    document(feature(a=1).replace("1", "1" * 100_000)): "not JSON "
    f"(a number of more than 640 digits); {JSON}",
    document(feature(note="x" * 65_000, a=1).replace("1", "1" * 700)): "not JSON "
    f"(a number of more than 640 digits); {JSON}",
    document(feature(POINT)) + "x": f"after feature 1, not JSON (*); {JSON}",
    document(feature(note="x" * 3_000_000)): "not JSON "
    f"(more than 1,048,576 bytes without a new value); {JSON}",
    document(feature(POINT)) + " " * 3_000_000: "after feature 1, not JSON "
    f"(more than 1,048,576 bytes without a new value); {JSON}",
    "[" * 100_000: "not a JSON object; give a GeoJSON FeatureCollection",
    '{"a":' + "[" * 100_000: f"not JSON (*); {JSON}",
    "[" + feature() + "]": "not a JSON object; give a GeoJSON FeatureCollection",
    "7": "not a JSON object; give a GeoJSON FeatureCollection",
    "{}": "no features; give a GeoJSON FeatureCollection",
    '{"type": "FeatureCollection"}': "no features; give a GeoJSON FeatureCollection",
    '{"type": "FeatureCollection", "features": {}}': "features is not a list; give a GeoJSON FeatureCollection",
    '{"type": "FeatureCollection", "features": [], "features": []}':
        "two members named features; give one FeatureCollection",
    '{"type": "Topology", "objects": {}}': "type Topology; give a GeoJSON FeatureCollection",
    json.dumps(POINT): "type Point; give a GeoJSON FeatureCollection",
    document(feature(POINT)).encode("utf-16"): "UTF-16, or not a text file; save it as UTF-8",
    document(feature(POINT)).encode("utf-16-le"): "UTF-16, or not a text file; save it as UTF-8",
    document(feature(name="é")).encode().replace(rb"\u00e9", b"\xe9"):
        f"not JSON (*); {JSON}",
}
# fmt: on


@pytest.mark.parametrize("text", BROKEN, ids=lambda text: repr(text[:30]))
def test_files_that_are_not_geojson_are_rejected_in_one_line(path, parser, text):
    with pytest.raises(InputError) as refused:
        rows_of(path, text)
    before, _, after = BROKEN[text].partition("*")
    message = str(refused.value)
    assert message.startswith(f"{path}: {before}")
    assert message.endswith(after)
    assert message.isprintable()
    assert len(message) < len(str(path)) + 300


def test_what_is_not_needed_is_skipped_whatever_its_size(path, parser):
    big = {"type": "Polygon", "coordinates": [[[i, i] for i in range(50_000)]]}
    extra = json.dumps({"a": list(range(50_000))})
    item = feature(big, lon=1, lat=2)[:-1] + f', "links": {extra}}}'
    found = rows_of(path, document(item, item, before=f'"more": {extra},'))
    assert [row.problem for row in found] == [None, None]
