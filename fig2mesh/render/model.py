"""Finished models back from their files, with the part labels that pictures of parts need."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from exporters.asset import TexturedMesh
from exporters.errors import DAMAGE, ExportError
from exporters.gltf.reader import MESHOPT, Gltf, read_gltf
from fig2mesh.measure.model import load_textured
from georef.untrusted.image_file import check_head

SUFFIXES = (".glb", ".gltf", ".ply", ".obj")
"""Files that are models; everything else is taken for a drawing."""

COMPRESSION = {*MESHOPT, "KHR_draco_mesh_compression", "KHR_texture_basisu"}
"""Extensions of glTF files that trimesh, which reads models, cannot read."""


def read_model(path: Path) -> TexturedMesh:
    """The triangles of a file, ASSET, with colours and part labels where it has them. Raises ExportError."""
    if path.suffix.lower() not in (".glb", ".gltf"):
        return load_textured(path)
    gltf = read_gltf(path)
    try:
        packed = sorted(set(gltf.document.get("extensionsRequired", [])) & COMPRESSION)
        if packed:
            raise ExportError(path, f"is compressed ({', '.join(packed)})", "give the file written without --profile")
        _check_costs(gltf)
        mesh = load_textured(path)
        labels = _gltf_labels(gltf)
    except DAMAGE as error:
        reason = " ".join(str(error).split())[:120]
        raise ExportError(path, f"broken glTF ({type(error).__name__}: {reason})", "see fig2mesh validate") from error
    return replace(mesh, parts=labels) if labels is not None and len(labels) == len(mesh.vertices) else mesh


def _check_costs(gltf: Gltf) -> None:
    """Raise ValueError for what trimesh would take on trust: counts, trees of nodes, files beside, their pixels."""
    gltf.instances()
    for index in range(len(gltf.items("accessors"))):
        gltf.accessor(index)
    for index in range(len(gltf.items("images"))):
        check_head(gltf.image(index))


def _gltf_labels(gltf: Gltf) -> NDArray[np.uint8] | None:
    """(V,) part label of each vertex, as `exporters.gltf.glb` writes them; None in files without."""
    tables = gltf.document.get("extensions", {}).get("EXT_structural_metadata", {}).get("propertyTables", [])
    attributes = gltf.items("meshes")[0]["primitives"][0]["attributes"]
    if "_PART" in attributes:
        return gltf.accessor(attributes["_PART"]).astype(np.uint8)
    if "_FEATURE_ID_0" not in attributes or not tables or "label" not in tables[0].get("properties", {}):
        return None
    table = np.frombuffer(gltf.view(tables[0]["properties"]["label"]["values"]), np.uint8)
    return table[gltf.accessor(attributes["_FEATURE_ID_0"]).astype(np.int64)]
