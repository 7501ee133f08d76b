"""Splitting of vertices at the borders of parts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exporters.asset import TexturedMesh
from exporters.sampling import face_parts


def split_at_parts(mesh: TexturedMesh) -> TexturedMesh:
    """Duplicate vertices where parts meet, so that all corners of each triangle have the same label.

    Clients interpolate feature ids over triangles: between rows 1 and 9 of the table there would be stripes of all
    others, in every tenth triangle of a figure. https://github.com/CesiumGS/glTF/tree/3d-tiles-next/extensions/2.0/Vendor/
    EXT_mesh_features#feature-id-by-vertex

    The solid does not change: copies refer to their vertex by `solid_index`. Unchanged without parts or borders.
    """
    if mesh.parts is None:
        return mesh
    labels = np.repeat(face_parts(mesh), 3)
    corners = mesh.faces.reshape(-1)
    if np.array_equal(mesh.parts[corners], labels):
        return mesh
    # Copies in the order of their vertices, then of their labels.
    used, new_corners = np.unique(corners.astype(np.int64) * 256 + labels, return_inverse=True)
    vertex, label = used // 256, (used % 256).astype(np.uint8)

    def picked(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else values[vertex]

    return replace(
        mesh,
        vertices=mesh.vertices[vertex],
        faces=new_corners.reshape(-1, 3),
        normals=picked(mesh.normals),
        solid_index=mesh.solid_index[vertex],
        uv=picked(mesh.uv),
        colors=picked(mesh.colors),
        parts=label,
    )
