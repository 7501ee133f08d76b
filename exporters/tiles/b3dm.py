"""Batched 3D Models: the container for binary glTF in 3D Tiles 1.0, for clients that do not support version 1.1.

https://github.com/CesiumGS/3d-tiles/tree/1.0/specification/TileFormats/Batched3DModel

Feature ids and their table move from glTF extensions, which such clients do not support either, to the attribute
`_BATCHID` and the batch table. Vertices are local to the tile, so no RTC_CENTER is needed.
"""

from __future__ import annotations

import itertools
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from exporters.errors import ExportError
from exporters.gltf.container import join_glb
from exporters.gltf.reader import Gltf, glb_of
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import parse_json

HEADER = struct.Struct("<4sIIIIII")
"""magic, version, byte lengths: total, feature table's JSON and binary, batch table's JSON and binary."""

MESH_FEATURES, STRUCTURAL_METADATA = "EXT_mesh_features", "EXT_structural_metadata"
# fmt: off
SCALARS = {
    "INT8": "<i1", "UINT8": "<u1", "INT16": "<i2", "UINT16": "<u2", "INT32": "<i4", "UINT32": "<u4",
    "FLOAT32": "<f4", "FLOAT64": "<f8",
}
# fmt: on


def b3dm_bytes(glb: bytes, name: Path | str) -> bytes:
    """Convert a binary glTF file to a batched 3D model.

    glb : the file's bytes, as `exporters.gltf.glb` writes them
    name : the file, for messages

    Raises ExportError for anything but binary glTF, and for files that require extensions.
    """
    gltf = glb_of(glb, Path(name))
    try:
        return _b3dm(gltf)
    except DamagedFile as error:
        raise ExportError(name, f"broken glTF ({error})", "run fig2mesh validate") from error


def _b3dm(gltf: Gltf) -> bytes:
    required = gltf.document.get("extensionsRequired", [])
    if required:
        raise ExportError(
            gltf.path, f"requires {', '.join(required)}, which 3D Tiles 1.0 does not support", "give a plain .glb"
        )
    columns = _batch_table(gltf)
    length = max((len(values) for values in columns.values()), default=0)
    feature_table = _json({"BATCH_LENGTH": length}, HEADER.size)
    batch_table = _json(columns, 0) if columns else b""
    inside = _rewritten(gltf, batched=bool(columns))
    total = HEADER.size + len(feature_table) + len(batch_table) + len(inside)
    head = HEADER.pack(b"b3dm", 1, total, len(feature_table), 0, len(batch_table), 0)
    return b"".join([head, feature_table, batch_table, inside])


def _json(content: dict[str, Any], before: int) -> bytes:
    text = json.dumps(content, ensure_ascii=False, separators=(",", ":")).encode()
    return text + b" " * (-(before + len(text)) % 8)


def part_table(gltf: Gltf) -> dict[str, list[Any]]:
    """Return the columns of the single property table of a figure, property → values; empty without one."""
    if len(gltf.tables) != 1:
        return {}
    table = gltf.tables[0]
    classes = gltf.extension(STRUCTURAL_METADATA).get("schema", {}).get("classes", {})
    kinds = classes.get(table["class"], {}).get("properties", {})
    columns: dict[str, list[Any]] = {}
    for key, column in table.get("properties", {}).items():
        if key not in kinds:
            raise DamagedFile(f"property {key[:40]} is not in the schema")
        kind = kinds[key]
        if kind.get("array"):
            continue  # batch tables of 1.0 have no binary arrays, nor do figures
        if kind["type"] == "STRING":
            columns[key] = gltf.texts(column)
        elif kind["type"] == "SCALAR" and kind.get("componentType") in SCALARS:
            values = gltf.column(column["values"], SCALARS[kind["componentType"]])[: table["count"]]
            # The shortest decimals that restore the same float32.
            columns[key] = [float(str(value)) if values.dtype.kind == "f" else int(value) for value in values]
    return columns


def _batch_table(gltf: Gltf) -> dict[str, list[Any]]:
    outlines = gltf.outlines
    solids = [mesh for index, mesh in enumerate(gltf.items("meshes")) if index not in outlines]
    primitives = [each for mesh in solids for each in mesh["primitives"]]
    lists = [each.get("extensions", {}).get(MESH_FEATURES, {}).get("featureIds") or [{}] for each in primitives]
    whole = all(ids[0].get("propertyTable") == 0 and ids[0].get("attribute") == 0 for ids in lists)
    return part_table(gltf) if whole else {}


def _rewritten(gltf: Gltf, batched: bool) -> bytes:
    """Return the glTF without the extensions of the parts, and without the data that only they refer to."""
    document: dict[str, Any] = json.loads(json.dumps(gltf.document))
    metadata = document.get("extensions", {}).pop(STRUCTURAL_METADATA, {})
    tables = metadata.get("propertyTables", [])
    dropped = {
        column[key]
        for table in tables
        for column in table.get("properties", {}).values()
        for key in ("values", "stringOffsets", "arrayOffsets")
        if key in column
    }
    dropped |= _without_images_of(document, metadata.get("propertyTextures", []))
    if not document.get("extensions", True):
        del document["extensions"]
    used = [name for name in document.get("extensionsUsed", []) if name not in (MESH_FEATURES, STRUCTURAL_METADATA)]
    document.pop("extensionsUsed", None)
    if used:
        document["extensionsUsed"] = used
    for primitive in (each for mesh in document.get("meshes", []) for each in mesh["primitives"]):
        for name in (MESH_FEATURES, STRUCTURAL_METADATA):
            primitive.get("extensions", {}).pop(name, None)
        if not primitive.get("extensions", True):
            del primitive["extensions"]
        if batched:
            attributes = primitive["attributes"]
            primitive["attributes"] = {("_BATCHID" if k == "_FEATURE_ID_0" else k): v for k, v in attributes.items()}
    binary = _repacked(document, gltf, dropped)
    document["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode()
    # Both chunks are padded to multiples of eight bytes, as the whole tile must be; the chunk headers add 12 + 8 + 8.
    text += b" " * ((4 - len(text)) % 8)
    return join_glb(text, binary)


def _without_images_of(document: dict[str, Any], property_textures: list[dict[str, Any]]) -> set[int]:
    """Remove the textures of property textures, if they are the last ones, with their images and samplers.

    returns : the buffer views of those images
    """
    views: set[int] = set()
    wanted = {each.get("index", 0) for holder in property_textures for each in holder.get("properties", {}).values()}
    for index in sorted(wanted, reverse=True):
        textures, images, samplers = (document.get(kind, []) for kind in ("textures", "images", "samplers"))
        if index >= len(textures):
            raise DamagedFile(f"texture {index} does not exist")
        texture = textures[index]
        # Others would have to be renumbered; fig2mesh writes these last.
        if (index, texture.get("source"), texture.get("sampler")) != tuple(
            len(items) - 1 for items in (textures, images, samplers)
        ):
            continue
        textures.pop()
        samplers.pop()
        image = images.pop()
        if "bufferView" in image:
            views.add(image["bufferView"])
    return views


def _repacked(document: dict[str, Any], gltf: Gltf, dropped: set[int]) -> bytes:
    """Concatenate the buffer views without the dropped ones; indices in the document are updated."""
    kept = [index for index in range(len(gltf.items("bufferViews"))) if index not in dropped]
    number = {old: new for new, old in enumerate(kept)}
    chunks: list[bytes] = []
    length = 0
    views = []
    for old in kept:
        data = bytes(gltf.view(old))
        view = document["bufferViews"][old] | {"buffer": 0, "byteOffset": length}
        padded = data + bytes(-len(data) % 8)
        chunks.append(padded)
        length += len(padded)
        views.append(view)
    document["bufferViews"] = views
    if any(view not in number for view in _named_views(document)):
        raise DamagedFile("reference to a buffer view that does not exist, or that belongs to a property table")
    for accessor in document.get("accessors", []):
        sparse = accessor.get("sparse", {})
        for holder in (accessor, sparse.get("indices", {}), sparse.get("values", {})):
            if "bufferView" in holder:
                holder["bufferView"] = number[holder["bufferView"]]
    for image in document.get("images", []):
        if "bufferView" in image:
            image["bufferView"] = number[image["bufferView"]]
    return b"".join(chunks)


def _named_views(document: dict[str, Any]) -> Iterator[int]:
    for accessor in document.get("accessors", []):
        sparse = accessor.get("sparse", {})
        for holder in (accessor, sparse.get("indices", {}), sparse.get("values", {})):
            if "bufferView" in holder:
                yield holder["bufferView"]
    yield from (image["bufferView"] for image in document.get("images", []) if "bufferView" in image)


@dataclass(frozen=True)
class B3dm:
    """A batched 3D model: the JSON of its two tables and the contained binary glTF."""

    feature_table: dict[str, Any]
    batch_table: dict[str, Any]
    glb: bytes


def read_b3dm(data: bytes) -> B3dm:
    """Parse a batched 3D model. Raises DamagedFile for an invalid header, lengths or alignment."""
    if len(data) < HEADER.size:
        raise DamagedFile(f"{len(data)} bytes, less than the header")
    magic, version, total, *lengths = HEADER.unpack_from(data)
    if magic != b"b3dm" or version != 1:
        raise DamagedFile(f"starts with {magic!r} version {version}, expected b'b3dm' version 1")
    if total != len(data) or sum(lengths) + HEADER.size > total:
        raise DamagedFile(f"header declares {total} bytes with tables of {lengths}, file has {len(data)}")
    ends = [HEADER.size + end for end in itertools.accumulate(lengths)]
    if total % 8 or ends[1] % 8 or ends[3] % 8:
        raise DamagedFile(f"tables end at {ends[1]} and {ends[3]}, the tile at {total}: not multiples of 8")
    feature_table = parse_json(data[HEADER.size : ends[0]])
    batch_table = parse_json(data[ends[1] : ends[2]]) if lengths[2] else {}
    if not isinstance(feature_table, dict) or not isinstance(batch_table, dict):
        raise DamagedFile("a table is not a JSON object")
    return B3dm(feature_table, batch_table, data[ends[3] :])
