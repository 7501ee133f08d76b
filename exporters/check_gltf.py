"""Checks of glTF files: structure and our own promises in Python, the full rules by the Khronos validator.

https://github.com/KhronosGroup/glTF-Validator
"""

from __future__ import annotations

import io
import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from exporters.errors import ExportError
from exporters.findings import Finding, Severity, check_solid
from exporters.gltf_reader import Gltf, read_gltf

UNIT_TOLERANCE = 5e-4
"""How far a normal's length may be from 1; the Khronos validator allows about as much."""

KHRONOS_SEVERITIES: tuple[Severity, ...] = ("error", "warning", "info", "info")  # the fourth are hints

KHRONOS_BLIND_SPOTS = ("UNSUPPORTED_EXTENSION", "UNUSED_OBJECT")
"""Infos that only say that it does not know the extensions which we check here, nor what they refer to."""

_KHRONOS_SCRIPT = """
const fs = require('fs'), path = require('path'), file = process.argv[2];
require(process.argv[1]).validateBytes(new Uint8Array(fs.readFileSync(file)), {
  uri: path.basename(file), maxIssues: 100,
  externalResourceFunction: (uri) => fs.promises.readFile(
    path.join(path.dirname(file), decodeURIComponent(uri))).then((data) => new Uint8Array(data)),
}).then((report) => console.log(JSON.stringify(report)));
"""


def check_gltf(path: Path, external: bool = True) -> list[Finding]:
    """Findings about a .glb or .gltf file.

    external : run the Khronos validator too where it is found, see `find_khronos_validator`
    """
    try:
        gltf = read_gltf(path)
    except ExportError as error:
        return [Finding("error", "UNREADABLE", error.finding, path.name)]
    findings = list(_check_document(gltf))
    for index, mesh in enumerate(gltf.items("meshes")):
        where = f"{path.name}: meshes/{index}"
        try:
            for number, primitive in enumerate(mesh["primitives"]):
                findings += _check_primitive(gltf, primitive, f"{where}/primitives/{number}")
            findings += _check_manifold(gltf, index, where)
            findings += check_solid(*gltf.solid_arrays(index), where)
        except (ValueError, LookupError, TypeError) as error:
            findings.append(Finding("error", "UNREADABLE_MESH", str(error), where))
    return findings + (khronos_findings(path) if external else [])


def _check_document(gltf: Gltf) -> Iterator[Finding]:
    name = gltf.path.name
    version = gltf.document.get("asset", {}).get("version")
    if version != "2.0":
        yield Finding("error", "VERSION", f"asset.version is {version}, expected 2.0", f"{name}: asset")
    if not gltf.items("meshes"):
        yield Finding("error", "NO_MESH", "no mesh", name)
    for extension in gltf.document.get("extensionsRequired", []):
        yield Finding("warning", "EXTENSION_REQUIRED", f"{extension}: viewers without it refuse the file", name)
    for index, accessor in enumerate(gltf.items("accessors")):
        where = f"{name}: accessors/{index}"
        try:
            values = gltf.accessor(index)
        except (ValueError, LookupError, TypeError) as error:
            yield Finding("error", "ACCESSOR", str(error), where)
            continue
        if values.dtype.kind == "f" and not np.isfinite(values).all():
            yield Finding("error", "NOT_FINITE", "NaN or infinite values", where)
            continue
        for key, measured in (("min", values.min(axis=0)), ("max", values.max(axis=0))):
            if key in accessor and not np.array_equal(np.asarray(accessor[key], values.dtype), np.atleast_1d(measured)):
                yield Finding("error", "MIN_MAX", f"{key} is {accessor[key]}, values say {measured.tolist()}", where)
    for index in range(len(gltf.items("images"))):
        where = f"{name}: images/{index}"
        try:
            from PIL import Image

            with Image.open(io.BytesIO(gltf.image(index))) as image:
                image.load()
        except (ValueError, LookupError, OSError) as error:
            yield Finding("error", "IMAGE", str(error), where)
    yield from _check_property_tables(gltf)


def _check_primitive(gltf: Gltf, primitive: dict[str, Any], where: str) -> Iterator[Finding]:
    positions = gltf.accessor(primitive["attributes"]["POSITION"])
    count = len(positions)
    if "min" not in gltf.items("accessors")[primitive["attributes"]["POSITION"]]:
        yield Finding("error", "MIN_MAX", "POSITION without min and max", where)
    for attribute, accessor in primitive["attributes"].items():
        length = len(gltf.accessor(accessor))
        if length != count:
            yield Finding("error", "ATTRIBUTE_COUNT", f"{attribute} has {length} of {count} vertices", where)
    if "indices" in primitive:
        indices = gltf.accessor(primitive["indices"])
        if primitive.get("mode", 4) != 4 or len(indices) % 3:
            yield Finding("error", "NOT_TRIANGLES", f"mode {primitive.get('mode', 4)}, {len(indices)} indices", where)
        if indices.max() >= count:
            # Everything after this would read beyond the vertices.
            raise ValueError(f"index {int(indices.max())} of {count} vertices")
    if "NORMAL" in primitive["attributes"]:
        length = np.linalg.norm(gltf.accessor(primitive["attributes"]["NORMAL"]).astype(np.float64), axis=1)
        worst = float(np.abs(length - 1).max())
        if worst > UNIT_TOLERANCE:
            yield Finding("error", "NORMAL_LENGTH", f"normals are up to {worst:.2g} off unit length", where)
    if "TEXCOORD_0" in primitive["attributes"]:
        uv = gltf.accessor(primitive["attributes"]["TEXCOORD_0"])
        if uv.dtype.kind == "f" and (uv.min() < 0 or uv.max() > 1):
            yield Finding("warning", "TEXCOORD_RANGE", "texture coordinates outside [0, 1]", where)
    yield from _check_features(gltf, primitive, where)


def _check_features(gltf: Gltf, primitive: dict[str, Any], where: str) -> Iterator[Finding]:
    extension = primitive.get("extensions", {}).get("EXT_mesh_features", {})
    for feature in extension.get("featureIds", []):
        if "attribute" not in feature:
            continue
        ids = gltf.accessor(primitive["attributes"][f"_FEATURE_ID_{feature['attribute']}"])
        if ids.min() < 0 or ids.max() >= feature["featureCount"] or (ids != np.rint(ids)).any():
            yield Finding("error", "FEATURE_ID", f"feature ids outside 0..{feature['featureCount'] - 1}", where)
        table = feature.get("propertyTable")
        metadata = gltf.document.get("extensions", {}).get("EXT_structural_metadata", {})
        if table is not None and table >= len(metadata.get("propertyTables", [])):
            yield Finding("error", "PROPERTY_TABLE", f"there is no property table {table}", where)


def _check_property_tables(gltf: Gltf) -> Iterator[Finding]:
    metadata = gltf.document.get("extensions", {}).get("EXT_structural_metadata")
    if metadata is None:
        return
    where = f"{gltf.path.name}: EXT_structural_metadata"
    if "id" not in metadata.get("schema", {}):
        yield Finding("error", "SCHEMA_ID", "the schema has no id", where)
    for table in metadata.get("propertyTables", []):
        for key, column in table.get("properties", {}).items():
            try:
                values = gltf.view(column["values"])
                if "stringOffsets" not in column:
                    continue
                offsets = np.frombuffer(gltf.view(column["stringOffsets"]), "<u4")
            except (ValueError, LookupError) as error:
                yield Finding("error", "PROPERTY", f"{key}: {error}", where)
                continue
            expected = table["count"] + 1
            if len(offsets) != expected or (np.diff(offsets.astype(np.int64)) < 0).any() or offsets[-1] > len(values):
                message = f"{key}: {len(offsets)} string offsets up to {offsets[-1:]}, expected {expected} rising ones"
                yield Finding("error", "STRING_OFFSETS", message, where)


def _check_manifold(gltf: Gltf, index: int, where: str) -> Iterator[Finding]:
    mesh = gltf.items("meshes")[index]
    extension = mesh.get("extensions", {}).get("EXT_mesh_manifold")
    if extension is None:
        return
    where = f"{where}/EXT_mesh_manifold"
    solid = extension["manifoldPrimitive"]
    accessor = gltf.items("accessors")[solid["indices"]]
    if set(solid["attributes"]) != {"POSITION"} or "material" in solid:
        yield Finding("error", "MANIFOLD", "manifoldPrimitive may have positions and indices only", where)
    for primitive in mesh["primitives"]:
        same = gltf.items("accessors")[primitive["indices"]]["bufferView"] == accessor["bufferView"]
        if not same or primitive["attributes"]["POSITION"] != solid["attributes"]["POSITION"]:
            yield Finding("error", "MANIFOLD", "manifoldPrimitive does not share indices and positions", where)
    if len(mesh["primitives"]) != 1:
        return
    positions, faces = gltf.mesh_arrays(index)
    merged = gltf.accessor(solid["indices"]).astype(np.int64).reshape(-1, 3)
    if merged.shape != faces.shape or merged.max() >= len(positions):
        yield Finding("error", "MANIFOLD", "manifoldPrimitive has other triangles than the mesh", where)
    elif not np.array_equal(positions[faces], positions[merged]):
        yield Finding("error", "MANIFOLD", "vertices at different positions are merged", where)
    if "sparse" in accessor and not {"mergeIndices", "mergeValues"} <= set(extension):
        yield Finding("error", "MANIFOLD", "sparse indices without mergeIndices and mergeValues", where)


def find_khronos_validator() -> tuple[str, Path] | None:
    """Node and the npm package gltf-validator: in NODE_PATH, or in node_modules or build/node/node_modules here or in
    a folder above. None where either is missing."""
    node = shutil.which("node")
    here = Path.cwd()
    places = [Path(entry) for entry in os.environ.get("NODE_PATH", "").split(os.pathsep) if entry]
    for folder in (here, *here.parents):
        places += [folder / "node_modules", folder / "build" / "node" / "node_modules"]
    package = next((place / "gltf-validator" for place in places if (place / "gltf-validator").is_dir()), None)
    return (node, package) if node and package else None


def khronos_findings(path: Path) -> list[Finding]:
    """What the Khronos validator says about a file; one info finding where it is not installed."""
    tool = find_khronos_validator()
    if tool is None:
        return [Finding("info", "NO_KHRONOS_VALIDATOR", "npm package gltf-validator not found, skipped", path.name)]
    command = [tool[0], "-e", _KHRONOS_SCRIPT, str(tool[1].resolve()), str(path.resolve())]
    run = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    if run.returncode:
        return [Finding("warning", "KHRONOS_VALIDATOR", run.stderr.strip()[-300:], path.name)]
    return [
        Finding(
            KHRONOS_SEVERITIES[message["severity"]],
            message["code"],
            message["message"],
            f"{path.name}: {message.get('pointer') or message.get('offset', '')}",
        )
        for message in json.loads(run.stdout)["issues"]["messages"]
        if message["code"] not in KHRONOS_BLIND_SPOTS
    ]
