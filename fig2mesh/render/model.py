"""Reader of finished models, with the part labels that pictures of parts need."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from exporters.asset import TexturedMesh
from exporters.errors import ExportError
from exporters.gltf.reader import Gltf, read_gltf
from exporters.gltf.shape import MESHOPT
from fig2mesh.measure.model import load_textured
from georef.untrusted.damage import DamagedFile
from georef.untrusted.image_file import check_header

SUFFIXES = (".glb", ".gltf", ".ply", ".obj")
"""Suffixes of models; every other file is taken for a drawing."""

COMPRESSION = {*MESHOPT, "KHR_draco_mesh_compression", "KHR_texture_basisu"}
"""Extensions of glTF files that trimesh, which reads models, cannot read."""


def read_model(path: Path) -> TexturedMesh:
    """Read the triangles of a file, ASSET, with colours and part labels if it has them. Raises ExportError."""
    if path.suffix.lower() not in (".glb", ".gltf"):
        return load_textured(path)
    gltf = read_gltf(path)
    try:
        packed = sorted(set(gltf.document.get("extensionsRequired", [])) & COMPRESSION)
        if packed:
            raise ExportError(path, f"is compressed ({', '.join(packed)})", "give a file written without --profile")
        _check_costs(gltf)
        mesh = load_textured(path)
        labels = _gltf_labels(gltf)
    except DamagedFile as error:
        raise ExportError(path, f"invalid glTF ({error})", "see fig2mesh validate") from error
    return replace(mesh, parts=labels) if labels is not None and len(labels) == len(mesh.vertices) else mesh


def _check_costs(gltf: Gltf) -> None:
    """Raise DamagedFile for what trimesh does not check: counts, trees of nodes, external files, their pixels."""
    gltf.instances()
    for index in range(len(gltf.items("accessors"))):
        gltf.accessor(index)
    for index in range(len(gltf.items("images"))):
        check_header(gltf.image(index))


def _gltf_labels(gltf: Gltf) -> NDArray[np.uint8] | None:
    """(V,) part label of each vertex, as `exporters.gltf.glb` writes them; None in files without."""
    attributes: dict[str, int] = next((primitive["attributes"] for primitive in gltf.primitives(0)), {})
    if "_PART" in attributes:
        return gltf.accessor(attributes["_PART"]).astype(np.uint8)
    label = gltf.tables[0].get("properties", {}).get("label") if gltf.tables else None
    if "_FEATURE_ID_0" not in attributes or label is None:
        return None
    table, ids = gltf.column(label["values"], "u1"), gltf.accessor(attributes["_FEATURE_ID_0"])
    if not ((ids >= 0) & (ids < len(table))).all():
        raise DamagedFile(f"feature ids outside 0..{len(table) - 1}")
    return table[ids.astype(np.int64)]
