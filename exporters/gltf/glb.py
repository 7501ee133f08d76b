"""Writer of glTF 2.0, as one binary file or as .gltf with a .bin and a texture next to it.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html

Without a profile, extensions are only ever *used*, never *required*: CesiumJS rejects files that require unknown
extensions, and every viewer shows the figure without them. For the files for one client see `exporters.profiles`.

Placement: the node does not rotate the figure. glTF has no georeference; the front of every model is +Z, and whatever
places it on a globe rotates it: a tileset by its transform, CesiumJS by the heading of an entity, an artist by hand.
A rotated node would rotate it twice there. Place and heading are in `asset.extras.georeference`. The only node
transform, in quantised files, maps their integers to metres.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from exporters.asset import Asset, Texture, TexturedMesh
from exporters.errors import ExportError
from exporters.georeference import georeference
from exporters.gltf import xmp
from exporters.gltf.document import ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, Document, bounds, index_array
from exporters.gltf.ktx2 import padded
from exporters.gltf.material import linear_rgba, material, texture_file
from exporters.gltf.meshopt import quantised, quantised_uv, reordered
from exporters.gltf.outline import OUTLINE, outline_mesh
from exporters.gltf.part_borders import split_at_parts
from exporters.gltf.part_features import features, manifold, observed_texels
from exporters.profiles import GENERAL, Profile
from exporters.solid import unit_normals


def write_glb(asset: Asset, path: Path | str, profile: Profile = GENERAL) -> None:
    """Write the finest level of detail as a self-contained binary glTF.

    asset : vertices in the ASSET frame, written unchanged as float32 unless the profile compresses; its place goes
        into `asset.extras`
    path : the .glb file, replaced if it exists; see `exporters.write.write` for writing it atomically
    profile : of the client of the file

    Raises ExportError for a mesh without triangles or where the profile needs a package that is not installed,
    OSError where it cannot be written.
    """
    Path(path).write_bytes(glb_bytes(asset, 0, profile))


def glb_bytes(asset: Asset, lod: int = 0, profile: Profile = GENERAL) -> bytes:
    """Return one level of detail of an asset as the bytes of a binary glTF file."""
    document, texture = _build(asset, lod, profile)
    if texture is not None:
        image = document.json["images"][0]
        data, image["mimeType"] = texture_file(texture, profile)
        image["bufferView"] = document.view("texture", data)
    return document.glb()


def write_gltf(asset: Asset, path: Path | str, profile: Profile = GENERAL) -> None:
    """Write the finest level of detail as glTF in JSON, with `<stem>.bin` and `<stem>_texture.png` next to it.

    asset, profile, errors : as for `write_glb`; path : the .gltf file
    """
    path = Path(path)
    document, texture = _build(asset, 0, profile)
    if texture is not None:
        file = path.with_name(path.stem + profile.texture_ending)
        data, document.json["images"][0]["mimeType"] = texture_file(texture, profile)
        file.write_bytes(data)
        document.json["images"][0]["uri"] = quote(file.name)
    binary = path.with_suffix(".bin")
    binary.write_bytes(b"".join(document.chunks))
    path.write_bytes(document.text({"uri": quote(binary.name), "byteLength": document.length}))


def _build(asset: Asset, lod: int, profile: Profile) -> tuple[Document, Texture | None]:
    """Build the document without the bytes of its image, and that image."""
    mesh = split_at_parts(asset.lods[lod])
    if not len(mesh.faces):
        raise ExportError(asset.name, f"level of detail {lod} has no triangles", "give a mesh with triangles")
    document = Document(profile.compressed)
    node: dict[str, Any] = {"name": asset.name, "mesh": 0}
    document.json["asset"] = _about(document, asset, profile)
    document.json |= {"scene": 0, "scenes": [{"nodes": [0]}], "nodes": [node]}
    if profile.compressed:
        mesh = reordered(mesh)
    if profile.texture == "ktx2":
        mesh = padded(mesh)
    corners = index_array(mesh.faces, len(mesh.vertices))
    indices = document.accessor("indices", corners, ELEMENT_ARRAY_BUFFER, "TRIANGLES")
    figure, outline = _positions(mesh, node, profile)
    attributes = _attributes(document, mesh, figure, asset.lit, profile)
    primitive: dict[str, Any] = {
        "attributes": attributes,
        "indices": indices,
        "material": material(document, mesh, asset.lit, profile),
        "mode": 4,
    }
    item: dict[str, Any] = {"name": asset.name, "primitives": [primitive]}
    shown = None
    if profile.extensions:
        if mesh.parts is not None:
            primitive["extensions"] = {"EXT_mesh_features": features(document, asset, mesh, attributes)}
            shown = observed_texels(document, mesh) if asset.observed_pixels else None
            if shown is not None:
                primitive["extensions"]["EXT_structural_metadata"] = shown
    elif mesh.parts is not None:
        # In core glTF: a custom attribute with the labels; their names are on the node.
        attributes["_PART"] = document.accessor("part", mesh.parts.astype(np.float32), ARRAY_BUFFER, "ATTRIBUTES")
    if not profile.extensions:
        node |= _node_extras(asset, mesh)
    document.add("meshes", item)
    if mesh.outline is not None:
        texcoord = attributes["TEXCOORD_0"] if shown is not None else None
        texture = None if mesh.texture is None else 0
        drawn = outline_mesh(document, mesh.outline, outline, profile, texture, texcoord)
        node["children"] = [document.add("nodes", {"name": OUTLINE, "mesh": drawn})]
    # After all other accessors: VTK (9.7) drops the one with sparse indices, and miscounts those that follow.
    solid = manifold(document, mesh, corners, indices, attributes["POSITION"]) if profile.extensions else None
    if solid is not None:
        item["extensions"] = {"EXT_mesh_manifold": solid}
    return document, mesh.texture


def _about(document: Document, asset: Asset, profile: Profile) -> dict[str, Any]:
    extras: dict[str, Any] = {}
    if asset.placement is not None:
        extras["georeference"] = georeference(asset.placement)
    if asset.metadata:
        extras["metadata"] = asset.metadata
    about: dict[str, Any] = {"version": "2.0", "generator": "fig2mesh"}
    if asset.copyright:
        about["copyright"] = asset.copyright
    if profile.extensions:
        document.used.add(xmp.EXTENSION)
        document.json["extensions"] = {xmp.EXTENSION: {"packets": [xmp.packet(asset)]}}
        about["extensions"] = {xmp.EXTENSION: {"packet": 0}}
    return about | ({"extras": extras} if extras else {})


def _node_extras(asset: Asset, mesh: TexturedMesh) -> dict[str, Any]:
    """Facts for clients without extensions; Blender converts them to custom properties."""
    extras: dict[str, Any] = {}
    if mesh.parts is not None:
        labels = np.unique(mesh.parts).tolist()
        extras["parts"] = {str(label): asset.part_names.get(label, f"part_{label}") for label in labels}
    if asset.placement is not None:
        extras["georeference"] = georeference(asset.placement)
    if asset.copyright:
        extras["copyright"] = asset.copyright
    return {"extras": extras} if extras else {}


def _positions(mesh: TexturedMesh, node: dict[str, Any], profile: Profile) -> tuple[NDArray[Any], NDArray[Any]]:
    """Positions of the vertices of the figure and of its outline, (0, 3) without one, as stored in the file.

    Quantised ones are all in the frame of `node`, which gets its transform here: the outline's node is its child.
    """
    count = len(mesh.vertices)
    outline = np.empty((0, 3), np.float32) if mesh.outline is None else mesh.outline.vertices
    if not profile.compressed:
        return mesh.vertices, outline
    positions = quantised(np.concatenate([mesh.vertices, outline]))
    node |= {"translation": list(positions.origin), "scale": [positions.scale] * 3}
    return positions.steps[:count], positions.steps[count:]


def _attributes(
    document: Document, mesh: TexturedMesh, positions: NDArray[Any], lit: bool, profile: Profile
) -> dict[str, int]:
    """Add the accessors of the vertices; positions : as stored."""
    normals = mesh.normals
    if not profile.extensions and normals is None:
        normals = mesh.shading_normals  # the surface will be lit, and is smooth only with these
    elif profile.compressed and not lit:
        normals = None  # no client of this file uses them
    attributes = {}

    def add(semantic: str, name: str, array: Any, **more: Any) -> None:
        attributes[semantic] = document.accessor(name, array, ARRAY_BUFFER, "ATTRIBUTES", **more)

    if profile.compressed:
        document.require("KHR_mesh_quantization")
        add("POSITION", "position", positions, normalized=True, **bounds(positions))
        if normals is not None:
            attributes["NORMAL"] = document.octahedral("normal", unit_normals(normals))
        if mesh.uv is not None:
            add("TEXCOORD_0", "texcoord", quantised_uv(mesh.uv), normalized=True)
    else:
        # tolist() of float32 gives the same doubles that a reader gets from the buffer.
        add("POSITION", "position", positions, **bounds(positions))
        if normals is not None:
            add("NORMAL", "normal", unit_normals(normals))
        if mesh.uv is not None:
            add("TEXCOORD_0", "texcoord", mesh.uv)
    if mesh.texture is None and mesh.colors is not None and profile.vertex_colors:
        add("COLOR_0", "color", linear_rgba(mesh.colors), normalized=True)
    return attributes
