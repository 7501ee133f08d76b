"""glTF extensions of a figure: body parts, observed surface and solid.

https://github.com/CesiumGS/glTF/tree/3d-tiles-next/extensions/2.0/Vendor/EXT_mesh_features
https://github.com/CesiumGS/glTF/tree/3d-tiles-next/extensions/2.0/Vendor/EXT_structural_metadata
https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_mesh_manifold
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.asset import Asset, TexturedMesh
from exporters.gltf.document import ARRAY_BUFFER, COMPONENT_TYPES, Document
from exporters.sampling import observed_shares
from exporters.solid import measure_topology, solid_of

NEAREST, CLAMP_TO_EDGE = 9728, 33071


def features(document: Document, asset: Asset, mesh: TexturedMesh, attributes: dict[str, int]) -> dict[str, Any]:
    """Add EXT_mesh_features of a primitive with parts, its entry in `attributes`, and a property table of the parts."""
    assert mesh.parts is not None
    labels, rows = np.unique(mesh.parts, return_inverse=True)
    # float32 although the numbers are small: rows of one byte would violate the 4-byte alignment of vertex attributes.
    attributes["_FEATURE_ID_0"] = document.accessor("part", rows.astype(np.float32), ARRAY_BUFFER, "ATTRIBUTES")
    names = [asset.part_names.get(int(label), f"part_{label}").encode() for label in labels]
    offsets = np.cumsum([0, *map(len, names)]).astype("<u4")
    properties: dict[str, Any] = {
        "name": {"type": "STRING", "required": True, "semantic": "NAME"},
        "label": {"type": "SCALAR", "componentType": "UINT8", "required": True},
    }
    columns: dict[str, Any] = {
        "name": {
            # Empty bufferViews are invalid, and all names may be empty strings.
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
            "type": "SCALAR",
            "componentType": "FLOAT32",
            "required": True,
            "description": description,
        }
        values = np.array([shares[int(label)] for label in labels], dtype="<f4")
        columns["observedShare"] = {"values": document.view("part observed shares", values.tobytes())}
    document.used |= {"EXT_mesh_features", "EXT_structural_metadata"}
    schema = {"id": "fig2mesh", "classes": {"part": {"name": "Body part", "properties": properties}}}
    table = {"name": "parts", "class": "part", "count": len(labels), "properties": columns}
    document.json.setdefault("extensions", {})["EXT_structural_metadata"] = {
        "schema": schema,
        "propertyTables": [table],
    }
    return {"featureIds": [{"featureCount": len(labels), "attribute": 0, "propertyTable": 0, "label": "part"}]}


def observed_texels(document: Document, mesh: TexturedMesh) -> dict[str, Any] | None:
    """Add EXT_structural_metadata of a primitive with a mask of observed texels: a property texture `observed`, 1 where
    the drawing shows the surface and 0 where it is inferred, in the texture coordinates of the colours.

    Call it after `features`, whose schema it extends. None where the mesh has no such mask, or no texture.
    """
    if mesh.parts is None or mesh.observed is None or mesh.texture is None:
        return None
    metadata = document.json["extensions"]["EXT_structural_metadata"]
    description = "1 where the drawing itself shows the surface, 0 where it is inferred"
    metadata["schema"]["classes"]["surface"] = {
        "name": "Surface",
        "properties": {
            "observed": {
                "type": "SCALAR",
                "componentType": "UINT8",
                "normalized": True,
                "required": True,
                "description": description,
            },
        },
    }
    # Always a PNG: masks are small, and every client with the extension reads it.
    view = document.view("observed", mesh.observed.png)
    image = document.add("images", {"name": "observed", "bufferView": view, "mimeType": "image/png"})
    sampler = document.add(
        "samplers",
        {"magFilter": NEAREST, "minFilter": NEAREST, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE},
    )
    texture = document.add("textures", {"name": "observed", "sampler": sampler, "source": image})
    observed = {"index": texture, "texCoord": 0, "channels": [0]}
    metadata["propertyTextures"] = [{"name": "surface", "class": "surface", "properties": {"observed": observed}}]
    return {"propertyTextures": [0]}


def manifold(
    document: Document, mesh: TexturedMesh, corners: NDArray[Any], indices: int, position: int
) -> dict[str, Any] | None:
    """Add EXT_mesh_manifold of a mesh: the merges of vertices that undo the texture seams.

    None where the result would not be a solid.
    """
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
    merge_indices = document.accessor("merged corners", places, None, "INDICES")
    merge_values = document.accessor("merged vertices", values, None, "INDICES")
    views = [document.json["accessors"][accessor]["bufferView"] for accessor in (merge_indices, merge_values)]
    sparse = {
        "count": len(places),
        "indices": {"bufferView": views[0], "componentType": COMPONENT_TYPES["u4"]},
        "values": {"bufferView": views[1]},
    }
    # The extension requires that both primitives share their index data.
    shared = document.json["accessors"][indices]["bufferView"]
    primitive["indices"] = document.accessor_at("solid indices", corners, shared, sparse=sparse)
    return {"manifoldPrimitive": primitive, "mergeIndices": merge_indices, "mergeValues": merge_values}
