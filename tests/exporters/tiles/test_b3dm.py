"""Batched 3D models: the rules of the format, and that nothing of the figure is lost or changed."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from exporters.errors import ExportError
from exporters.gltf.glb import glb_bytes
from exporters.gltf.reader import glb_of
from exporters.tiles.b3dm import b3dm_bytes, read_b3dm
from exporters.tiles.tileset import write_tileset
from exporters.validate import validate
from exporters.write import check_outputs, write
from tests.exporters.analytic import ZURICH, asset, capsule

NAMES = ["", "a", "ab", "abc", "abcd", "abcde", "abcdef", "abcdefg"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("columns", [6, 7, 8, 9])
def test_everything_begins_and_ends_at_eight_bytes(name: str, columns: int) -> None:
    data = b3dm_bytes(glb_bytes(asset(ZURICH, lods=(capsule(columns, 2),), name=name or "x", copyright=name)), "a.glb")
    magic, version, total, *lengths = struct.unpack_from("<4s6I", data)
    assert (magic, version, total, len(data) % 8) == (b"b3dm", 1, len(data), 0)
    assert (28 + lengths[0]) % 8 == 0
    assert lengths[1] == lengths[3] == 0
    start = 28 + sum(lengths)
    assert start % 8 == 0
    assert data[start : start + 4] == b"glTF"
    assert struct.unpack_from("<I", data, start + 8)[0] == len(data) - start


def test_parts_are_in_the_batch_table_and_vertices_have_batch_ids() -> None:
    glb = glb_bytes(asset(ZURICH))
    tile = read_b3dm(b3dm_bytes(glb, "a.glb"))
    assert tile.feature_table == {"BATCH_LENGTH": 3}
    assert tile.batch_table["name"] == ["torso", "head", "l_upper_leg"]
    assert tile.batch_table["label"] == [1, 2, 9]
    assert tile.batch_table["observedShare"] == pytest.approx([0.5] * 3, abs=0.01)
    before, after = glb_of(glb, Path("a.glb")), glb_of(tile.glb, Path("b.glb"))
    attributes = after.items("meshes")[0]["primitives"][0]["attributes"]
    old = before.items("meshes")[0]["primitives"][0]["attributes"]
    assert set(attributes) == {"POSITION", "NORMAL", "TEXCOORD_0", "_BATCHID"}
    for key, accessor in attributes.items():
        was = old["_FEATURE_ID_0" if key == "_BATCHID" else key]
        assert np.array_equal(after.accessor(accessor), before.accessor(was))
    assert np.array_equal(after.mesh_arrays()[1], before.mesh_arrays()[1])
    assert after.image(0) == before.image(0)
    assert after.document["asset"] == before.document["asset"]
    assert "EXT_mesh_features" not in json.dumps(after.document)
    assert "EXT_structural_metadata" not in json.dumps(after.document)
    assert after.document["extensionsUsed"] == ["EXT_mesh_manifold", "KHR_materials_unlit", "KHR_xmp_json_ld"]
    # The names of the parts are not there twice.
    assert len(after.buffers[0]) < len(before.buffers[0])


def test_figures_without_parts_have_no_batches() -> None:
    tile = read_b3dm(b3dm_bytes(glb_bytes(asset(ZURICH, lods=(capsule(8, 2, parts=None),))), "a.glb"))
    assert (tile.feature_table, tile.batch_table) == ({"BATCH_LENGTH": 0}, {})
    assert b"_BATCHID" not in tile.glb


def test_a_tileset_of_version_1_0_is_clean(tmp_path: Path) -> None:
    write_tileset(asset(ZURICH), tmp_path, version="1.0")
    assert {file.name for file in tmp_path.iterdir()} == {
        "tileset.json",
        "farmer.b3dm",
        "farmer_lod1.b3dm",
        "farmer_lod2.b3dm",
    }
    document = json.loads((tmp_path / "tileset.json").read_text())
    assert document["asset"]["version"] == "1.0"
    assert document["extras"] == {"name": "farmer", "copyright": "© Zürich map, CC BY 4.0"}
    assert not {"schema", "metadata"} & set(document)
    assert validate(tmp_path, external=False) == []


def test_version_1_0_names_existing_files(tmp_path: Path) -> None:
    write(asset(ZURICH), tmp_path / "a", tiles_version="1.0")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "farmer.glb").write_bytes(b"")
    check_outputs([tmp_path / "b"], name="farmer", tiles_version="1.0")
    with pytest.raises(ExportError, match="already exists"):
        check_outputs([tmp_path / "b"], name="farmer")


def test_files_that_need_extensions_are_refused() -> None:
    glb = glb_of(glb_bytes(asset(ZURICH)), Path("a.glb"))
    document = glb.document | {"extensionsRequired": ["KHR_texture_basisu"]}
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary = glb.buffers[0]
    size = 28 + len(text) + len(binary)
    data = struct.pack("<4sIII4s", b"glTF", 2, size, len(text), b"JSON") + text
    data += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    with pytest.raises(ExportError, match="requires KHR_texture_basisu"):
        b3dm_bytes(data, "a.glb")
    with pytest.raises(ExportError, match=r"a\.glb: not a valid glTF file"):
        b3dm_bytes(b"glTF", "a.glb")


def _changed(data: bytes, place: int, value: int) -> bytes:
    return data[:place] + struct.pack("<I", value) + data[place + 4 :]


@pytest.mark.parametrize(
    ("place", "value"),
    [(4, 2), (8, 100), (12, 17), (12, 10**9), (20, 3)],
    ids=["version", "total", "odd", "huge", "table"],
)
def test_broken_headers_are_found(tmp_path: Path, place: int, value: int) -> None:
    write_tileset(asset(ZURICH, lods=(capsule(8, 2),)), tmp_path, version="1.0")
    file = tmp_path / "farmer.b3dm"
    file.write_bytes(_changed(file.read_bytes(), place, value))
    codes = {finding.code for finding in validate(tmp_path, external=False) if finding.severity == "error"}
    assert "B3DM" in codes


def test_batches_that_do_not_fit_are_found(tmp_path: Path) -> None:
    write_tileset(asset(ZURICH, lods=(capsule(8, 2),)), tmp_path, version="1.0")
    file = tmp_path / "farmer.b3dm"
    file.write_bytes(file.read_bytes().replace(b'"BATCH_LENGTH":3', b'"BATCH_LENGTH":2'))
    codes = {finding.code for finding in validate(tmp_path, external=False) if finding.severity == "error"}
    assert codes == {"BATCH_ID", "BATCH_TABLE"}
