"""Solids with outlines for the tests of pictures and measures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exporters.asset import OutlineMesh, TexturedMesh

PEN = (20, 16, 12)


def hulled(mesh: TexturedMesh, inset: float, *, culled: bool = True) -> TexturedMesh:
    """The mesh moved inwards along its normals' axes by `inset`, and its old surface, reversed, in the pen's colour.

    mesh : a box or another solid whose vertices can be moved towards its middle, axis by axis
    """
    vertices, low, high = mesh.vertices, mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    middle, half = (low + high) / 2, (high - low) / 2
    surface = np.zeros((int(mesh.solid_index.max()) + 1, 3), np.float32)
    surface[mesh.solid_index] = vertices
    outline = OutlineMesh(
        surface,
        mesh.solid_faces[:, ::-1],
        np.broadcast_to(np.uint8(PEN), (len(surface), 3)),
        culled,
        surface,
        inset,
    )
    return replace(mesh, vertices=middle + (vertices - middle) * (half - inset) / half, outline=outline)
