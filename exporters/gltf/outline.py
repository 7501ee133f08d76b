"""Drawn contour of a figure in glTF: a mesh and a node of its own, both called `outline`.

Not a second primitive of the figure's mesh: clients switch nodes, not primitives (`model.getNode("outline").show` in
CesiumJS, `getObjectByName` in three.js, an object in Blender); Blender would join both into one mesh, which then is no
solid; and EXT_mesh_manifold is about whole meshes. The node is a child of the figure's, so that it moves with it.

No normals: its material is unlit in every file that may have extensions.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.asset import ByteArray, FloatArray, IntArray, OutlineMesh, Texture
from exporters.colour import linear_from_srgb
from exporters.gltf.document import ARRAY_BUFFER, COMPONENT_TYPES, ELEMENT_ARRAY_BUFFER, Document, bounds, index_array
from exporters.gltf.material import linear_rgba
from exporters.gltf.meshopt import quantised_uv, reordered_faces
from exporters.gltf.part_features import CLAMP_TO_EDGE, NEAREST
from exporters.profiles import Profile

OUTLINE = "outline"
"""Name of node, mesh and material, and of the extras of the mesh by which readers recognise it."""

BYTES = {number: int(code[1:]) for code, number in COMPONENT_TYPES.items()}
"""Bytes of a number, by componentType."""

HULL, RIBBON = "hull", "ribbon"


def outline_form(mesh: dict[str, Any]) -> str:
    """Form of the outline in a mesh of a document, `HULL` or `RIBBON`; "" for every other mesh."""
    extras = mesh.get("extras")
    facts = extras.get(OUTLINE) if isinstance(extras, dict) else None
    form = facts.get("form") if isinstance(facts, dict) else None
    return str(form) if form in (HULL, RIBBON) else ""


def outline_mesh(
    document: Document,
    outline: OutlineMesh,
    positions: NDArray[Any],
    profile: Profile,
    texture: int | None = None,
    texcoord: int | None = None,
) -> int:
    """Add the mesh of an outline; returns its index.

    positions : (N, 3) of `outline.vertices`, float32, or quantised for the same transform as the figure's
    texture : that of the figure, if it has one: it shows the line where the outline has texture coordinates
    texcoord : accessor of the figure's texture coordinates in documents with property textures
    """
    order, faces = _ordered(outline, profile)
    positions, colors = positions[order], outline.colors[order]
    corners = index_array(faces, len(positions))
    indices = document.accessor("outline indices", corners, ELEMENT_ARRAY_BUFFER, "TRIANGLES")
    more = bounds(positions) | ({"normalized": True} if positions.dtype.kind == "u" else {})
    position = document.accessor("outline position", positions, ARRAY_BUFFER, "ATTRIBUTES", **more)
    primitive: dict[str, Any] = {"attributes": {"POSITION": position}, "indices": indices, "mode": 4}
    attributes = primitive["attributes"]
    if outline.uv is not None and texture is not None:
        attributes["TEXCOORD_0"] = _coordinates(document, outline.uv[order], profile)
        shown: dict[str, Any] = {"baseColorTexture": {"index": texture}}
    else:
        if texcoord is not None:
            attributes["TEXCOORD_0"] = _any_coordinates(document, texcoord, len(positions))
        shown = _pens(document, colors, attributes, profile)
    primitive["material"] = _material(document, outline.culled, shown, profile)
    facts = {"form": HULL if outline.culled else RIBBON, "width_m": float(outline.width_m)}
    return document.add("meshes", {"name": OUTLINE, "primitives": [primitive], "extras": {OUTLINE: facts}})


def _coordinates(document: Document, uv: FloatArray, profile: Profile) -> int:
    if not profile.compressed:
        return document.accessor("outline texcoord", uv, ARRAY_BUFFER, "ATTRIBUTES")
    return document.accessor("outline texcoord", quantised_uv(uv), ARRAY_BUFFER, "ATTRIBUTES", normalized=True)


def _any_coordinates(document: Document, texcoord: int, count: int) -> int:
    """Add texture coordinates of an outline that nothing shows; returns the index of their accessor.

    CesiumJS (1.140) samples the property textures of a document in every primitive, and stops rendering at one without
    coordinates. Those of the figure cost no bytes.
    """
    figure = document.json["accessors"][texcoord]
    if count > figure["count"]:
        return document.accessor("outline texcoord", np.zeros((count, 2), np.float32), ARRAY_BUFFER, "ATTRIBUTES")
    # A view of several accessors must have a stride.
    document.json["bufferViews"][figure["bufferView"]]["byteStride"] = 2 * BYTES[figure["componentType"]]
    return document.add("accessors", figure | {"name": "outline texcoord", "count": count})


def _ordered(outline: OutlineMesh, profile: Profile) -> tuple[NDArray[np.int64], IntArray]:
    if profile.compressed:
        return reordered_faces(outline.faces)
    return np.arange(len(outline.vertices)), outline.faces


def _pens(document: Document, colors: ByteArray, attributes: dict[str, int], profile: Profile) -> dict[str, Any]:
    """Return the members of a material for the colours (N, 3) of vertices; adds what they need to `attributes`."""
    pens, pen = np.unique(colors, axis=0, return_inverse=True)
    if not profile.vertex_colors:
        # One texel for each pen, also where there is only one: QGIS shows nothing but textured surfaces unlit.
        attributes["TEXCOORD_0"] = document.accessor(
            "outline texcoord", _texel_centres(pen.reshape(-1), len(pens)), ARRAY_BUFFER, "ATTRIBUTES"
        )
        return {"baseColorTexture": {"index": _palette(document, pens)}}
    if len(pens) == 1:
        return {"baseColorFactor": [*np.round(linear_from_srgb(pens[0] / 255.0), 6).tolist(), 1.0]}
    attributes["COLOR_0"] = document.accessor(
        "outline color", linear_rgba(colors), ARRAY_BUFFER, "ATTRIBUTES", normalized=True
    )
    return {}


def _material(document: Document, culled: bool, shown: dict[str, Any], profile: Profile) -> int:
    """Add the material; returns its index. shown : its colour or texture."""
    surface = {**shown, "metallicFactor": 0.0, "roughnessFactor": 1.0}
    # A ribbon has faces on its back too, as some clients ignore this flag; Blender removes them as duplicates.
    item: dict[str, Any] = {"name": OUTLINE, "pbrMetallicRoughness": surface, "doubleSided": not culled}
    if profile.extensions:
        document.used.add("KHR_materials_unlit")
        item["extensions"] = {"KHR_materials_unlit": {}}
    return document.add("materials", item)


def _texel_centres(pen: NDArray[np.int64], count: int) -> FloatArray:
    return np.stack([(pen + 0.5) / count, np.full(len(pen), 0.5)], axis=1).astype(np.float32)


def _palette(document: Document, pens: ByteArray) -> int:
    """Add a texture of one row with the colours of the pens; returns its index."""
    view = document.view("outline colours", Texture(pens[None]).png)
    image = document.add("images", {"name": OUTLINE, "bufferView": view, "mimeType": "image/png"})
    sampler = document.add(
        "samplers",
        {"magFilter": NEAREST, "minFilter": NEAREST, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE},
    )
    return document.add("textures", {"name": OUTLINE, "sampler": sampler, "source": image})
