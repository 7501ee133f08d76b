"""The STAC catalogue, validated and walked by PySTAC and stac-pydantic, without the network."""

from __future__ import annotations

import gc
import hashlib
import json
import math
import re
import shutil
import socket
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urljoin

import pystac
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pystac.validation.stac_validator import JsonSchemaSTACValidator
from stac_pydantic import Collection, Item

from exporters.atomic_file import TEMPORARY
from exporters.errors import ExportError
from exporters.gis.geojson import feature
from exporters.gis.stac import RESERVED, StacFile, StacItem, item_document, stac_file, write_stac
from exporters.gis.stac_extent import Longitudes
from exporters.media_types import media_type
from exporters.placed_figure import PlacedFigure
from georef.placement import GeoPlacement
from tests.exporters.analytic import ZURICH
from tests.exporters.tables import figure, tables, values
from tests.georef.strategies import longitudes

NAMES = ("anna", "Bäuerin_7_", "龍", "x.y-z")
DATES = ("1893", "2024-05-17T12:00:00+02:00", "1600-02/1610", "1950-06-01")
SCHEMAS = JsonSchemaSTACValidator()
ENDS = (".glb", "_lod1.glb", ".usdz", "_texture.png", ".czml", ".report.json")


@pytest.fixture(autouse=True)
def no_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever wants to connect to anything fails."""

    def refuse(*_: object) -> None:
        raise AssertionError("a connection is opened")

    monkeypatch.setattr(socket.socket, "connect", refuse)
    monkeypatch.setattr(socket, "getaddrinfo", refuse)


def _validate(document: dict[str, Any]) -> None:
    """By the JSON schemas that come with PySTAC, with those of the extensions left out, and by the models."""
    kind = pystac.STACObjectType.ITEM if document["type"] == "Feature" else pystac.STACObjectType.COLLECTION
    uri = SCHEMAS.validate_core(document, kind, document["stac_version"])
    assert uri is not None
    assert uri.startswith("https://schemas.stacspec.org/v1.1.0/")
    (Item if document["type"] == "Feature" else Collection).model_validate(document)


def _items(folder: Path) -> Iterator[StacItem]:
    for number, (name, date) in enumerate(zip(NAMES, DATES, strict=True)):
        place = GeoPlacement(170.0 + 4 * number - 360 * (number > 2), 10.0 * number, 5.0 * number)
        (folder / name).mkdir(parents=True, exist_ok=True)
        paths = [f"{name}/{name}{end}" for end in ENDS] + [f"{name}/tiles/tileset.json"]
        (folder / name / "tiles").mkdir(exist_ok=True)
        for path in paths:
            (folder / path).write_text(path * number)
        attributes = {"artist": "A. N.", "year": 1893, "title": "Map", "created": "ca. 1893", "empty": None}
        files = tuple(stac_file(folder, path) for path in paths)
        yield StacItem(figure(name, place, attributes), name, files, date)


def _write(folder: Path, **options: Any) -> int:
    folder.mkdir(parents=True, exist_ok=True)
    items = list(_items(folder))
    for name in ("tileset.json", "index.geojson", "index.gpkg", "manifest.jsonl"):
        (folder / name).write_text(name)
    files = [stac_file(folder, name) for name in ("tileset.json", "index.geojson", "index.gpkg", "manifest.jsonl")]
    return write_stac(items, folder, id="swiss-maps", title="Maps", files=files, **options)


def _read(path: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return document


def _bytes(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_pystac_walks_all_items_and_assets(tmp_path: Path) -> None:
    assert _write(tmp_path / "out", license="CC-BY-4.0", keywords=("maps",)) == 4
    shutil.move(tmp_path / "out", tmp_path / "mövéd")
    collection = pystac.Collection.from_file(str(tmp_path / "mövéd" / "collection.json"))
    assert collection.license == "CC-BY-4.0"
    assert collection.catalog_type == pystac.CatalogType.SELF_CONTAINED
    items = list(collection.get_items(recursive=True))
    assert [item.id for item in items] == list(NAMES)
    count = 0
    for owner in (collection, *items):
        for asset in owner.assets.values():
            data = Path(str(asset.get_absolute_href())).read_bytes()
            assert asset.extra_fields["file:size"] == len(data)
            assert asset.extra_fields["file:checksum"] == "1220" + hashlib.sha256(data).hexdigest()
            count += 1
    assert count == 4 + 4 * (len(ENDS) + 1)
    for item in items:
        assert item.get_collection() is not None
        assert item.get_root() is item.get_parent() is collection
    assert {path.name for path in (tmp_path / "mövéd" / "龍").iterdir()} == {
        "tiles",
        "龍.stac.json",
        *("龍" + end for end in ENDS),
    }


def test_everything_is_valid(tmp_path: Path) -> None:
    _write(tmp_path, license_link="https://example.org/license")
    documents = [_read(tmp_path / "collection.json"), *(_read(tmp_path / n / f"{n}.stac.json") for n in NAMES)]
    for document in documents:
        _validate(document)
        assert document["stac_extensions"] == ["https://stac-extensions.github.io/file/v2.1.0/schema.json"]
        for asset in document["assets"].values():
            assert re.fullmatch("[0-9a-f]{68}", asset["file:checksum"])
            assert {key for key in asset if key.startswith("file:")} == {"file:size", "file:checksum"}
    assert {"rel": "license", "href": "https://example.org/license"} in documents[0]["links"]


def test_the_validators_report_faults(tmp_path: Path) -> None:
    _write(tmp_path)
    document = _read(tmp_path / "anna" / "anna.stac.json")
    with pytest.raises(pystac.STACValidationError):
        _validate(document | {"properties": document["properties"] | {"created": "ca. 1893"}})


@pytest.mark.parametrize("date", DATES)
def test_dates_of_items(tmp_path: Path, date: str) -> None:
    item = StacItem(figure("a", ZURICH), "a", (), date)
    properties = item_document(item, "c")["properties"]
    if "T" in date:
        assert properties["datetime"] == "2024-05-17T10:00:00Z"
        assert "start_datetime" not in properties
    else:
        assert properties["datetime"] is None
        assert properties["start_datetime"] < properties["end_datetime"]


def test_assets_have_types_and_roles(tmp_path: Path) -> None:
    _write(tmp_path)
    found = {
        key: (asset["href"], asset["type"], asset["roles"])
        for key, asset in _read(tmp_path / "anna" / "anna.stac.json")["assets"].items()
    }
    assert found == {
        "glb": ("./anna.glb", "model/gltf-binary", ["data"]),
        "lod1.glb": ("./anna_lod1.glb", "model/gltf-binary", ["data"]),
        "usdz": ("./anna.usdz", "model/vnd.usdz+zip", ["data"]),
        "texture.png": ("./anna_texture.png", "image/png", ["texture"]),
        "czml": ("./anna.czml", "application/json", ["data"]),
        "report.json": ("./anna.report.json", "application/json", ["metadata"]),
        "tiles/tileset.json": ("./tiles/tileset.json", "application/json", ["data"]),
    }
    above = _read(tmp_path / "collection.json")["assets"]
    assert above["tileset.json"]["title"] == "tileset.json (3D Tiles)"
    assert above["index.gpkg"]["type"] == "application/geopackage+sqlite3"


def test_roles_of_the_caller_win_and_unknown_files_are_bytes() -> None:
    files = (StacFile("a/a.png", 1, "AB" * 32, ("overview",)), StacFile("a/a.xyz", 1, "00" * 32))
    assets = item_document(StacItem(figure("a", ZURICH), "a", files, "1893"), "c")["assets"]
    assert assets["png"]["roles"] == ["overview"]
    assert assets["png"]["file:checksum"] == "1220" + "ab" * 32
    assert assets["xyz"]["type"] == media_type("a").type == "application/octet-stream"


def test_keys_of_assets_are_never_shared() -> None:
    paths = ("anna/anna.glb", "anna/glb", "anna/anna-glb", "anna/annabel.glb", "anna/anna", "anna/anna.")
    files = tuple(StacFile(path, 1, "00" * 32) for path in paths)
    assets = item_document(StacItem(figure("a", ZURICH), "anna", files, "1893"), "c")["assets"]
    assert list(assets) == ["glb", "glb_", "glb__", "annabel.glb", "anna", "anna."]
    assert [asset["href"] for asset in assets.values()] == [f"./{path[5:]}" for path in paths]


@settings(max_examples=40, deadline=None)
@given(tables())
def test_properties_are_those_of_geojson(figures: list[PlacedFigure]) -> None:
    for each in figures:
        document = item_document(StacItem(each, "a", (), "1893"), "c")
        _validate(document)
        expected = feature(each, "model.glb")
        assert document["geometry"] == expected["geometry"]
        assert document["bbox"] == expected["geometry"]["coordinates"] * 2
        for name, value in expected["properties"].items():
            if name.casefold() not in RESERVED and name != "model" and "_" not in name:
                assert document["properties"].get(name) == value
        # Names differ where STAC has a meaning for them, values and their order do not.
        own = list(document["properties"].values())[4:]
        assert own == [v for k, v in expected["properties"].items() if v is not None and k != "model"]


@settings(max_examples=50, deadline=None)
@given(st.dictionaries(st.sampled_from([*RESERVED, "Title", "CREATED", "links", "proj:epsg"]), values))
def test_columns_never_break_what_stac_defines(attributes: dict[str, object]) -> None:
    document = item_document(StacItem(figure("a", ZURICH, attributes), "a", (), "1893"), "c")
    _validate(document)
    assert document["properties"]["title"] == "a"
    assert document["properties"]["datetime"] is None


def test_the_extent_crosses_the_antimeridian(tmp_path: Path) -> None:
    _write(tmp_path)
    extent = _read(tmp_path / "collection.json")["extent"]
    assert extent["spatial"]["bbox"] == [[170.0, 0.0, 0.0, -178.0, 30.0, 15.0]]
    assert extent["temporal"]["interval"] == [["1600-02-01T00:00:00Z", "2024-05-17T10:00:00Z"]]


def test_heights_are_in_the_extent_only_if_all_have_one(tmp_path: Path) -> None:
    clamped = GeoPlacement(8.0, 47.0, 3.0, altitude_mode="clamp")
    items = [StacItem(figure(name, place), name, (), "1893") for name, place in (("a", ZURICH), ("b", clamped))]
    write_stac(items, tmp_path, id="c")
    assert _read(tmp_path / "collection.json")["extent"]["spatial"]["bbox"] == [[8.0, 47.0, 8.5417, 47.3769]]
    assert _read(tmp_path / "b" / "b.stac.json")["bbox"] == [8.0, 47.0, 8.0, 47.0]


@given(st.lists(longitudes, min_size=1, max_size=12))
def test_the_interval_of_longitudes_contains_all_and_is_the_shortest(values: list[float]) -> None:
    def ends(numbers: list[float]) -> tuple[float, float]:
        found = Longitudes()
        for number in numbers:
            found.add(number)
        return found.ends()

    west, east = ends(values)
    assert ends(values[::-1]) == (west, east)
    for value in values:
        assert west <= value <= east if west <= east else (value >= west or value <= east)
    ordered = sorted(values)
    gaps = [after - before for before, after in pairwise(ordered)]
    shortest = 360 - max([*gaps, ordered[0] + 360 - ordered[-1]])
    assert (east - west) % 360 == pytest.approx(shortest, abs=0.1) or math.isclose(shortest, 360, abs_tol=0.1)


def test_no_figures_are_a_valid_collection(tmp_path: Path) -> None:
    assert write_stac([], tmp_path, id="empty") == 0
    document = _read(tmp_path / "collection.json")
    _validate(document)
    assert document["extent"] == {
        "spatial": {"bbox": [[-180.0, -90.0, 180.0, 90.0]]},
        "temporal": {"interval": [[None, None]]},
    }
    assert list(pystac.Collection.from_file(str(tmp_path / "collection.json")).get_items()) == []


@pytest.mark.parametrize("name", ["a b", "50%", "a?b#c", "a:b", "ä & ö", "a'b\"c"])
def test_references_are_iris(tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    (tmp_path / name / f"{name}.glb").write_bytes(b"x")
    item = StacItem(figure(name, ZURICH), name, (stac_file(tmp_path, f"{name}/{name}.glb"),), "1893")
    write_stac([item], tmp_path, id="c")
    base = "https://example.org/maps/collection.json"
    (link,) = [each["href"] for each in _read(tmp_path / "collection.json")["links"] if each["rel"] == "item"]
    assert not set(link) & set(" \"'<>\\^`{|}?#:")
    address = urljoin(base, link)
    assert unquote(address) == f"https://example.org/maps/{name}/{name}.stac.json"
    document = _read(tmp_path / name / f"{name}.stac.json")
    _validate(document)
    assert unquote(urljoin(address, document["assets"]["glb"]["href"])) == f"https://example.org/maps/{name}/{name}.glb"
    assert urljoin(address, document["links"][0]["href"]) == base


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "a\\b"])
def test_an_id_is_the_name_of_a_folder(name: str) -> None:
    with pytest.raises(ValueError, match="is not a folder name"):
        StacItem(figure("a", ZURICH), name, (), "1893")


def test_the_same_figures_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one", "two", "two"):
        _write(tmp_path / name)
    assert _bytes(tmp_path / "one") == _bytes(tmp_path / "two")


def test_failures_leave_the_old_collection(tmp_path: Path) -> None:
    write_stac([], tmp_path, id="old")
    items = [StacItem(figure("a", ZURICH), "a", (), "1893"), StacItem(figure("b", ZURICH), "b", (), "around 1893")]
    with pytest.raises(ExportError, match="date of b: 'around 1893' is not an ISO 8601 date"):
        write_stac(items, tmp_path, id="new")
    with pytest.raises(ValueError, match="license 'of my own' is not an identifier"):
        write_stac(items, tmp_path, id="new", license="of my own")
    assert _read(tmp_path / "collection.json")["id"] == "old"
    assert sorted(_bytes(tmp_path)) == ["a/a.stac.json", "collection.json"]


def test_items_are_written_one_by_one(tmp_path: Path) -> None:
    alive, links = [], []

    def items() -> Iterator[StacItem]:
        for number in range(400):
            if number % 100 == 99:
                gc.collect()
                alive.append(sum(type(each) in (StacItem, PlacedFigure) for each in gc.get_objects()))
                links.append(next(tmp_path.glob(f"{TEMPORARY}/collection.json")).stat().st_size)
                assert (tmp_path / f"f{number - 1}" / f"f{number - 1}.stac.json").is_file()
            yield StacItem(figure("a", ZURICH), f"f{number}", (), "1893")

    gc.collect()
    before = sum(type(each) in (StacItem, PlacedFigure) for each in gc.get_objects())
    assert write_stac(items(), tmp_path, id="c") == 400
    assert max(alive) <= before + 4
    assert all(later - earlier > 5000 for earlier, later in pairwise(links))
