"""Is a mesh a solid? Closed, oriented, manifold; how many pieces, how many handles, how much volume.

All measures are combinatorial except the volume: coordinates never decide whether an edge is shared. Corner `3f + k`
is the k-th corner of face f, half-edge `3f + k` the directed edge that leaves it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fig2mesh.records import Mesh

Indices = NDArray[Any]


@dataclass(frozen=True)
class SolidReport:
    """What `check_solid` finds.

    vertices, triangles : counts; vertices that no triangle uses do not count
    closed : every edge has a triangle on both sides
    oriented : neighbouring triangles agree on the outside
    manifold_edges, manifold_vertices : no edge has a third triangle, no two fans meet in one vertex
    components : pieces connected through edges
    genus : handles of all pieces together; meaningful where closed, oriented and manifold
    euler : V - E + F
    volume : enclosed volume, FIGURE units cubed
    least_volume : signed volume of the component with the smallest one
    """

    vertices: int
    triangles: int
    closed: bool
    oriented: bool
    manifold_edges: bool
    manifold_vertices: bool
    components: int
    genus: int
    euler: int
    volume: float
    least_volume: float

    @property
    def manifold(self) -> bool:
        """No edge with a third triangle and no vertex where two fans meet."""
        return self.manifold_edges and self.manifold_vertices

    @property
    def solid(self) -> bool:
        """A closed, oriented manifold whose every piece has its inside inside."""
        return self.closed and self.oriented and self.manifold and self.triangles > 0 and self.least_volume > 0


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
    """Half-edges that share an undirected edge, as two arrays of equal length; a third one is paired as well."""
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
    return _fans(faces, edge_pairs(faces))


def _fans(faces: Indices, pairs: tuple[Indices, Indices]) -> tuple[int, Indices]:
    first, second = pairs
    corners = faces.reshape(-1)
    after = np.arange(len(corners)) // 3 * 3 + (np.arange(len(corners)) + 1) % 3
    # Neighbours normally run along their edge in opposite directions; the others are met on the way to repair.
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


def is_closed(mesh: Mesh) -> bool:
    """No edge has a triangle on one side only."""
    return len(mesh.faces) > 0 and len(boundary_edges(mesh.faces)) == 0


def is_oriented(mesh: Mesh) -> bool:
    """No directed edge occurs twice: neighbours agree on which side is out."""
    keys = np.sort(edge_keys(half_edges(mesh.faces), max(len(mesh.vertices), 1), directed=True))
    return not bool((keys[1:] == keys[:-1]).any())


def is_manifold(mesh: Mesh) -> bool:
    """At most two triangles meet in an edge, and the triangles round a vertex form one fan."""
    report = check_solid(mesh)
    return report.manifold


def components(mesh: Mesh) -> int:
    """Number of pieces connected through edges."""
    return int(face_components(mesh.faces).max(initial=-1)) + 1


def genus(mesh: Mesh) -> int:
    """Handles of all pieces of a closed, oriented manifold together."""
    return check_solid(mesh).genus


def volume(mesh: Mesh) -> float:
    """Signed volume, FIGURE units cubed; positive where triangles are counter-clockwise seen from outside."""
    return float(component_volumes(mesh, np.zeros(len(mesh.faces), np.int32)).sum())


def component_volumes(mesh: Mesh, labels: Indices) -> NDArray[np.float64]:
    """(C,) signed volume of each component, with (F,) component numbers from `face_components`."""
    if len(labels) == 0:
        return np.zeros(0)
    # Measured from the component's own middle: far from the origin the determinants would cancel badly.
    corners = mesh.vertices.astype(np.float64)[mesh.faces]
    count = np.bincount(labels)
    middle = np.stack([np.bincount(labels, corners[:, 0, axis]) for axis in range(3)], axis=1) / count[:, None]
    corners -= middle[labels][:, None]
    six_fold = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return np.asarray(np.bincount(labels, six_fold) / 6.0)


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


def check_solid(mesh: Mesh) -> SolidReport:
    """All measures at once, 0.08 s for 70,000 triangles."""
    faces = mesh.faces
    pairs = edge_pairs(faces)
    edge_count = 3 * len(faces) - len(pairs[0])
    # Half-edges in a pair that also has a third stand in two pairs.
    members = np.bincount(np.concatenate(pairs), minlength=3 * len(faces))
    used = int(np.count_nonzero(np.bincount(faces.reshape(-1), minlength=1)))
    labels = _labels(pairs[0] // 3, pairs[1] // 3, len(faces))[1]
    pieces = int(labels.max(initial=-1)) + 1
    volumes = component_volumes(mesh, labels)
    repeated = bool((faces == np.roll(faces, 1, axis=1)).any())
    euler = used - edge_count + len(faces)
    return SolidReport(
        vertices=used,
        triangles=len(faces),
        closed=len(faces) > 0 and bool((members > 0).all()),
        oriented=is_oriented(mesh),
        manifold_edges=not repeated and bool((members <= 1).all()),
        manifold_vertices=not repeated and _fans(faces, pairs)[0] == used,
        components=pieces,
        genus=pieces - euler // 2,
        euler=euler,
        volume=float(volumes.sum()),
        least_volume=float(volumes.min(initial=np.inf)) if pieces else 0.0,
    )


def as_mesh(vertices: NDArray[Any], faces: NDArray[Any]) -> Mesh:
    """A `Mesh` from arrays of any precision."""
    return Mesh(vertices.astype(np.float32), faces.astype(np.int32))


def compact(mesh: Mesh) -> Mesh:
    """The same mesh without vertices that no face uses."""
    used, inverse = np.unique(mesh.faces, return_inverse=True)
    if len(used) == len(mesh.vertices):
        return mesh
    return as_mesh(mesh.vertices[used], inverse.reshape(-1, 3))


def select_faces(mesh: Mesh, keep: NDArray[np.bool_]) -> Mesh:
    """The faces where `keep` (F,) holds, with the vertices they use."""
    return compact(as_mesh(mesh.vertices, mesh.faces[keep]))


def join(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one, in order, without merging vertices."""
    if not meshes:
        return as_mesh(np.zeros((0, 3)), np.zeros((0, 3)))
    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    return as_mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]),
    )
