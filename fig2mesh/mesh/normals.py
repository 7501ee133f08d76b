"""Smooth normals at the vertices of a mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fig2mesh.mesh.protocol import Field
from fig2mesh.mesh.topology import face_vectors
from fig2mesh.records import FloatArray, Mesh

AGREE = 0.5
"""Threshold of the cosine between the field's normal and the triangles', below which the triangles' is used: creases,
thin rims."""


def vertex_normals(mesh: Mesh, field: Field | None = None) -> FloatArray:
    """(V, 3) float32 unit normals, FIGURE.

    The triangles' normals weighted by their area; with a `field` its gradient, which is more exact on a smooth body
    than a simplified mesh, wherever the two differ by less than 60 degrees. Never zero: a vertex without area gets +z.
    """
    flat = face_vectors(mesh)
    summed: NDArray[np.float64] = np.stack(
        [
            np.bincount(mesh.faces.reshape(-1), np.repeat(flat[:, axis], 3), len(mesh.vertices)).astype(np.float64)
            for axis in range(3)
        ],
        axis=1,
    )
    own, sound = _unit(summed)
    own[~sound] = [0.0, 0.0, 1.0]
    if field is not None:
        smooth, steep = _unit(field.gradient(mesh.vertices).astype(np.float64))
        take = steep & ((np.einsum("vd,vd->v", smooth, own) > AGREE) | ~sound)
        own[take] = smooth[take]
    return own.astype(np.float32)


def _unit(vectors: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.maximum(length, 1e-30), length[:, 0] > 1e-12
