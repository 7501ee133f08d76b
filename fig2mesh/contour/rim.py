"""Rim of a mesh: the curves along which it turns away from the viewer of the drawing.

On a smooth surface the rim is where the normal is at right angles to the line of sight. Here it is where normals that
are interpolated along the edges are: a closed polyline with a corner on every edge that it crosses.

Hertzmann and Zorin 2000, "Illustrating smooth surfaces".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fig2mesh.records import FloatArray, IntArray, Mesh

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Rim:
    """Rim of a mesh, FIGURE.

    edges : (N, 2) int32 vertices of the edges crossed; share : (N,) position of the crossing along them, 0 to 1
    points : (N, 3) crossings; outwards : (N, 2) unit normals in the picture's plane
    segments : (S, 2) int32 crossings joined by the rim, across one triangle each; the mesh's front is on their left,
        viewed from outside
    """

    edges: IntArray
    share: Floats
    points: Floats
    outwards: Floats
    segments: IntArray

    def at(self, values: NDArray[np.floating]) -> Floats:
        """(N, ...) values of the vertices (V, ...) interpolated at the crossings."""
        share = self.share.reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray((1 - share) * values[self.edges[:, 0]] + share * values[self.edges[:, 1]], np.float64)


def rim_of(mesh: Mesh, normals: FloatArray) -> Rim:
    """Rim of a closed mesh; normals : (V, 3) unit, FIGURE."""
    z = np.asarray(normals[:, 2], np.float64)
    front = z > 0
    corners = mesh.faces.astype(np.int64)
    sides = front[corners]
    crossed = corners[sides.any(axis=1) & ~sides.all(axis=1)]
    # In order of corners, the first edge leads from the front to the back, the second one back to the front.
    ends = np.stack([crossed, np.roll(crossed, -1, axis=1)], axis=2)
    leaving = front[ends[..., 0]] & ~front[ends[..., 1]]
    entering = ~front[ends[..., 0]] & front[ends[..., 1]]
    directed = np.stack([ends[leaving], ends[entering]], axis=1)
    ordered = np.sort(directed, axis=2)
    keys = ordered[..., 0] * len(mesh.vertices) + ordered[..., 1]
    _, first, index = np.unique(keys, return_index=True, return_inverse=True)
    edges = ordered.reshape(-1, 2)[first]
    start, end = z[edges[:, 0]], z[edges[:, 1]]
    share = np.clip(start / np.where(start == end, 1.0, start - end), 0.0, 1.0)
    rim = Rim(edges.astype(np.int32), share, np.empty((0, 3)), np.empty((0, 2)), index.reshape(-1, 2).astype(np.int32))
    flat = rim.at(normals[:, :2])
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-9)
    return Rim(rim.edges, share, rim.at(mesh.vertices), flat, rim.segments)
