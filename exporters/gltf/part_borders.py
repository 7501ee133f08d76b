"""Vertices at the borders of parts, once for each part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exporters.asset import TexturedMesh
from exporters.sampling import face_parts


def split_at_parts(mesh: TexturedMesh) -> TexturedMesh:
    """The mesh with vertices doubled where parts meet, so that the corners of each triangle carry one label.

    Clients interpolate feature ids over triangles: between rows 1 and 9 of the table lie stripes of all others. In a
    figure that is every tenth triangle. https://github.com/CesiumGS/glTF/tree/3d-tiles-next/extensions/2.0/Vendor/
    EXT_mesh_features#feature-id-by-vertex

    The solid stays what it was: copies know their vertex by `solid_index`. Untouched where there are no parts, or no
    borders.
    """
    if mesh.parts is None:
        return mesh
    labels = np.repeat(face_parts(mesh), 3)
    corners = mesh.faces.reshape(-1)
    if np.array_equal(mesh.parts[corners], labels):
        return mesh
    # Copies in the order of their vertices, then of their labels.
    used, place = np.unique(corners.astype(np.int64) * 256 + labels, return_inverse=True)
    vertex, label = used // 256, (used % 256).astype(np.uint8)

    def of(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else values[vertex]

    return replace(
        mesh,
        vertices=mesh.vertices[vertex],
        faces=place.reshape(-1, 3),
        normals=of(mesh.normals),
        solid_index=mesh.solid_index[vertex],
        uv=of(mesh.uv),
        colors=of(mesh.colors),
        parts=label,
    )
