"""glTF 2.0, as one binary file or as .gltf with a .bin and a .png beside it.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_materials_unlit
https://github.com/CesiumGS/glTF/tree/3d-tiles-next/extensions/2.0/Vendor/EXT_mesh_features
https://github.com/CesiumGS/glTF/tree/3d-tiles-next/extensions/2.0/Vendor/EXT_structural_metadata
https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_mesh_manifold

Written with `json` and `struct`: the format is small, and the bytes stay ours (an object model such as pygltflib's
costs 0.2 s to import and decides the order of keys). Extensions are only ever *used*, never *required*: CesiumJS
refuses files that require what it does not know, and every viewer shows the figure without them.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from exporters.asset import Asset, TexturedMesh
from exporters.errors import ExportError
from exporters.georeference import georeference
from exporters.part_borders import split_at_parts
from exporters.sampling import linear_from_srgb, observed_shares
from exporters.solid import measure_topology, solid_of, unit_normals

ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
COMPONENT_TYPES = {"u1": 5121, "u2": 5123, "u4": 5125, "f4": 5126}
LINEAR, LINEAR_MIPMAP_LINEAR, CLAMP_TO_EDGE = 9729, 9987, 33071


class _Document:
    """The growing JSON document and its one buffer."""

    def __init__(self) -> None:
        self.json: dict[str, Any] = {}
        self.chunks: list[bytes] = []
        self.length = 0
        self.used: set[str] = set()

    def add(self, kind: str, item: dict[str, Any]) -> int:
        items: list[dict[str, Any]] = self.json.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def view(self, name: str, data: bytes, target: int | None = None) -> int:
        # Eight bytes suit every component type, and property tables demand it.
        padding = -self.length % 8
        view: dict[str, Any] = {
            "name": name, "buffer": 0, "byteOffset": self.length + padding, "byteLength": len(data),
        }  # fmt: skip
        if target is not None:
            view["target"] = target
        self.chunks += [bytes(padding), data]
        self.length += padding + len(data)
        return self.add("bufferViews", view)

    def accessor(self, name: str, array: NDArray[Any], target: int | None, **more: Any) -> int:
        little = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
        return self.accessor_at(name, little, self.view(name, little.tobytes(), target), **more)

    def accessor_at(self, name: str, array: NDArray[Any], view: int, **more: Any) -> int:
        columns = 1 if array.ndim == 1 else array.shape[1]
        return self.add(
            "accessors",
            {
                "name": name,
                "bufferView": view,
                "componentType": COMPONENT_TYPES[array.dtype.str[1:]],
                "count": len(array),
                "type": "SCALAR" if columns == 1 else f"VEC{columns}",
                **more,
            },
        )


def write_glb(asset: Asset, path: Path | str) -> None:
    """Write the finest level of detail as binary glTF, everything inside.

    asset : vertices in the ASSET frame, written unchanged as float32; its place goes into `asset.extras`
    path : the .glb file, replaced if it exists; see `exporters.write.write` for writing it whole or not at all

    Raises ExportError for a mesh without triangles, OSError where the disk refuses.
    """
    Path(path).write_bytes(glb_bytes(asset, 0))


def glb_bytes(asset: Asset, lod: int = 0) -> bytes:
    """One level of detail of an asset as the bytes of a binary glTF file."""
    document = _build(asset, lod)
    if asset.lods[lod].texture is not None:
        image = document.json["images"][0]
        image["bufferView"] = document.view("texture", _png(asset.lods[lod]))
        image["mimeType"] = "image/png"
    binary = b"".join(document.chunks)
    binary += bytes(-len(binary) % 4)
    document.json["buffers"] = [{"byteLength": len(binary)}]
    text = _text(document)
    text += b" " * (-len(text) % 4)
    length = 12 + 8 + len(text) + 8 + len(binary)
    return b"".join(
        [
            struct.pack("<4sII", b"glTF", 2, length),
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(binary), b"BIN\0"),
            binary,
        ]
    )


def write_gltf(asset: Asset, path: Path | str) -> None:
    """Write the finest level of detail as glTF in JSON, with `<stem>.bin` and `<stem>_texture.png` beside it.

    asset, errors : as for `write_glb`; path : the .gltf file
    """
    path = Path(path)
    document = _build(asset, 0)
    if asset.mesh.texture is not None:
        texture = path.with_name(f"{path.stem}_texture.png")
        texture.write_bytes(_png(asset.mesh))
        document.json["images"][0]["uri"] = quote(texture.name)
    binary = path.with_suffix(".bin")
    binary.write_bytes(b"".join(document.chunks))
    document.json["buffers"] = [{"uri": quote(binary.name), "byteLength": document.length}]
    path.write_bytes(_text(document))


def _png(mesh: TexturedMesh) -> bytes:
    assert mesh.texture is not None
    return mesh.texture.png


def _text(document: _Document) -> bytes:
    head: dict[str, Any] = {"asset": document.json.pop("asset")}
    if document.used:
        head["extensionsUsed"] = sorted(document.used)
    return json.dumps(
        head | document.json, ensure_ascii=False, allow_nan=False, separators=(",", ":")
    ).encode()  # fmt: skip


def _build(asset: Asset, lod: int) -> _Document:
    mesh = split_at_parts(asset.lods[lod])
    if not len(mesh.faces):
        raise ExportError(asset.name, f"level of detail {lod} has no triangles", "give a mesh with triangles")
    document = _Document()
    extras: dict[str, Any] = {}
    if asset.placement is not None:
        extras["georeference"] = georeference(asset.placement)
    if asset.metadata:
        extras["metadata"] = asset.metadata
    document.json["asset"] = {
        "version": "2.0",
        "generator": "fig2mesh",
        **({"copyright": asset.copyright} if asset.copyright else {}),
        **({"extras": extras} if extras else {}),
    }
    document.json |= {"scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"name": asset.name, "mesh": 0}]}

    # 65535 itself is the restart index and must not occur.
    index_type = np.uint16 if len(mesh.vertices) <= 65535 else np.uint32
    corners = mesh.faces.reshape(-1).astype(index_type)
    indices = document.accessor("indices", corners, ELEMENT_ARRAY_BUFFER)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    attributes = {
        # tolist() of float32 gives the very doubles that a reader gets from the buffer.
        "POSITION": document.accessor("position", mesh.vertices, ARRAY_BUFFER, min=low.tolist(), max=high.tolist()),
    }
    if mesh.normals is not None:
        attributes["NORMAL"] = document.accessor("normal", unit_normals(mesh.normals), ARRAY_BUFFER)
    if mesh.uv is not None:
        attributes["TEXCOORD_0"] = document.accessor("texcoord", mesh.uv, ARRAY_BUFFER)
    if mesh.texture is None and mesh.colors is not None:
        attributes["COLOR_0"] = document.accessor(
            "color", _linear_rgba(mesh.colors), ARRAY_BUFFER, normalized=True
        )  # fmt: skip
    primitive: dict[str, Any] = {
        "attributes": attributes, "indices": indices, "material": _material(document, mesh, asset.lit), "mode": 4,
    }  # fmt: skip
    if mesh.parts is not None:
        primitive["extensions"] = {"EXT_mesh_features": _features(document, asset, mesh, attributes)}
    item: dict[str, Any] = {"name": asset.name, "primitives": [primitive]}
    manifold = _manifold(document, mesh, corners, indices, attributes["POSITION"])
    if manifold is not None:
        item["extensions"] = {"EXT_mesh_manifold": manifold}
    document.add("meshes", item)
    return document


def _material(document: _Document, mesh: TexturedMesh, lit: bool) -> int:
    surface: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 0.9}
    if mesh.texture is not None:
        document.json["samplers"] = [
            {
                "magFilter": LINEAR,
                "minFilter": LINEAR_MIPMAP_LINEAR,
                "wrapS": CLAMP_TO_EDGE,
                "wrapT": CLAMP_TO_EDGE,
            }
        ]
        document.json["images"] = [{"name": "texture"}]  # where its bytes are differs between .glb and .gltf
        document.json["textures"] = [{"sampler": 0, "source": 0}]
        surface["baseColorTexture"] = {"index": 0}
    material: dict[str, Any] = {"name": "drawing", "pbrMetallicRoughness": surface}
    if not lit:
        # A drawing brings its own light and shade. The fields beside it are what viewers without unlit show.
        document.used.add("KHR_materials_unlit")
        material["extensions"] = {"KHR_materials_unlit": {}}
    return document.add("materials", material)


def _linear_rgba(colors: NDArray[np.uint8]) -> NDArray[np.uint16]:
    # COLOR_0 is linear, and 8 bits of linear light band in the dark. Alpha keeps the rows at a multiple of 4 bytes.
    rgba = np.full((len(colors), 4), 65535, dtype=np.uint16)
    rgba[:, :3] = np.rint(linear_from_srgb(colors) * 65535)
    return rgba


def _features(
    document: _Document, asset: Asset, mesh: TexturedMesh, attributes: dict[str, int]
) -> dict[str, Any]:  # fmt: skip
    """Which body part each vertex belongs to, and a table of the parts."""
    assert mesh.parts is not None
    labels, rows = np.unique(mesh.parts, return_inverse=True)
    # float32 although the numbers are small: rows of one byte would break the 4-byte alignment of vertex attributes.
    attributes["_FEATURE_ID_0"] = document.accessor("part", rows.astype(np.float32), ARRAY_BUFFER)
    names = [asset.part_names.get(int(label), f"part_{label}").encode() for label in labels]
    offsets = np.cumsum([0, *map(len, names)]).astype("<u4")
    properties: dict[str, Any] = {
        "name": {"type": "STRING", "required": True, "semantic": "NAME"},
        "label": {"type": "SCALAR", "componentType": "UINT8", "required": True},
    }
    columns: dict[str, Any] = {
        "name": {
            # Empty bufferViews are invalid, and all names could be empty strings.
            "values": document.view("part names", b"".join(names) or b"\0"),
            "stringOffsets": document.view("part name offsets", offsets.tobytes()),
            "stringOffsetType": "UINT32",
        },
        "label": {"values": document.view("part labels", labels.astype(np.uint8).tobytes())},
    }
    shares = observed_shares(mesh)
    if shares is not None:
        description = "Share of the part's surface that the drawing itself shows; the rest is inferred"
        properties["observedShare"] = {
            "type": "SCALAR", "componentType": "FLOAT32", "required": True, "description": description,
        }  # fmt: skip
        values = np.array([shares[int(label)] for label in labels], dtype="<f4")
        columns["observedShare"] = {"values": document.view("part observed shares", values.tobytes())}
    document.used |= {"EXT_mesh_features", "EXT_structural_metadata"}
    document.json["extensions"] = {
        "EXT_structural_metadata": {
            "schema": {"id": "fig2mesh", "classes": {"part": {"name": "Body part", "properties": properties}}},
            "propertyTables": [{"name": "parts", "class": "part", "count": len(labels), "properties": columns}],
        }
    }
    return {"featureIds": [{"featureCount": len(labels), "attribute": 0, "propertyTable": 0, "label": "part"}]}


def _manifold(
    document: _Document, mesh: TexturedMesh, corners: NDArray[Any], indices: int, position: int
) -> dict[str, Any] | None:
    """The merges that undo the texture seams; None where the result would not be a solid: we claim only what is so."""
    solid = solid_of(mesh)
    copies = solid.first[solid.vertex]
    if not np.array_equal(mesh.vertices, mesh.vertices[copies]):
        return None
    if not measure_topology(mesh.vertices[solid.first], solid.faces).solid:
        return None
    document.used.add("EXT_mesh_manifold")
    whole = copies[mesh.faces].reshape(-1).astype(corners.dtype)
    places = np.flatnonzero(whole != corners).astype("<u4")
    primitive: dict[str, Any] = {"attributes": {"POSITION": position}, "indices": indices, "mode": 4}
    if not len(places):
        return {"manifoldPrimitive": primitive}
    values = whole[places]
    merge_indices = document.accessor("merged corners", places, None)
    merge_values = document.accessor("merged vertices", values, None)
    views = [document.json["accessors"][accessor]["bufferView"] for accessor in (merge_indices, merge_values)]
    sparse = {
        "count": len(places),
        "indices": {"bufferView": views[0], "componentType": COMPONENT_TYPES["u4"]},
        "values": {"bufferView": views[1]},
    }
    # The extension demands the index data of both primitives to be one and the same.
    shared = document.json["accessors"][indices]["bufferView"]
    primitive["indices"] = document.accessor_at("solid indices", corners, shared, sparse=sparse)
    return {"manifoldPrimitive": primitive, "mergeIndices": merge_indices, "mergeValues": merge_values}
