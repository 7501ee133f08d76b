"""Checks of glTF files: structure and the guarantees of fig2mesh in Python, all other rules by the Khronos validator.

Foreign files guarantee less: properties that glTF does not require (a closed solid, textures that do not repeat) are
reported as infos, not errors.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.errors import ExportError
from exporters.findings import Finding, as_infos, check_place, check_solid
from exporters.gltf.khronos import khronos_findings
from exporters.gltf.ktx2 import size_of
from exporters.gltf.outline import HULL
from exporters.gltf.reader import Gltf, NotDecoded, read_gltf
from exporters.gltf.shape import MESHOPT
from exporters.solid import merged_by_position, unmatched_edges
from georef.untrusted.damage import DamagedFile
from georef.untrusted.image_file import MAX_TEXTURE_PX, TooLarge, check_texture

UNIT_TOLERANCE = 5e-4
"""Tolerance of the length of normals, about that of the Khronos validator."""

BYTE_UNIT_TOLERANCE = 2e-2
"""Tolerance of the length of 8-bit normals: half a step of each of three components."""

NOT_DECODED = "NOT_READ_HERE"
"""Code of the infos about data that is not decoded."""

MAX_TEXTURES = 4
"""Limit of decoded pixels per file, in textures of the largest size: many images may refer to the same bytes."""

# fmt: off
CODECS = {
    *MESHOPT, "KHR_draco_mesh_compression", "KHR_mesh_quantization", "KHR_texture_basisu", "KHR_texture_transform",
    "EXT_texture_webp", "EXT_texture_avif",
}
# fmt: on
"""Extensions that files have to require, as their data cannot be read without them; common clients support them."""


def check_gltf(path: Path, external: bool = True) -> list[Finding]:
    """Check a .glb or .gltf file.

    external : also run the Khronos validator if it is installed, see `exporters.gltf.khronos`
    """
    try:
        gltf = read_gltf(path)
    except ExportError as error:
        return [Finding("error", "UNREADABLE", error.finding, path.name)]
    own = gltf.document.get("asset", {}).get("generator") == "fig2mesh"
    findings = list(_check_document(gltf, own))
    outlines = gltf.outlines
    for index, mesh in enumerate(gltf.items("meshes")):
        where = f"{path.name}: meshes/{index}"
        try:
            for number, primitive in enumerate(mesh["primitives"]):
                findings += _check_primitive(gltf, primitive, f"{where}/primitives/{number}", own)
            findings += _check_manifold(gltf, index, where)
            check = _check_outline if index in outlines else _check_solid
            solid = check(gltf, index, where)
            findings += solid if own or "EXT_mesh_manifold" in mesh.get("extensions", {}) else as_infos(solid)
        except NotDecoded as reason:
            findings.append(Finding("info", NOT_DECODED, str(reason), where))
        except DamagedFile as error:
            findings.append(Finding("error", "UNREADABLE_MESH", str(error), where))
    if not external:
        return findings
    images = enumerate(gltf.items("images"))
    ktx2 = frozenset(f"/images/{index}" for index, image in images if image.get("mimeType") == "image/ktx2")
    return findings + khronos_findings(path, ktx2)


def _check_document(gltf: Gltf, own: bool) -> Iterator[Finding]:
    name = gltf.path.name
    about = gltf.document.get("asset", {})
    if about.get("version") != "2.0":
        yield Finding("error", "VERSION", f"asset.version is {about.get('version')}, expected 2.0", f"{name}: asset")
    if not gltf.items("meshes"):
        yield Finding("error" if own else "info", "NO_MESH", "no mesh", name)
    used = gltf.document.get("extensionsUsed", [])
    for extension in gltf.document.get("extensionsRequired", []):
        message = f"{extension}: viewers without it reject the file"
        yield Finding("info" if extension in CODECS else "warning", "EXTENSION_REQUIRED", message, name)
        if extension not in used:
            yield Finding("error", "EXTENSION_USED", f"{extension} is required but not in extensionsUsed", name)
    place = gltf.extras.get("georeference")
    if own and place is not None:
        yield from check_place(place, f"{name}: asset.extras.georeference")
    for index in range(len(gltf.items("accessors"))):
        yield from _check_accessor(gltf, index, f"{name}: accessors/{index}")
    pixels = 0
    for index in range(len(gltf.items("images"))):
        if pixels > MAX_TEXTURES * MAX_TEXTURE_PX:
            yield Finding(
                "info", NOT_DECODED, f"images/{index} and all later ones are not checked: too many pixels", name
            )
            break
        pixels += yield from _check_image(gltf, index, f"{name}: images/{index}")
    for note in gltf.lost:
        yield Finding("warning", "LOST_EXTENSION", note, name)
    yield from _check_property_tables(gltf)
    yield from _check_property_textures(gltf)


def _check_accessor(gltf: Gltf, index: int, where: str) -> Iterator[Finding]:
    accessor = gltf.items("accessors")[index]
    try:
        values = gltf.accessor(index)
    except NotDecoded as reason:
        yield Finding("info", NOT_DECODED, str(reason), where)
        return
    except DamagedFile as error:
        yield Finding("error", "ACCESSOR", str(error), where)
        return
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        yield Finding("error", "NOT_FINITE", "NaN or infinite values", where)
        return
    if "bufferView" not in accessor and "sparse" not in accessor:
        return  # zeros, or defined by an extension
    for key, measured in (("min", values.min(axis=0)), ("max", values.max(axis=0))):
        if key in accessor and not np.array_equal(_stored(accessor[key], values.dtype), np.atleast_1d(measured)):
            yield Finding("error", "MIN_MAX", f"{key} is {accessor[key]}, expected {measured.tolist()}", where)


def _stored(numbers: list[float], dtype: np.dtype[Any]) -> NDArray[np.float64]:
    """Convert numbers of the document to the precision of the buffers."""
    wide = np.array(numbers, np.float64)
    with np.errstate(over="ignore"):
        return wide.astype(dtype).astype(np.float64) if dtype.kind == "f" else wide


def _check_image(gltf: Gltf, index: int, where: str) -> Generator[Finding, None, int]:
    """Check an image; returns the number of decoded pixels."""
    try:
        data = gltf.image(index)
        if gltf.items("images")[index].get("mimeType") == "image/ktx2":
            size_of(data)
            return 0
        return check_texture(data)
    except (NotDecoded, TooLarge) as reason:
        yield Finding("info", NOT_DECODED, str(reason), where)
    except DamagedFile as error:
        yield Finding("error", "IMAGE", str(error), where)
    return 0


def _check_primitive(gltf: Gltf, primitive: dict[str, Any], where: str, own: bool) -> Iterator[Finding]:
    attributes = primitive["attributes"]
    if "KHR_draco_mesh_compression" in primitive.get("extensions", {}):
        raise NotDecoded("compressed with Draco")
    if "POSITION" not in attributes:
        yield Finding("error" if own else "info", "NO_POSITION", "no positions: nothing is rendered", where)
        return
    count = len(gltf.accessor(attributes["POSITION"]))
    if "min" not in gltf.item("accessors", attributes["POSITION"]):
        yield Finding("error", "MIN_MAX", "POSITION without min and max", where)
    for attribute, accessor in attributes.items():
        length = len(gltf.accessor(accessor))
        if length != count:
            yield Finding("error", "ATTRIBUTE_COUNT", f"{attribute} has {length} of {count} vertices", where)
    mode = primitive.get("mode", 4)
    indices = gltf.accessor(primitive["indices"]) if "indices" in primitive else np.arange(count)
    if mode == 4 and len(indices) % 3:
        yield Finding("error", "NOT_TRIANGLES", f"mode {mode}, {len(indices)} indices", where)
    elif mode != 4:
        yield Finding("error" if own else "info", "NOT_TRIANGLES", f"mode {mode}: not a list of triangles", where)
    if indices.max() >= count:
        # The checks below would read beyond the vertices.
        raise DamagedFile(f"index {int(indices.max())} of {count} vertices")
    if "NORMAL" in attributes:
        length = np.linalg.norm(gltf.vectors(attributes["NORMAL"], 3).astype(np.float64), axis=1)
        worst = float(np.abs(length - 1).max())
        if worst > (BYTE_UNIT_TOLERANCE if gltf.accessor(attributes["NORMAL"]).itemsize == 1 else UNIT_TOLERANCE):
            yield Finding("error", "NORMAL_LENGTH", f"normals are up to {worst:.2g} off unit length", where)
    if "TEXCOORD_0" in attributes and own:
        uv = gltf.numbers(attributes["TEXCOORD_0"])
        if uv.dtype.kind == "f" and (uv.min() < 0 or uv.max() > 1):
            yield Finding("warning", "TEXCOORD_RANGE", "texture coordinates outside [0, 1]", where)
    yield from _check_features(gltf, primitive, where)


def _check_features(gltf: Gltf, primitive: dict[str, Any], where: str) -> Iterator[Finding]:
    extension = primitive.get("extensions", {}).get("EXT_mesh_features", {})
    for feature in extension.get("featureIds", []):
        if "attribute" not in feature:
            continue
        name = f"_FEATURE_ID_{feature['attribute']}"
        if name not in primitive["attributes"]:
            raise DamagedFile(f"feature ids are in {name}, which does not exist")
        ids = gltf.accessor(primitive["attributes"][name])
        if ids.min() < 0 or ids.max() >= feature["featureCount"] or (ids != np.rint(ids)).any():
            yield Finding("error", "FEATURE_ID", f"feature ids outside 0..{feature['featureCount'] - 1}", where)
        table = feature.get("propertyTable")
        if table is not None and table >= len(gltf.tables):
            yield Finding("error", "PROPERTY_TABLE", f"unknown property table {table}", where)


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
                offsets = gltf.column(column["stringOffsets"], "<u4")
            except DamagedFile as error:
                yield Finding("error", "PROPERTY", f"{key}: {error}", where)
                continue
            expected = table["count"] + 1
            if len(offsets) != expected or (np.diff(offsets.astype(np.int64)) < 0).any() or offsets[-1] > len(values):
                message = f"{key}: {len(offsets)} string offsets up to {offsets[-1:]}, expected {expected} sorted"
                yield Finding("error", "STRING_OFFSETS", message, where)


def _check_property_textures(gltf: Gltf) -> Iterator[Finding]:
    metadata = gltf.extension("EXT_structural_metadata")
    classes = metadata.get("schema", {}).get("classes", {})
    for index, holder in enumerate(metadata.get("propertyTextures", [])):
        where = f"{gltf.path.name}: propertyTextures/{index}"
        known = classes.get(holder.get("class"), {}).get("properties")
        if known is None:
            yield Finding("error", "PROPERTY_TEXTURE", f"class {holder.get('class')} is not in the schema", where)
            continue
        for key, texture in holder.get("properties", {}).items():
            if key not in known:
                yield Finding("error", "PROPERTY_TEXTURE", f"property {key} is not in its class", where)
            if not 0 <= texture.get("index", -1) < len(gltf.items("textures")):
                yield Finding("error", "PROPERTY_TEXTURE", f"{key}: unknown texture {texture.get('index')}", where)


def _check_solid(gltf: Gltf, index: int, where: str) -> list[Finding]:
    return check_solid(*gltf.solid_arrays(index), where)


def _check_outline(gltf: Gltf, index: int, where: str) -> list[Finding]:
    """Check a drawn contour: a hull must be a solid turned inside out, a ribbon visible from both sides.

    The material of a hull must be one-sided: with both sides shown, it hides the figure.
    """
    vertices, faces = gltf.solid_arrays(index)
    if gltf.outlines[index] != HULL:
        count = unmatched_edges(merged_by_position(vertices, faces)[1])
        message = f"{count} edges of the ribbon without a triangle behind"
        return [Finding("error", "ONE_SIDED", message, where)] if count else []
    findings = check_solid(vertices, faces[:, ::-1], where)
    for primitive in gltf.primitives(index):
        if "material" in primitive and gltf.item("materials", primitive["material"]).get("doubleSided"):
            findings.append(Finding("error", "TWO_SIDED", "the hull's material is doubleSided", where))
    return findings


def _check_manifold(gltf: Gltf, index: int, where: str) -> Iterator[Finding]:
    mesh = gltf.items("meshes")[index]
    extension = mesh.get("extensions", {}).get("EXT_mesh_manifold")
    if extension is None:
        return
    where = f"{where}/EXT_mesh_manifold"
    solid = extension["manifoldPrimitive"]
    accessor = gltf.item("accessors", solid["indices"])
    if set(solid["attributes"]) != {"POSITION"} or "material" in solid:
        yield Finding("error", "MANIFOLD", "manifoldPrimitive may have positions and indices only", where)
    for primitive in mesh["primitives"]:
        indices = gltf.item("accessors", primitive["indices"]) if "indices" in primitive else {}
        same = indices.get("bufferView") == accessor.get("bufferView")
        if not same or primitive["attributes"].get("POSITION") != solid["attributes"].get("POSITION"):
            yield Finding("error", "MANIFOLD", "manifoldPrimitive does not share indices and positions", where)
    if len(mesh["primitives"]) != 1:
        return
    positions, faces = gltf.mesh_arrays(index)
    merged = gltf.accessor(solid["indices"])
    if merged.size != faces.size or merged.dtype.kind != "u" or merged.max() >= len(positions):
        yield Finding("error", "MANIFOLD", "manifoldPrimitive has other triangles than the mesh", where)
    elif not np.array_equal(positions[faces], positions[merged.reshape(-1, 3)]):
        yield Finding("error", "MANIFOLD", "vertices at different positions are merged", where)
    if "sparse" in accessor and not {"mergeIndices", "mergeValues"} <= set(extension):
        yield Finding("error", "MANIFOLD", "sparse indices without mergeIndices and mergeValues", where)
