"""Splitting of long edges in the middle, with the new vertices projected onto the surface.

A hole is filled with triangles that cut across it; this bends them back onto the body. Splitting an edge together with
both its triangles keeps the mesh a closed manifold.
"""

from __future__ import annotations

import numpy as np

from fig2mesh.mesh.newton import newton
from fig2mesh.mesh.protocol import Field
from fig2mesh.mesh.topology import as_mesh, edge_pairs, half_edges
from fig2mesh.records import Mesh

PASSES = 24
"""Number of passes, each of which splits the longest edges of separate pairs of triangles; enough for an edge 30 times
too long."""


def refine(mesh: Mesh, field: Field, length: float) -> Mesh:
    """Split edges of a closed, oriented manifold until none is longer than `length`, FIGURE units."""
    for _ in range(PASSES):
        first, second = edge_pairs(mesh.faces)
        edges = half_edges(mesh.faces)[first]
        sizes = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
        # Rank instead of length: no ties, so of all long edges of a face exactly one is the longest.
        rank = np.empty(len(sizes), np.int64)
        rank[np.argsort(sizes, kind="stable")] = np.arange(len(sizes))
        longest = np.full(len(mesh.faces), -1)
        np.maximum.at(longest, first // 3, rank)
        np.maximum.at(longest, second // 3, rank)
        split = np.flatnonzero((sizes > length) & (longest[first // 3] == rank) & (longest[second // 3] == rank))
        if len(split) == 0:
            break
        ends = mesh.vertices[edges[split]].astype(np.float64)
        middles, _ = newton(
            field, ends.mean(axis=1), tolerance=1e-3 * length, reach=(sizes[split] / 2).astype(np.float32)
        )
        new = len(mesh.vertices) + np.arange(len(split))
        faces = np.array(mesh.faces)
        added = []
        for half in (first[split], second[split]):
            face, corner = half // 3, half % 3
            after, opposite = faces[face, (corner + 1) % 3], faces[face, (corner + 2) % 3]
            added.append(np.stack([new, after, opposite], axis=1))
            faces[face, (corner + 1) % 3] = new
        mesh = as_mesh(np.concatenate([mesh.vertices, middles]), np.concatenate([faces, *added]))
    return mesh
