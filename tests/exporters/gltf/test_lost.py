"""Files that tools rewrote: what they dropped is reported, and the rest is read."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from exporters.errors import ExportError
from exporters.figure_reader import read_figure
from exporters.gltf.container import join_glb, split_glb
from exporters.gltf.glb import glb_bytes
from exporters.gltf.reader import read_gltf
from exporters.inspect import inspect
from exporters.tiles.gather import write_figures
from exporters.validate import validate
from fig2mesh.render.model import read_model
from tests.exporters.analytic import EXACT_VOLUME, HEIGHT, ZURICH, asset, capsule
from tests.exporters.outlined import hulled
from tests.node import runner

Document = dict[str, Any]

PLAIN = glb_bytes(asset(ZURICH, lods=(capsule(16, 4),), observed_pixels=False))
MASKED = glb_bytes(asset(ZURICH, lods=(hulled(capsule(16, 4)),)))

WHOLE = ("meshes", 0)
FACE = ("meshes", 0, "primitives", 0)
TABLE = ("extensions", "EXT_structural_metadata")


def _parsed(data: bytes) -> tuple[Document, bytes]:
    text, binary = split_glb(data)
    assert binary is not None
    return json.loads(bytes(text)), bytes(binary)


def _joined(document: Document, binary: bytes) -> bytes:
    text = json.dumps(document).encode()
    return join_glb(text + b" " * (-len(text) % 4), binary)


def _rewritten(folder: Path, change: Callable[[Document], Any], data: bytes = PLAIN) -> Path:
    document, binary = _parsed(data)
    change(document)
    path = folder / "a.glb"
    path.write_bytes(_joined(document, binary))
    return path


def _put(*keys: str | int, value: Any) -> Callable[[Document], None]:
    def change(document: Document) -> None:
        item: Any = document
        for key in keys[:-1]:
            item = item[key]
        item[keys[-1]] = value

    return change


def _like_gltf_pipeline(document: Document) -> None:
    """Drop the accessors that only an unknown extension refers to, and keep the extension."""
    solid = document["meshes"][0]["extensions"]["EXT_mesh_manifold"]
    first = min(solid["mergeIndices"], solid["mergeValues"], solid["manifoldPrimitive"]["indices"])
    del document["accessors"][first:]


MANIFOLD = (*WHOLE, "extensions", "EXT_mesh_manifold")
FEATURES = (*FACE, "extensions", "EXT_mesh_features")

LOST: dict[str, tuple[Callable[[Document], Any], str]] = {
    "gltf-pipeline": (_like_gltf_pipeline, "EXT_mesh_manifold of meshes/0 names accessor"),
    "merges gone": (_put(*MANIFOLD, "mergeIndices", value=77), "names accessor 77 of"),
    "another accessor": (_put(*MANIFOLD, "manifoldPrimitive", "indices", value=1), "which holds something else"),
    "no primitive": (_put(*MANIFOLD, value={}), "EXT_mesh_manifold of meshes/0 is damaged"),
    "a list": (_put(*MANIFOLD, value=[]), "EXT_mesh_manifold of meshes/0 is damaged"),
    "a number": (_put(*WHOLE, "extensions", value=3), "the extensions of meshes/0 are not an object"),
    "part names gone": (
        _put(*TABLE, "propertyTables", 0, "properties", "name", "values", value=99),
        "EXT_structural_metadata of the file names bufferView 99 of",
    ),
    "tables gone": (_put(*TABLE, "propertyTables", value=[]), "names a property table, and there is none"),
    "metadata gone": (_put("extensions", value={}), "names a property table, and there is none"),
    "schema gone": (_put(*TABLE, "schema", value={}), "that its schema does not describe"),
    "tables of text": (_put(*TABLE, "propertyTables", value="x"), "EXT_structural_metadata of the file is damaged"),
    "another attribute": (_put(*FEATURES, "featureIds", 0, "attribute", value=4), "names the attribute _FEATURE_ID_4"),
    "features of text": (_put(*FEATURES, "featureIds", value="x"), "EXT_mesh_features of meshes/0/primitives/0 is"),
    "surface gone": (
        _put(*FACE, "extensions", "EXT_structural_metadata", value={"propertyTextures": [3]}),
        "names property texture 3 of 0",
    ),
}


@pytest.mark.parametrize("name", LOST)
def test_what_was_lost_is_a_warning_and_the_rest_is_read(tmp_path: Path, name: str) -> None:
    change, expected = LOST[name]
    path = _rewritten(tmp_path, change)
    facts = inspect(path)
    assert facts["watertight"]
    assert facts["volume_m3"] == pytest.approx(EXACT_VOLUME, rel=0.06)
    assert any(expected in note for note in facts["notes"])
    findings = [each for each in validate(path, external=False) if each.severity != "info"]
    assert {each.severity for each in findings} == {"warning"}
    assert any(expected in each.message and each.code == "LOST_EXTENSION" for each in findings)
    assert read_figure(path).high[2] == pytest.approx(HEIGHT)
    write_figures([path], tmp_path / "tiles")
    assert len(read_model(path).faces) == facts["triangles"]


def test_files_as_written_have_lost_nothing(tmp_path: Path) -> None:
    for data in (PLAIN, MASKED):
        path = _rewritten(tmp_path, lambda document: None, data)
        assert inspect(path)["notes"] is None
        assert validate(path, external=False) == []


def test_property_textures_that_name_no_texture_are_lost(tmp_path: Path) -> None:
    path = _rewritten(tmp_path, lambda document: document["textures"].pop(), MASKED)
    assert any("names texture 1 of 1" in note for note in inspect(path)["notes"])
    assert {each.severity for each in validate(path, external=False)} <= {"warning", "info"}


def test_order_of_meshes_and_names_do_not_matter(tmp_path: Path) -> None:
    def change(document: Document) -> None:
        document["meshes"].reverse()
        for node in document["nodes"]:
            node.pop("name", None)
            node["mesh"] = 1 - node["mesh"]
        for material in document["materials"]:
            material.pop("name", None)

    whole, moved = _rewritten(tmp_path, lambda document: None, MASKED), tmp_path / "b"
    moved.mkdir()
    path = _rewritten(moved, change, MASKED)
    before, after = inspect(whole), inspect(path)
    assert {key: before[key] for key in ("triangles", "watertight", "parts", "observed", "outline")} == {
        key: after[key] for key in ("triangles", "watertight", "parts", "observed", "outline")
    }
    assert read_figure(path).observed == read_figure(whole).observed


def test_a_mesh_that_is_not_decoded_has_the_size_that_the_file_states(tmp_path: Path) -> None:
    def change(document: Document) -> None:
        packed = {"bufferView": 0, "attributes": {"POSITION": 0}}
        document["meshes"][0]["primitives"][0].setdefault("extensions", {})["KHR_draco_mesh_compression"] = packed
        document["extensionsUsed"].append("KHR_draco_mesh_compression")
        document["extensionsRequired"] = ["KHR_draco_mesh_compression"]

    path = _rewritten(tmp_path, change)
    facts = inspect(path)
    assert facts["size_m"][1] == pytest.approx(HEIGHT)
    assert facts["triangles"] == len(capsule(16, 4).faces)
    assert "the mesh is not decoded here (compressed with Draco)" in facts["notes"]
    assert "error" not in {each.severity for each in validate(path, external=False)}
    write_figures([path], tmp_path / "tiles")
    with pytest.raises(ExportError, match="draco"):
        read_model(path)


def test_gltf_transform_drops_what_it_does_not_know(tmp_path: Path, codecs: Path) -> None:
    given = _rewritten(tmp_path, lambda document: None)
    runner(codecs)("decompress_gltf.mjs", given, tmp_path / "b.glb")
    before, after = inspect(given), inspect(tmp_path / "b.glb")
    assert {key: before[key] for key in ("triangles", "watertight", "placement")} == {
        key: after[key] for key in ("triangles", "watertight", "placement")
    }
    assert not [each for each in validate(tmp_path / "b.glb", external=False) if each.severity == "error"]
    assert read_figure(tmp_path / "b.glb").placement == read_figure(given).placement


def _places(value: Any, path: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """Paths of all values within extensions and extras."""
    inside = "extensions" in path or "extras" in path
    found = [path] if inside else []
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return found + [place for key, inner in items for place in _places(inner, (*path, key))]


PLACES = _places(_parsed(MASKED)[0])
ODD = st.one_of(st.none(), st.integers(-1, 99), st.text(max_size=3), st.just([]), st.just({}), st.just([{}]))


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(PLACES), ODD)
def test_no_value_in_extensions_or_extras_is_an_internal_error(
    tmp_path_factory: pytest.TempPathFactory, place: tuple[str | int, ...], value: Any
) -> None:
    document, binary = _parsed(MASKED)
    _put(*place, value=copy.deepcopy(value))(document)
    path = tmp_path_factory.getbasetemp() / "mutated.glb"
    path.write_bytes(_joined(document, binary))
    validate(path, external=False)
    for read in (inspect, read_figure, read_model):
        with suppress(ExportError):
            read(path)
    assert read_gltf(path).document["meshes"]
