"""Assets of a globe: accepted files, their dependencies, and rejected files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from exporters.gis.czml import write_czml
from exporters.gltf.glb import write_glb, write_gltf
from exporters.tiles.tileset import write_tileset
from fig2mesh.errors import InputError
from fig2mesh.globe.assets import find_assets
from fig2mesh.globe.page import Overlay, globe_page, page_files
from tests.exporters.analytic import ZURICH, asset, capsule
from tests.fig2mesh.parse import scenes


@pytest.fixture
def figure(tmp_path: Path) -> Path:
    path = tmp_path / "farmer.glb"
    write_glb(asset(ZURICH, lods=(capsule(6, 2),)), path)
    return path


def write_json(path: Path, document: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def tileset_of(*uris: str, **more: Any) -> dict[str, Any]:
    sphere = {"sphere": [0, 0, 0, 1]}
    tiles = [{"boundingVolume": sphere, "geometricError": 0, "content": {"uri": uri}} for uri in uris]
    root = {"boundingVolume": sphere, "geometricError": 1, "refine": "ADD", "children": tiles, **more}
    return {"asset": {"version": "1.1"}, "geometricError": 1, "root": root}


def test_a_model_brings_its_place_credit_and_size(figure: Path) -> None:
    (found,) = find_assets((figure,))
    assert (found.kind, found.files, found.folder) == ("model", ("farmer.glb",), figure.parent)
    facts = found.facts
    assert (facts["name"], facts["credit"]) == ("farmer", "© Zürich map, CC BY 4.0")
    assert facts["metadata"] == {"source": "farmer.png", "seed": 7}
    assert facts["triangles"] == len(capsule(6, 2).faces)
    assert facts["place"]["lon_deg"] == ZURICH.lon_deg
    assert facts["place"]["entity_heading_deg"] == ZURICH.heading_deg - 90


def test_a_model_in_pieces_brings_them(tmp_path: Path) -> None:
    write_gltf(asset(ZURICH, lods=(capsule(6, 2),)), tmp_path / "farmer.gltf")
    (found,) = find_assets((tmp_path / "farmer.gltf",))
    assert set(found.files) == {"farmer.gltf", "farmer.bin", "farmer_texture.png"}


def test_a_tileset_brings_all_its_levels(tmp_path: Path) -> None:
    write_tileset(asset(ZURICH), tmp_path)
    for given in (tmp_path, tmp_path / "tileset.json"):
        (found,) = find_assets((given,))
        assert found.kind == "tileset"
        assert set(found.files) == {"tileset.json", "farmer.glb", "farmer_lod1.glb", "farmer_lod2.glb"}
        assert (found.facts["name"], found.facts["credit"]) == ("farmer", "© Zürich map, CC BY 4.0")


def test_tilesets_in_tilesets_are_followed(tmp_path: Path, figure: Path) -> None:
    write_json(tmp_path / "tileset.json", tileset_of("deep/one%20more.json"))
    write_json(tmp_path / "deep" / "one more.json", tileset_of("a.glb", "../farmer.glb", "../tileset.json"))
    (tmp_path / "deep" / "a.glb").write_bytes(figure.read_bytes())
    found = find_assets((tmp_path,))
    addresses = page_files(found)
    assert set(addresses) == {
        "assets/0/tileset.json",
        "assets/0/deep/one more.json",
        "assets/0/deep/a.glb",
        "assets/0/farmer.glb",
    }
    assert all(path.is_file() for path in addresses.values())


def test_nothing_outside_of_a_tilesets_folder_is_served(tmp_path: Path, figure: Path) -> None:
    write_json(tmp_path / "tiles" / "tileset.json", tileset_of("../farmer.glb"))
    with pytest.raises(InputError, match="outside"):
        page_files(find_assets((tmp_path / "tiles",)))


def test_czml_brings_its_models_and_folders_their_files(tmp_path: Path, figure: Path) -> None:
    write_czml(asset(ZURICH, lods=(capsule(6, 2),)), tmp_path / "farmer.czml")
    write_json(tmp_path / "index.geojson", {"type": "FeatureCollection", "features": []})
    found = find_assets((tmp_path,))
    assert {each.kind: each.files for each in found} == {
        "model": ("farmer.glb",),
        "geojson": ("index.geojson",),
        "czml": ("farmer.czml", "farmer.glb"),
    }


CASES = [
    ("no.glb", None, "no such file"),
    ("picture.png", "x", r"unknown suffix \.png"),
    ("cut.glb", "glTF", "not a valid glTF file"),
    ("tileset.json", "{", "not JSON"),
    ("tileset.json", "[1]", "not a tileset"),
    ("tileset.json", json.dumps(tileset_of("gone.glb")), "gone.glb"),
    ("tileset.json", json.dumps(tileset_of("https://tiles.example/a.glb")), "not a local file"),
    ("tileset.json", json.dumps(tileset_of(implicitTiling={})), "implicit"),
    ("tileset.json", json.dumps({"asset": {}, "root": {"children": [3]}}), "damaged"),
    ("people.czml", '[{"id": "x"}]', "not a CZML file"),
    ("people.czml", '[{"id": "document"}, {"model": {"gltf": "gone.glb"}}]', "gone.glb"),
    ("places.geojson", '{"type": "Point"}', "not a GeoJSON file"),
]


@pytest.mark.parametrize(("name", "content", "finding"), CASES)
def test_what_is_rejected(tmp_path: Path, name: str, content: str | None, finding: str) -> None:
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=finding) as caught:
        find_assets((tmp_path / name,))
    assert "\n" not in str(caught.value)


def test_a_model_without_a_place_is_rejected(tmp_path: Path) -> None:
    write_glb(asset(lods=(capsule(6, 2),)), tmp_path / "nowhere.glb")
    with pytest.raises(InputError, match="--lonlat"):
        find_assets((tmp_path / "nowhere.glb",))
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"no tileset\.json"):
        find_assets((tmp_path / "empty",))


@pytest.mark.parametrize(
    "edges", [(8, 47, 8, 48), (9, 47, 8, 48), (8, 48, 9, 47), (8, 47, 9, 91), (float("nan"), 47, 9, 48)]
)
def test_overlays_need_a_rectangle(tmp_path: Path, edges: tuple[float, float, float, float]) -> None:
    (tmp_path / "map.png").write_bytes(b"")
    with pytest.raises(InputError, match="--overlay"):
        Overlay(tmp_path / "map.png", *edges)


def test_overlays_that_are_to_be_turned_are_refused(tmp_path: Path) -> None:
    """Browsers turn a picture by its EXIF data, and not by XMP."""
    path = tmp_path / "map.png"
    for chunks in (scenes.chunk(b"eXIf", scenes.exif(6)[6:]), scenes.itxt(scenes.xmp(3))):
        path.write_bytes(scenes.png(scenes.scene(), before=chunks))
        with pytest.raises(InputError, match="rotated by its EXIF orientation; save it upright"):
            Overlay(path, 8, 47, 9, 48)
    path.write_bytes(scenes.png(scenes.scene()))
    assert Overlay(path, 8, 47, 9, 48).image == path
    path.write_bytes(b"no picture")
    with pytest.raises(InputError, match="cannot be read"):
        Overlay(path, 8, 47, 9, 48)


def test_the_page_closes_no_script_early_and_names_no_server(tmp_path: Path, figure: Path) -> None:
    mean = tmp_path / "a < b.glb"
    write_glb(asset(ZURICH, lods=(capsule(6, 2),), copyright="</script><script>alert(1)</script>", name="a < b"), mean)
    page = globe_page(find_assets((mean, figure)))
    assert "<script>alert" not in page
    assert "<title>a &lt; b, farmer</title>" in page
    assert "http://" not in page
    assert "https://" not in page
