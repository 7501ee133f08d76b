"""Edges, fans and components of meshes, for repair and simplification.

Whether a mesh is a solid is checked by `exporters.solid.measure_topology` alone; `check_solid` calls it. The functions
here label what it counts, and also connect triangles over edges with a third one. Corner `3f + k` is the k-th corner of
face f, half-edge `3f + k` the directed edge that leaves it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from exporters.solid import Topology, measure_topology, piece_volumes
from fig2mesh.records import Mesh

Indices = NDArray[Any]


def half_edges(faces: Indices) -> Indices:
    """(3F, 2) directed edges; row 3f + k runs from corner k of face f to corner k + 1."""
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2).astype(np.int64)


def edge_keys(edges: Indices, count: int, directed: bool = False) -> Indices:
    """(N,) one integer for each edge (N, 2) between `count` vertices; the same for both directions if undirected."""
    low, high = edges[:, 0].astype(np.int64), edges[:, 1].astype(np.int64)
    if not directed:
        low, high = np.minimum(low, high), np.maximum(low, high)
    return low * count + high


def edge_pairs(faces: Indices) -> tuple[Indices, Indices]:
    """Pairs of half-edges that share an undirected edge, as two arrays of equal length; a third one is paired too."""
    edges = half_edges(faces)
    keys = edge_keys(edges, int(faces.max(initial=0)) + 1)
    order = np.argsort(keys, kind="stable")
    same = keys[order[1:]] == keys[order[:-1]]
    return order[:-1][same], order[1:][same]


def _labels(first: Indices, second: Indices, count: int) -> tuple[int, Indices]:
    graph = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(count, count))
    number, labels = connected_components(graph, directed=False)
    return int(number), labels


def face_components(faces: Indices) -> Indices:
    """(F,) int32 number of the component each face belongs to; components are connected through edges."""
    first, second = edge_pairs(faces)
    return _labels(first // 3, second // 3, len(faces))[1]


def vertex_fans(faces: Indices) -> tuple[int, Indices]:
    """Number of fans of triangles round a vertex, and (3F,) the fan of each corner."""
    first, second = edge_pairs(faces)
    corners = faces.reshape(-1)
    after = np.arange(len(corners)) // 3 * 3 + (np.arange(len(corners)) + 1) % 3
    # Neighbours normally run along their edge in opposite directions; the others occur during repair.
    opposed = corners[first] == corners[after[second]]
    start = np.where(opposed, after[second], second)
    end = np.where(opposed, second, after[second])
    return _labels(np.concatenate([first, after[first]]), np.concatenate([start, end]), len(corners))


def boundary_edges(faces: Indices) -> Indices:
    """(B, 2) directed edges whose undirected edge belongs to one face only."""
    edges = half_edges(faces)
    keys = edge_keys(edges, int(faces.max(initial=0)) + 1)
    order = np.argsort(keys, kind="stable")
    apart = np.ones(len(keys) + 1, np.bool_)
    apart[1:-1] = keys[order[1:]] != keys[order[:-1]]
    single: Indices = edges[np.sort(order[apart[1:] & apart[:-1]])]
    return single


def component_volumes(mesh: Mesh, labels: Indices) -> NDArray[np.float64]:
    """(C,) signed volume of each component, with (F,) component numbers from `face_components`."""
    if len(labels) == 0:
        return np.zeros(0)
    return piece_volumes(mesh.vertices.astype(np.float64)[mesh.faces], labels)


def component_areas(mesh: Mesh, labels: Indices) -> NDArray[np.float64]:
    """(C,) area of each component."""
    return np.bincount(labels, face_areas(mesh)).astype(np.float64)


def face_areas(mesh: Mesh) -> NDArray[np.float64]:
    """(F,) area of each triangle."""
    return np.asarray(np.linalg.norm(face_vectors(mesh), axis=1) / 2)


def face_vectors(mesh: Mesh) -> NDArray[np.float64]:
    """(F, 3) normals of the triangles, twice the area long."""
    corners = mesh.vertices.astype(np.float64)[mesh.faces]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def check_solid(mesh: Mesh) -> Topology:
    """Topology of a mesh: closedness, pieces, handles and volume; volumes in FIGURE units cubed."""
    return measure_topology(mesh.vertices, mesh.faces)


def as_mesh(vertices: NDArray[Any], faces: NDArray[Any]) -> Mesh:
    """Make a `Mesh` from arrays of any precision."""
    return Mesh(vertices.astype(np.float32), faces.astype(np.int32))


def compact(mesh: Mesh) -> Mesh:
    """Drop vertices that no face uses."""
    used, inverse = np.unique(mesh.faces, return_inverse=True)
    if len(used) == len(mesh.vertices):
        return mesh
    return as_mesh(mesh.vertices[used], inverse.reshape(-1, 3))


def select_faces(mesh: Mesh, keep: NDArray[np.bool_]) -> Mesh:
    """Select the faces where `keep` (F,) holds, with the vertices they use."""
    return compact(as_mesh(mesh.vertices, mesh.faces[keep]))


def join(meshes: list[Mesh]) -> Mesh:
    """Concatenate meshes, in order, without merging vertices."""
    if not meshes:
        return as_mesh(np.zeros((0, 3)), np.zeros((0, 3)))
    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    return as_mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]),
    )
