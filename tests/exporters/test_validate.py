"""The checks find planted faults, each by its name, and nothing in sound files (see the tests of the writers)."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, Vt

from exporters.errors import ExportError
from exporters.findings import Finding
from exporters.validate import validate
from exporters.write import write
from tests.exporters.analytic import ZURICH, asset, capsule

Document = dict[str, Any]

SMALL = asset(ZURICH, lods=(capsule(8, 2), capsule(6, 2, deviation_m=(0.01, 0.03))))


def _codes(findings: list[Finding], severity: str = "error") -> set[str]:
    return {finding.code for finding in findings if finding.severity == severity}


def _set(*keys: str | int, to: Any) -> Callable[[Document], None]:
    def change(document: Document) -> None:
        item: Any = document
        for key in keys[:-1]:
            item = item[key]
        if to is _REMOVED:
            del item[keys[-1]]
        else:
            item[keys[-1]] = to

    return change


_REMOVED = object()
_PRIMITIVE = ("meshes", 0, "primitives", 0)
_TABLE = ("extensions", "EXT_structural_metadata", "propertyTables", 0)

GLTF_FAULTS: dict[str, tuple[Callable[[Document], None], str]] = {
    "version": (_set("asset", "version", to="1.0"), "VERSION"),
    "no mesh": (_set("meshes", to=[]), "NO_MESH"),
    "wrong max": (_set("accessors", 1, "max", to=[9, 9, 9]), "MIN_MAX"),
    "no min": (_set("accessors", 1, "min", to=_REMOVED), "MIN_MAX"),
    "accessor out of bounds": (_set("accessors", 0, "count", to=999_999), "ACCESSOR"),
    "view out of bounds": (_set("bufferViews", 1, "byteLength", to=10**7), "ACCESSOR"),
    "attribute of another length": (_set("accessors", 2, "count", to=3), "ATTRIBUTE_COUNT"),
    "open triangle": (_set("accessors", 0, "count", to=4), "NOT_TRIANGLES"),
    "image gone": (_set("images", 0, "uri", to="gone.png"), "IMAGE"),
    "no schema id": (_set("extensions", "EXT_structural_metadata", "schema", "id", to=_REMOVED), "SCHEMA_ID"),
    "table of another length": (_set(*_TABLE, "count", to=7), "STRING_OFFSETS"),
    "too few features": (
        _set(*_PRIMITIVE, "extensions", "EXT_mesh_features", "featureIds", 0, "featureCount", to=1),
        "FEATURE_ID",
    ),
    "no such table": (
        _set(*_PRIMITIVE, "extensions", "EXT_mesh_features", "featureIds", 0, "propertyTable", to=5),
        "PROPERTY_TABLE",
    ),
    "merges of other vertices": (
        _set("meshes", 0, "extensions", "EXT_mesh_manifold", "mergeIndices", to=_REMOVED),
        "MANIFOLD",
    ),
    "no merges": (
        _set("meshes", 0, "extensions", "EXT_mesh_manifold", "manifoldPrimitive", "indices", to=0),
        "NOT_CLOSED",
    ),
}


@pytest.mark.parametrize("fault", GLTF_FAULTS)
def test_faults_of_gltf_documents(tmp_path: Path, fault: str) -> None:
    change, code = GLTF_FAULTS[fault]
    write(SMALL, tmp_path / "a.gltf")
    document = json.loads((tmp_path / "a.gltf").read_text())
    change(document)
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    assert code in _codes(validate(tmp_path / "a.gltf", external=False))


def _buffer(folder: Path, name: str) -> tuple[int, Document]:
    document = json.loads((folder / "a.gltf").read_text())
    accessor = next(accessor for accessor in document["accessors"] if accessor["name"] == name)
    return document["bufferViews"][accessor["bufferView"]]["byteOffset"], document


@pytest.mark.parametrize(
    ("name", "value", "code"),
    [
        ("position", struct.pack("<f", float("nan")), "NOT_FINITE"),
        ("position", struct.pack("<f", 5.0), "MIN_MAX"),
        ("normal", struct.pack("<3f", 2, 2, 2), "NORMAL_LENGTH"),
        ("indices", struct.pack("<H", 60000), "UNREADABLE_MESH"),
        ("indices", struct.pack("<3H", 0, 0, 0), "DEGENERATE_TRIANGLE"),
        ("merged vertices", struct.pack("<H", 30), "MANIFOLD"),
    ],
)
def test_faults_of_gltf_buffers(tmp_path: Path, name: str, value: bytes, code: str) -> None:
    write(SMALL, tmp_path / "a.gltf")
    data = bytearray((tmp_path / "a.bin").read_bytes())
    offset, _ = _buffer(tmp_path, name)
    data[offset : offset + len(value)] = value
    (tmp_path / "a.bin").write_bytes(data)
    assert code in _codes(validate(tmp_path / "a.gltf", external=False))


@pytest.mark.parametrize("cut", [0, 4, 19, 40, 1000, -1])
def test_files_cut_short(tmp_path: Path, cut: int) -> None:
    (path,) = write(SMALL, tmp_path / "a.glb")
    path.write_bytes(path.read_bytes()[:cut])
    assert _codes(validate(path, external=False)) == {"UNREADABLE"}


@pytest.mark.parametrize(
    ("faces", "code"),
    [
        (lambda faces: faces[1:], "NOT_CLOSED"),
        (lambda faces: faces[:, ::-1], "INSIDE_OUT"),
        (lambda faces: np.concatenate([faces[:1, ::-1], faces[1:]]), "MISORIENTED"),
        (lambda faces: np.concatenate([faces, faces[:1]]), "NONMANIFOLD_EDGE"),
        (lambda faces: np.concatenate([faces, [[9, 9, 10]]]), "DEGENERATE_TRIANGLE"),
    ],
)
@pytest.mark.parametrize("name", ["a.glb", "a.usdc", "a.ply", "a.obj", "tiles"])
def test_meshes_that_are_not_solid_are_reported_in_every_format(
    tmp_path: Path, name: str, faces: Any, code: str
) -> None:
    broken = asset(ZURICH, lods=(capsule(8, 2, faces=faces(capsule(8, 2).faces)),))
    write(broken, tmp_path / name)
    assert code in _codes(validate(tmp_path / name, external=False))


_MATRIX = [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4e6, 1e6, 5e6, 1]

TILES_FAULTS: dict[str, tuple[Callable[[Document], None], str]] = {
    "version": (_set("asset", "version", to="2.0"), "VERSION"),
    "no error": (_set("geometricError", to=_REMOVED), "GEOMETRIC_ERROR"),
    "negative error": (_set("root", "geometricError", to=-1), "GEOMETRIC_ERROR"),
    "error grows": (_set("root", "children", 0, "geometricError", to=5.0), "GEOMETRIC_ERROR"),
    "error of the tileset too small": (_set("geometricError", to=0.001), "GEOMETRIC_ERROR"),
    "no refine": (_set("root", "refine", to=_REMOVED), "REFINE"),
    "content gone": (_set("root", "content", "uri", to="gone.glb"), "CONTENT"),
    "no volume": (_set("root", "boundingVolume", to=_REMOVED), "BOUNDING_VOLUME"),
    "flat box": (_set("root", "boundingVolume", "box", 11, to=0.0), "BOUNDING_VOLUME"),
    "box too low": (_set("root", "boundingVolume", "box", 11, to=0.5), "OUTSIDE_VOLUME"),
    "box with y up": (
        _set("root", "boundingVolume", "box", to=[0, 0.9, 0, 0.31, 0, 0, 0, 0.91, 0, 0, 0, 0.31]),
        "OUTSIDE_VOLUME",
    ),
    "region in degrees": (
        _set("root", "boundingVolume", to={"region": [8.54, 47.37, 8.55, 47.38, 0, 9]}),
        "BOUNDING_VOLUME",
    ),
    "region elsewhere": (
        _set("root", "boundingVolume", to={"region": [0.1, 0.8, 0.11, 0.81, 0, 9]}),
        "OUTSIDE_VOLUME",
    ),
    "small sphere": (_set("root", "boundingVolume", to={"sphere": [0, 0, 0.9, 0.5]}), "OUTSIDE_VOLUME"),
    "row-major": (_set("root", "transform", to=np.reshape(_MATRIX, (4, 4)).T.ravel().tolist()), "TRANSFORM"),
    "scaled": (_set("root", "transform", to=[2.0, *_MATRIX[1:]]), "TRANSFORM"),
    "mirrored": (_set("root", "transform", to=[-1.0, *_MATRIX[1:]]), "TRANSFORM"),
    "not finite": (_set("root", "transform", to=[float("nan"), *_MATRIX[1:]]), "UNREADABLE"),
    "child moved away": (
        _set("root", "children", 0, "transform", to=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]),
        "OUTSIDE_VOLUME",
    ),
    "metadata of no class": (_set("metadata", "class", to="x"), "METADATA"),
}


@pytest.mark.parametrize("fault", TILES_FAULTS)
def test_faults_of_tilesets(tmp_path: Path, fault: str) -> None:
    change, code = TILES_FAULTS[fault]
    write(SMALL, tmp_path)
    document = json.loads((tmp_path / "tileset.json").read_text())
    change(document)
    (tmp_path / "tileset.json").write_text(json.dumps(document))
    assert code in _codes(validate(tmp_path / "tileset.json", external=False))


def test_regions_and_spheres_that_hold_the_figure_pass(tmp_path: Path) -> None:
    write(SMALL, tmp_path)
    document = json.loads((tmp_path / "tileset.json").read_text())
    lon, lat, metre = np.radians(8.5417), np.radians(47.3769), 1 / 6.3e6
    region = [lon - 2 * metre, lat - metre, lon + 2 * metre, lat + metre, 455.2, 457.3]
    document["root"]["boundingVolume"] = {"region": region}
    document["root"]["children"][0]["boundingVolume"] = {"sphere": [0, 0, 0.9, 1.0]}
    (tmp_path / "tileset.json").write_text(json.dumps(document))
    assert validate(tmp_path, external=False) == []


def test_tilesets_within_tilesets_are_followed(tmp_path: Path) -> None:
    write(SMALL, tmp_path / "inner")
    outer = {
        "asset": {"version": "1.1"},
        "geometricError": 100,
        "root": {
            "boundingVolume": {"region": [0.149, 0.826, 0.150, 0.827, 0, 1000]},
            "geometricError": 50,
            "refine": "ADD",
            "content": {"uri": "inner/tileset.json"},
        },
    }
    (tmp_path / "tileset.json").write_text(json.dumps(outer))
    assert validate(tmp_path, external=False) == []
    outer["root"]["boundingVolume"] = {"region": [0.149, 0.826, 0.150, 0.827, 0, 100]}
    (tmp_path / "tileset.json").write_text(json.dumps(outer))
    assert _codes(validate(tmp_path, external=False)) == {"OUTSIDE_VOLUME"}
    outer["root"]["content"]["uri"] = "tileset.json"
    (tmp_path / "tileset.json").write_text(json.dumps(outer))
    assert _codes(validate(tmp_path, external=False)) == {"CYCLE"}


def _mesh(stage: Usd.Stage) -> UsdGeom.Mesh:
    return UsdGeom.Mesh.Get(stage, "/Figure/Mesh")


def _st(stage: Usd.Stage) -> UsdGeom.Primvar:
    return UsdGeom.PrimvarsAPI(_mesh(stage)).GetPrimvar("st")


def _file(stage: Usd.Stage) -> Usd.Attribute:
    return stage.GetPrimAtPath("/Figure/Looks/Drawing/Texture").GetAttribute("inputs:file")


USD_FAULTS: dict[str, tuple[Callable[[Usd.Stage], Any], str]] = {
    "units": (lambda stage: UsdGeom.SetStageMetersPerUnit(stage, 0.01), "STAGE_UNITS"),
    "axis": (lambda stage: UsdGeom.SetStageUpAxis(stage, "Z"), "STAGE_UNITS"),
    "no default prim": (lambda stage: stage.ClearDefaultPrim(), "MissingDefaultPrim"),
    "subdivision": (lambda stage: _mesh(stage).GetSubdivisionSchemeAttr().Set("catmullClark"), "SUBDIVISION"),
    "extent": (lambda stage: _mesh(stage).GetExtentAttr().Set([Gf.Vec3f(0), Gf.Vec3f(1)]), "EXTENT"),
    "no mesh": (lambda stage: stage.RemovePrim("/Figure/Mesh"), "NO_MESH"),
    "indices": (lambda stage: _mesh(stage).GetFaceVertexIndicesAttr().Set(Vt.IntArray([0, 1, 9999])), "TOPOLOGY"),
    "texture": (lambda stage: _file(stage).Set("gone.png"), "TEXTURE"),
    "coordinates": (lambda stage: _st(stage).SetIndices(Vt.IntArray([0])), "PRIMVAR"),
}


@pytest.mark.parametrize("fault", USD_FAULTS)
def test_faults_of_usd(tmp_path: Path, fault: str) -> None:
    change, code = USD_FAULTS[fault]
    write(replace(SMALL, lods=SMALL.lods[:1]), tmp_path / "a.usda")
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    change(stage)
    stage.Save()
    assert code in _codes(validate(tmp_path / "a.usda"))


@pytest.mark.parametrize("name", ["a.usda", "a.usdz", "a.ply", "a.obj", "a.gltf", "a.glb", "tileset.json"])
def test_garbage_is_unreadable_not_a_crash(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"garbage \x00\xff")
    assert _codes(validate(tmp_path / name, external=False)) == {"UNREADABLE"}


def test_obj_with_a_missing_texture_or_library(tmp_path: Path) -> None:
    write(SMALL, tmp_path / "a.obj")
    (tmp_path / "a_texture.png").unlink()
    assert _codes(validate(tmp_path / "a.obj")) == {"REFERENCE"}


def test_findings_are_sorted_by_severity_and_one_line_each(tmp_path: Path) -> None:
    write(SMALL, tmp_path / "a.gltf")
    document = json.loads((tmp_path / "a.gltf").read_text())
    document["extensionsRequired"] = ["EXT_mesh_features"]
    document["asset"]["version"] = "1.0"
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    findings = validate(tmp_path / "a.gltf", external=False)
    assert [finding.severity for finding in findings] == ["error", "warning"]
    assert str(findings[0]) == "error: a.gltf: asset: asset.version is 1.0, expected 2.0 [VERSION]"


@pytest.mark.parametrize("name", ["gone.glb", "a.txt"])
def test_missing_and_unsupported_files_are_errors(tmp_path: Path, name: str) -> None:
    (tmp_path / "a.txt").write_text("")
    with pytest.raises(ExportError, match=name):
        validate(tmp_path / name)


def test_khronos_findings_are_among_them(tmp_path: Path, node_modules: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NODE_PATH", str(node_modules))
    write(SMALL, tmp_path / "a.gltf")
    assert validate(tmp_path / "a.gltf") == []
    document = json.loads((tmp_path / "a.gltf").read_text())
    document["samplers"][0]["wrapS"] = 1
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    assert _codes(validate(tmp_path / "a.gltf"), "warning") == {"VALUE_NOT_IN_LIST"}


def test_a_missing_khronos_validator_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NODE_PATH", "")
    write(SMALL, tmp_path / "a.glb")
    monkeypatch.chdir(tmp_path)
    assert _codes(validate(tmp_path / "a.glb"), "info") == {"NO_KHRONOS_VALIDATOR"}
