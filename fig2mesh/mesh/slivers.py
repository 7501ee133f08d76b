"""Removal of slivers: triangles of almost no area are exchanged for better ones without changing the solid.

Quadric decimation leaves some one to five of 20,000 triangles with a quality below 0.05. Being so few, they are worked
on one by one in plain Python, which takes less than 0.1 s for a model of 20,000 triangles.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.mesh.topology import as_mesh, compact
from fig2mesh.records import Mesh

MIN_QUALITY = 0.06
"""Quality threshold, below which triangles are exchanged; 0.05 counts as a sliver, and rounding to a file's frame must
not make one."""

REACHES = (0.005, 0.01, 0.02, 0.04)
"""Largest movements of the surface by an exchange, in mean edge lengths: small ones are tried first.

A model of 20,000 triangles has edges of 24 mm, so these are 0.1 to 1 mm, where decimation itself went up to 3 mm away.
Held to 0.2 mm, 4 slivers in 16 models of 20,000 triangles and 6 in 16 of 5,000 remained; with 4 % of an edge, none.
"""

MIN_COSINE = 0.5
"""Least cosine between the normals of a new triangle and of the surface that it replaces."""

NORMAL_QUALITY = 0.1
"""Quality threshold, below which the normal of a triangle is not used."""

PASSES = 4
"""Passes for each reach: an exchange can leave a triangle that only the next one improves."""

Indices = NDArray[np.int64]
Points = NDArray[np.float64]


@dataclass(frozen=True)
class Exchange:
    """Exchange of triangles that removes a sliver.

    old : indices of faces removed; new : (N, 3) faces added, at most as many
    quality : of the worst of the new ones; distance : movement of the surface
    """

    old: Indices
    new: Indices
    quality: float
    distance: float


def triangle_quality(vertices: NDArray[Any], faces: NDArray[Any]) -> Points:
    """(F,) 4 sqrt(3) area / (sum of squared edges) of triangles (F, 3): 1 if equilateral, 0 without area."""
    corners = vertices.astype(np.float64)[faces]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    squares = (a**2).sum(axis=1) + (b**2).sum(axis=1) + ((b - a) ** 2).sum(axis=1)
    return np.asarray(2 * np.sqrt(3) * np.linalg.norm(np.cross(a, b), axis=1) / np.maximum(squares, 1e-300))


def without_slivers(mesh: Mesh, min_quality: float = MIN_QUALITY, reaches: tuple[float, ...] = REACHES) -> Mesh:
    """Remove triangles of a quality below `min_quality` from a closed, oriented manifold, as far as possible.

    Caps lose their long edge by a flip, needles their short one by a collapse onto one of its ends; no vertex moves
    anywhere else. An exchange is made only if the worst triangle gets better, the surface moves by at most the last of
    `reaches` (in mean edge lengths), no normal turns by more than 60 degrees and the solid keeps its pieces and
    handles: a flipped edge must be new, a collapsed one must satisfy the link condition (Dey et al. 1999). The same
    mesh is returned if there is nothing to do.
    """
    if not (triangle_quality(mesh.vertices, mesh.faces) < min_quality).any():
        return mesh
    patch = _Patch(mesh)
    edges = mesh.vertices[mesh.faces[:, 0]].astype(np.float64) - mesh.vertices[mesh.faces[:, 1]]
    length = float(np.linalg.norm(edges, axis=1).mean())
    for reach in (reach for reach in reaches for _ in range(PASSES)):
        values = np.where(patch.alive, triangle_quality(patch.points, patch.faces), 1.0)
        slivers = np.argsort(values)[: int((values < min_quality).sum())]
        before = patch.faces[slivers]
        for face, corners in zip(slivers.tolist(), before.tolist(), strict=True):
            # What another exchange has changed meanwhile is evaluated again in the next pass.
            if patch.alive[face] and patch.faces[face].tolist() == corners:
                patch.improve(face, min_quality, reach * length)
    return compact(as_mesh(mesh.vertices, patch.faces[patch.alive]))


class _Patch:
    """Faces being changed, with cached faces round the vertices used."""

    def __init__(self, mesh: Mesh) -> None:
        self.points: Points = mesh.vertices.astype(np.float64)
        self.faces: Indices = mesh.faces.astype(np.int64)
        self.alive = np.ones(len(mesh.faces), np.bool_)
        corners = self.faces.reshape(-1)
        self._order = np.argsort(corners, kind="stable") // 3
        self._start = np.concatenate([[0], np.cumsum(np.bincount(corners, minlength=len(mesh.vertices)))])
        self._rings: dict[int, set[int]] = {}

    def improve(self, face: int, min_quality: float, reach: float) -> None:
        """Apply the best exchange for a face, if there is one."""
        ways = [way for way in (*self._flips(face), *self._collapses(face)) if way.distance <= reach]
        if not ways:
            return
        # Among exchanges that leave good triangles, the one that moves the surface least.
        best = max(ways, key=lambda way: (min(way.quality, 2 * min_quality), -way.distance))
        for number in best.old.tolist():
            for corner in self.faces[number].tolist():
                self._ring(corner).discard(number)
        self.alive[best.old] = False
        for number, corners in zip(best.old.tolist(), best.new, strict=False):
            self.faces[number], self.alive[number] = corners, True
            for corner in corners.tolist():
                self._ring(corner).add(number)

    def _ring(self, vertex: int) -> set[int]:
        """Indices of the faces round a vertex."""
        if vertex not in self._rings:
            self._rings[vertex] = set(self._order[self._start[vertex] : self._start[vertex + 1]].tolist())
        return self._rings[vertex]

    def _neighbours(self, vertex: int) -> set[int]:
        return set(self.faces[sorted(self._ring(vertex))].reshape(-1).tolist()) - {vertex}

    def _edges(self, face: int) -> Iterator[tuple[int, int, int, int, int]]:
        """a, b, the third corner c, the neighbour across (a, b) and its third corner d, for each edge of a face."""
        corners = self.faces[face].tolist()
        for k in range(3):
            a, b, c = corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]
            (other,) = (self._ring(a) & self._ring(b)) - {face}
            (d,) = set(self.faces[other].tolist()) - {a, b}
            yield a, b, c, other, d

    def _flips(self, face: int) -> Iterator[Exchange]:
        for a, b, c, other, d in self._edges(face):
            # Two triangles on the same three corners would be one edge with four sides.
            if d != c and d not in self._neighbours(c):
                yield from self._judged(np.array([face, other]), np.array([[c, a, d], [d, b, c]]))

    def _collapses(self, face: int) -> Iterator[Exchange]:
        for a, b, c, other, d in self._edges(face):
            shared = self._neighbours(a) & self._neighbours(b)
            # The link condition; a tetrahedron satisfies its first half and would become two triangles.
            if shared != {c, d} or (d in self._neighbours(c) and len(self._ring(c)) == 3):
                continue
            for gone, kept in ((a, b), (b, a)):
                moved = np.array(sorted(self._ring(gone) - {face, other}), np.int64)
                new = np.where(self.faces[moved] == gone, kept, self.faces[moved])
                yield from self._judged(np.concatenate([moved, [face, other]]), new)

    def _judged(self, old: Indices, new: Indices) -> Iterator[Exchange]:
        """Yield the exchange if it improves the worst triangle and turns no normal over."""
        gone = self.faces[old]
        before, after = triangle_quality(self.points, gone), triangle_quality(self.points, new)
        if after.min() <= before.min():
            return
        is_flip = len(old) == len(new)
        flat, turned = _normals(self.points, gone), _normals(self.points, new)
        # A sliver's own normal is unreliable; those of the triangles around it are used.
        reference = np.where(is_flip | (before[: len(new), None] < NORMAL_QUALITY), flat.sum(axis=0), flat[: len(new)])
        lengths = np.linalg.norm(reference, axis=1) * np.linalg.norm(turned, axis=1)
        if (np.einsum("nd,nd->n", reference, turned) <= MIN_COSINE * lengths).any():
            return
        yield Exchange(old, new, float(after.min()), _apart(self.points, gone, new))


def _normals(points: Points, faces: Indices) -> Points:
    corners = points[faces]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _apart(points: Points, first: Indices, second: Indices) -> float:
    """Distance between two small patches at their corners, the middles of edges and of triangles."""
    return max(_one_way(points[first], points[second]), _one_way(points[second], points[first]))


def _one_way(source: Points, target: Points) -> float:
    import trimesh

    samples = np.concatenate([source, (source + np.roll(source, 1, axis=1)) / 2, source.mean(axis=1)[:, None]], axis=1)
    at = np.unique(samples.reshape(-1, 3), axis=0)
    nearest = trimesh.triangles.closest_point(np.tile(target, (len(at), 1, 1)), np.repeat(at, len(target), axis=0))
    distance = np.linalg.norm(nearest - np.repeat(at, len(target), axis=0), axis=1)
    return float(distance.reshape(len(at), len(target)).min(axis=1).max())
