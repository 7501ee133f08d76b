"""Repair of the triangles of ball pivoting to an oriented manifold with holes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fig2mesh.mesh.newton import outward
from fig2mesh.mesh.protocol import Field
from fig2mesh.mesh.topology import (
    as_mesh,
    boundary_edges,
    edge_keys,
    face_components,
    face_vectors,
    half_edges,
    select_faces,
    vertex_fans,
)
from fig2mesh.records import Mesh

PEELINGS = 10

ISLAND_FACES = 50
"""Threshold of faces, below which an open patch may be a flap."""

ISLAND_DISTANCE = 3.0
"""Threshold of distance, edge lengths, beyond which a patch is a piece of the drawing, however small."""


def orient(mesh: Mesh, field: Field) -> Mesh:
    """Turn each face so that its normal follows the field's gradient at its middle.

    Done once, before any hole is closed. Done again in every round it turned faces that span a thin limb, whose
    removal tore the next hole: fingers were eaten, 9 cm of them.
    """
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    wrong = np.einsum("fd,fd->f", face_vectors(mesh), outward(field, middles, median_edge(mesh) / 2)) < 0
    return as_mesh(mesh.vertices, np.where(wrong[:, None], mesh.faces[:, ::-1], mesh.faces))


def drop_conflicts(mesh: Mesh) -> Mesh:
    """Drop faces that use a vertex twice, repeat another face, or share a directed edge with one.

    An edge with three faces has two in the same direction, so what remains is oriented and has manifold edges.
    """
    faces = mesh.faces[(mesh.faces != np.roll(mesh.faces, 1, axis=1)).all(axis=1)]
    count = len(mesh.vertices)
    low, middle, high = np.sort(faces, axis=1).astype(np.int64).T
    order = np.lexsort((high, middle, low))
    again = np.zeros(len(faces), np.bool_)
    sides, tops = (low * count + middle)[order], high[order]
    again[order[1:]] = (sides[1:] == sides[:-1]) & (tops[1:] == tops[:-1])
    faces = faces[~again]
    keys = edge_keys(half_edges(faces), count, directed=True)
    order = np.argsort(keys, kind="stable")
    same = keys[order[1:]] == keys[order[:-1]]
    conflict = np.zeros(len(faces), np.bool_)
    conflict[order[1:][same] // 3] = True
    conflict[order[:-1][same] // 3] = True
    return as_mesh(mesh.vertices, faces[~conflict])


def separate_fans(mesh: Mesh) -> Mesh:
    """Leave one fan of triangles at each vertex: the largest one; smaller ones become part of the holes beside them.

    Giving each fan its own copy of the vertex, as PyMeshLab does, keeps all faces, but the copies lie in the same hole
    and filling it joins them by edges of no length: 18 triangles without area in 20,000. Copies are made only for
    what is left after `PEELINGS` passes.
    """
    for _ in range(PEELINGS):
        count, fans = vertex_fans(mesh.faces)
        corners = mesh.faces.reshape(-1)
        if count == np.count_nonzero(np.bincount(corners, minlength=1)):
            return mesh
        sizes = np.bincount(fans, minlength=count)
        owner = np.zeros(count, np.int64)
        owner[fans] = corners
        best = np.full(len(mesh.vertices), -1)
        order = np.argsort(sizes, kind="stable")
        best[owner[order]] = order
        mesh = as_mesh(mesh.vertices, mesh.faces[(best[corners] == fans).reshape(-1, 3).all(axis=1)])
    return split_vertices(mesh)


def split_vertices(mesh: Mesh) -> Mesh:
    """Give each fan of triangles round a vertex a vertex of its own; positions are kept, unused vertices dropped."""
    count, fans = vertex_fans(mesh.faces)
    source = np.zeros(count, np.int64)
    source[fans] = mesh.faces.reshape(-1)
    return as_mesh(mesh.vertices[source], fans.reshape(-1, 3))


def drop_islands(mesh: Mesh) -> Mesh:
    """Drop small open patches that lie close to the rest: flaps inside creases, not pieces of the drawing."""
    labels = face_components(mesh.faces)
    sizes = np.bincount(labels)
    border = np.zeros(len(mesh.vertices), np.bool_)
    border[boundary_edges(mesh.faces)] = True
    is_open = np.bincount(labels, border[mesh.faces].any(axis=1)) > 0
    suspects = np.flatnonzero((sizes < ISLAND_FACES) & is_open)
    if len(suspects) == 0 or len(suspects) == len(sizes):
        return mesh
    rest = ~np.isin(labels, suspects)
    tree = cKDTree(mesh.vertices[np.unique(mesh.faces[rest])])
    length = median_edge(mesh)
    keep = rest.copy()
    for suspect in suspects:
        chosen = labels == suspect
        distance, _ = tree.query(mesh.vertices[np.unique(mesh.faces[chosen])])
        if float(np.median(distance)) > ISLAND_DISTANCE * length:
            keep |= chosen
    return select_faces(mesh, keep)


def median_edge(mesh: Mesh) -> float:
    """Median length of the edges, FIGURE units."""
    edges: NDArray[Any] = half_edges(mesh.faces)
    return float(np.median(np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)))
