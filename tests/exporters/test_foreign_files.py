"""Valid files of other programs: no errors, no own warnings, and true facts; damaged ones: errors."""

from __future__ import annotations

import base64
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from exporters.findings import Finding
from exporters.gltf.reader import read_gltf
from exporters.inspect import inspect
from exporters.validate import validate
from exporters.write import write
from georef.placement import GeoPlacement
from tests.exporters.analytic import ZURICH, asset, capsule
from tests.node import RunScript

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "<f4")
"""Two triangles as a strip; not a solid."""


def _worse(findings: list[Finding]) -> list[Finding]:
    return [finding for finding in findings if finding.severity != "info"]


def _codes(findings: list[Finding], severity: str = "error") -> set[str]:
    return {finding.code for finding in findings if finding.severity == severity}


def _gltf(path: Path, **changes: Any) -> Path:
    """A glTF file with features that fig2mesh never writes: a scene of two nodes, strips, a skin, morphs, a camera."""
    arrays: dict[str, tuple[Any, str]] = {
        "position": (SQUARE, "VEC3"),
        "strip": (np.array([0, 1, 2, 3], "<u2"), "SCALAR"),
        "joints": (np.zeros((4, 4), "u1"), "VEC4"),
        "weights": (np.tile(np.array([1, 0, 0, 0], "<f4"), (4, 1)), "VEC4"),
        "inverse bind": (np.eye(4, dtype="<f4").reshape(1, 16), "MAT4"),
        "small": (np.array([[0, 0, 0], [127, 0, 0], [0, 127, 0], [127, 127, 0]], "i1"), "VEC3"),
        "morph row": (np.array([3], "<u2"), "SCALAR"),
        "morph value": (np.array([[0, 0, 1]], "<f4"), "VEC3"),
    }
    types = {"f4": 5126, "u2": 5123, "u1": 5121, "i1": 5120}
    data, views, accessors = b"", [], []
    for values, kind in arrays.values():
        rows = values.reshape(len(values), -1)
        more = {}
        if values.dtype.str[1:] == "i1":  # rows of vertex attributes begin at multiples of four bytes
            rows, more = np.pad(rows, ((0, 0), (0, 1))), {"byteStride": 4}
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": rows.nbytes, **more})
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": types[values.dtype.str[1:]],
                "count": len(values),
                "type": kind,
            }
        )
        data += rows.tobytes() + bytes(-rows.nbytes % 4)
    accessors[0] |= {"min": [0, 0, 0], "max": [1, 1, 0]}
    accessors[5] |= {"min": [0, 0, 0], "max": [127, 127, 0], "normalized": True}
    accessors = accessors[:6]
    sparse = {
        "count": 1,
        "indices": {"bufferView": 6, "componentType": 5123},
        "values": {"bufferView": 7},
    }
    morph = {"componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [0, 0, 1], "sparse": sparse}
    accessors.append(morph)
    strip = {
        "attributes": {"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3},
        "indices": 1,
        "mode": 5,
        "targets": [{"POSITION": 6}],
    }
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "another program"},
        "extensionsUsed": ["KHR_mesh_quantization"],
        "extensionsRequired": ["KHR_mesh_quantization"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"children": [1, 2, 3], "translation": [10, 0, 0]},
            {"mesh": 0, "skin": 0},
            {"mesh": 1, "scale": [-2, 2, 2], "rotation": [0, 0.7071067811865476, 0, 0.7071067811865476]},
            {"camera": 0},
        ],
        "skins": [{"joints": [3], "inverseBindMatrices": 4}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}],
        "meshes": [
            {"primitives": [strip], "weights": [0.5]},
            {"primitives": [{"attributes": {"POSITION": 5}, "indices": 1, "mode": 5}]},
        ],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [
            {"byteLength": len(data), "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}
        ],
    }
    path.write_text(json.dumps(document | changes))
    return path


def test_a_foreign_gltf_scene(tmp_path: Path, node: RunScript) -> None:
    path = _gltf(tmp_path / "a.gltf")
    (report,) = node("validate_gltf.mjs", path)
    assert report["issues"]["numErrors"] == 0, report["issues"]["messages"]  # a fair example
    findings = validate(path, external=False)
    assert _worse(findings) == []
    assert {"NOT_CLOSED", "EXTENSION_REQUIRED"} <= _codes(findings, "info")
    facts = inspect(path)
    assert (facts["triangles"], facts["vertices"], facts["watertight"]) == (4, 8, False)
    # The second square, of 127 steps, is turned about y, mirrored, doubled and moved: x becomes 2 z, y doubles.
    assert facts["bounds_m"][0] == pytest.approx([10, 0, 0], abs=1e-6)
    assert facts["bounds_m"][1] == pytest.approx([11, 2, 2], abs=1e-6)
    assert (facts["placement"], facts["parts"]) == (None, None)


def test_vertices_stand_where_the_nodes_put_them(tmp_path: Path) -> None:
    vertices = read_gltf(_gltf(tmp_path / "a.gltf")).scene_vertices()
    found = {tuple(np.round(vertex, 6).tolist()) for vertex in vertices + 0.0}
    # (x, y) of the second square: scaled by (-2, 2, 2), then x turned onto -z.
    assert found == {(10.0 + x, float(y), 0.0) for x in (0, 1) for y in (0, 1)} | {
        (10.0, 2.0 * y, 2.0 * x) for x in (0, 1) for y in (0, 1)
    }


GLTF_VARIATIONS: dict[str, tuple[dict[str, Any], str]] = {
    "draco": (
        {
            "extensionsUsed": ["KHR_draco_mesh_compression"],
            "extensionsRequired": ["KHR_draco_mesh_compression"],
            "meshes": [
                {
                    "primitives": [
                        {
                            "attributes": {"POSITION": 0},
                            "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}},
                        }
                    ]
                }
            ],
        },
        "NOT_READ_HERE",
    ),
    "points": ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 0}]}] * 2}, "NOT_TRIANGLES"),
    "no positions": ({"meshes": [{"primitives": [{"attributes": {"JOINTS_0": 2}}]}] * 2}, "NO_POSITION"),
    "no mesh": ({"meshes": [], "nodes": [{"camera": 0}]}, "NO_MESH"),
    "no scene": ({"scenes": [], "scene": None}, "NOT_CLOSED"),
}


@pytest.mark.parametrize("name", GLTF_VARIATIONS)
def test_differences_from_own_files_are_infos(tmp_path: Path, name: str) -> None:
    changes, code = GLTF_VARIATIONS[name]
    path = _gltf(tmp_path / "a.gltf", **changes)
    findings = validate(path, external=False)
    assert _worse(findings) == []
    assert code in _codes(findings, "info")


def test_rules_of_the_format_apply_to_all_files(tmp_path: Path) -> None:
    missing = _gltf(tmp_path / "a.gltf", buffers=[{"byteLength": 99, "uri": "gone.bin"}])
    assert _codes(validate(missing, external=False)) == {"UNREADABLE"}
    beyond = _gltf(tmp_path / "b.gltf", images=[{"uri": "gone.png"}, {"uri": "data:image/png;base64,AAAA"}])
    assert [finding.code for finding in _worse(validate(beyond, external=False))] == ["IMAGE", "IMAGE"]
    document = json.loads(_gltf(tmp_path / "c.gltf").read_text())
    document["accessors"][0]["max"] = [9, 9, 9]
    document["extensionsUsed"] = []
    (tmp_path / "c.gltf").write_text(json.dumps(document))
    assert _codes(validate(tmp_path / "c.gltf", external=False)) == {"MIN_MAX", "EXTENSION_USED"}


def _usd(path: Path) -> Path:
    """A stage with features that fig2mesh never writes: z up, centimetres, quads, smoothing, references, variants."""
    part = Usd.Stage.CreateNew(str(path.with_name("part.usda")))
    box = UsdGeom.Mesh.Define(part, "/Box")
    part.SetDefaultPrim(box.GetPrim())
    UsdGeom.SetStageMetersPerUnit(part, 0.01)
    UsdGeom.SetStageUpAxis(part, "Z")
    corners = [Gf.Vec3f(x, y, z) for x in (0, 100) for y in (0, 100) for z in (0, 100)]
    quads = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
    box.CreatePointsAttr().Set(Vt.Vec3fArray(corners), Usd.TimeCode(1))  # it moves
    box.CreateFaceVertexCountsAttr([4] * 6)
    box.CreateFaceVertexIndicesAttr(quads)
    box.CreateExtentAttr([Gf.Vec3f(-1), Gf.Vec3f(101)])  # roomy
    part.Save()
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, "Z")
    root = UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(root.GetPrim())
    UsdGeom.Xform.Define(stage, "/World/Moved").AddTranslateOp().Set(Gf.Vec3d(0, 0, 50))
    stage.DefinePrim("/World/Moved/Box").GetReferences().AddReference("./part.usda")
    stage.DefinePrim("/World/Late").GetPayloads().AddPayload("./part.usda")
    colours = root.GetPrim().GetVariantSets().AddVariantSet("colour")
    for name in ("red", "blue"):
        colours.AddVariant(name)
        colours.SetVariantSelection(name)
    stage.Save()
    return path


def test_a_foreign_usd_stage(tmp_path: Path) -> None:
    path = _usd(tmp_path / "scene.usda")
    findings = validate(path)
    assert _worse(findings) == []
    assert {"STAGE_UNITS", "SUBDIVISION", "EXTENT", "NOT_TRIANGLES"} <= _codes(findings, "info")
    facts = inspect(path)
    assert (facts["triangles"], facts["vertices"]) == (24, 16)
    assert facts["bounds_m"] == [[0, 0, 0], [100, 100, 150]]  # in the units of the file
    assert (facts["solid"], facts["components"], facts["lods"]) == (True, 2, None)


def test_a_missing_reference_is_an_error(tmp_path: Path) -> None:
    path = _usd(tmp_path / "scene.usda")
    (tmp_path / "part.usda").unlink()
    held = Sdf.Layer.Find(str(tmp_path / "part.usda"))
    assert held is None
    assert _codes(validate(path))


def test_faults_are_found_in_every_variant(tmp_path: Path) -> None:
    write(asset(ZURICH), tmp_path / "a.usda")
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    variants = stage.GetDefaultPrim().GetVariantSets().GetVariantSet("LOD")
    assert variants.GetVariantSelection() == "LOD0"
    variants.SetVariantSelection("LOD2")
    with variants.GetVariantEditContext():
        UsdGeom.Mesh.Get(stage, "/Figure/Mesh").GetExtentAttr().Set([Gf.Vec3f(0), Gf.Vec3f(1)])
    variants.SetVariantSelection("LOD0")
    stage.Save()
    findings = _worse(validate(tmp_path / "a.usda"))
    assert [(finding.code, finding.where) for finding in findings] == [("EXTENT", "a.usda: LOD=LOD2: /Figure/Mesh")]


def _attribute(name: str, value: Any) -> Callable[[Usd.Stage], Any]:
    return lambda stage: stage.GetDefaultPrim().GetAttribute(name).Set(value)


def _record(**changes: Any) -> Callable[[Usd.Stage], Any]:
    def change(stage: Usd.Stage) -> None:
        layer = stage.GetRootLayer()
        facts = dict(layer.customLayerData)
        facts["georeference"] = {**facts["georeference"], **changes}
        layer.customLayerData = facts

    return change


PLACES: dict[str, Callable[[Usd.Stage], Any]] = {
    "anchor": _attribute("cesium:anchor:longitude", 8.5418),
    "anchor by a centimetre": _attribute("cesium:anchor:latitude", 47.3769001),
    "reference": _attribute("omni:geospatial:wgs84:reference:referencePosition", Gf.Vec3d(8.5417, 47.3769, 455.34)),
    "origin": lambda stage: stage.RemovePrim("/CesiumGeoreference"),
    "record": _record(lon_deg=0.0),
    "record of nowhere": _record(lat_deg=91.0),
    "heading": _record(heading_deg=134.0),
}


@pytest.mark.parametrize("name", PLACES)
def test_places_of_a_stage_must_agree(tmp_path: Path, name: str) -> None:
    write(asset(ZURICH, lods=(capsule(8, 2),)), tmp_path / "a.usda")
    assert validate(tmp_path / "a.usda") == []
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    PLACES[name](stage)
    stage.Save()
    assert "GEOREFERENCE" in _codes(validate(tmp_path / "a.usda"))


@pytest.mark.parametrize(
    "change", [{"lat_deg": 90.5}, {"lon_deg": "east"}, {"crs": "EPSG:4326"}, {"heading_deg": None}, {"more": 1}]
)
def test_places_of_gltf_must_be_valid(tmp_path: Path, change: dict[str, Any]) -> None:
    write(asset(ZURICH, lods=(capsule(8, 2),)), tmp_path / "a.gltf")
    document = json.loads((tmp_path / "a.gltf").read_text())
    document["asset"]["extras"]["georeference"] |= change
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    assert "GEOREFERENCE" in _codes(validate(tmp_path / "a.gltf", external=False))


@pytest.mark.parametrize("lonlat", [(0.0, 0.0), (-180.0, 10.0), (180.0, -89.9999), (13.0, 90.0), (-67.72, -49.3)])
def test_places_round_trip_everywhere(tmp_path: Path, lonlat: tuple[float, float]) -> None:
    place = GeoPlacement(*lonlat, height_m=-430.0, heading_deg=350.0)
    for name in ("a.glb", "a.usdc"):
        write(asset(place, lods=(capsule(8, 2),)), tmp_path / name)
        assert validate(tmp_path / name, external=False) == []


def test_packages_are_checked_as_archives(tmp_path: Path) -> None:
    write(asset(), tmp_path / "a.usdz")
    with zipfile.ZipFile(tmp_path / "a.usdz") as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(tmp_path / "b.usdz", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in [("read.txt", b"me"), *members.items()]:
            archive.writestr(name, data)
    messages = {finding.message for finding in validate(tmp_path / "b.usdz") if finding.code == "PACKAGE"}
    assert {"the first file is not a layer", "is compressed", "is of a type that packages may not hold"} <= messages
    assert any("multiple of 64" in message for message in messages)
