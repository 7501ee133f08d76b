"""Finished models back from their files, with the part labels that pictures of parts need."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from exporters.asset import TexturedMesh
from exporters.gltf_reader import read_gltf
from fig2mesh.measure import load_textured

SUFFIXES = (".glb", ".gltf", ".ply", ".obj")
"""Files that are models; everything else is taken for a drawing."""


def read_model(path: Path) -> TexturedMesh:
    """The triangles of a file, ASSET, with colours and part labels where it has them. Raises ExportError."""
    mesh = load_textured(path)
    if path.suffix.lower() not in (".glb", ".gltf"):
        return mesh
    labels = _gltf_labels(path)
    return replace(mesh, parts=labels) if labels is not None and len(labels) == len(mesh.vertices) else mesh


def _gltf_labels(path: Path) -> NDArray[np.uint8] | None:
    """(V,) part label of each vertex, as `exporters.glb` writes them; None in files without."""
    gltf = read_gltf(path)
    tables = gltf.document.get("extensions", {}).get("EXT_structural_metadata", {}).get("propertyTables", [])
    attributes = gltf.items("meshes")[0]["primitives"][0]["attributes"]
    if "_FEATURE_ID_0" not in attributes or not tables or "label" not in tables[0].get("properties", {}):
        return None
    table = np.frombuffer(gltf.view(tables[0]["properties"]["label"]["values"]), np.uint8)
    return table[gltf.accessor(attributes["_FEATURE_ID_0"]).astype(np.int64)]
