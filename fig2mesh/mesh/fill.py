"""Hole filling without PyMeshLab: each hole is triangulated with the least area (Barequet & Sharir 1995; Liepa 2003).

Guaranteed: on an oriented manifold with boundary the result is a closed, oriented manifold. A chord that is an edge of
the mesh already is forbidden, because it would get a third triangle; where no triangulation is left, and on very long
holes, all boundary vertices are joined to a new vertex in their middle, which is always allowed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.compiled import kernel
from fig2mesh.mesh.topology import as_mesh, boundary_edges, half_edges
from fig2mesh.records import Mesh

MAX_HOLE_EDGES = 400
"""Edges of the largest hole filled by least area, in cubic time (0.15 s at this size); larger ones get a fan."""


def fill(mesh: Mesh) -> Mesh:
    """Close all holes of an oriented manifold mesh; its own faces and vertices come first, unchanged."""
    loops = boundary_loops(mesh)
    if not loops:
        return mesh
    loop_of = np.full(len(mesh.vertices), -1)
    place = np.zeros(len(mesh.vertices), np.int64)
    for number, loop in enumerate(loops):
        loop_of[loop] = number
        place[loop] = np.arange(len(loop))
    edges = half_edges(mesh.faces)
    edges = edges[(loop_of[edges[:, 0]] == loop_of[edges[:, 1]]) & (loop_of[edges[:, 0]] >= 0)]
    edges = edges[np.argsort(loop_of[edges[:, 0]], kind="stable")]
    cuts = np.searchsorted(loop_of[edges[:, 0]], np.arange(len(loops) + 1))
    vertices, faces = [mesh.vertices], [mesh.faces]
    added = len(mesh.vertices)
    for number, loop in enumerate(loops):
        corners = mesh.vertices[loop].astype(np.float64)
        triangles = np.zeros((0, 3), np.int64)
        if len(loop) <= MAX_HOLE_EDGES:
            taken = np.zeros((len(loop), len(loop)), np.bool_)
            first, second = place[edges[cuts[number] : cuts[number + 1]]].T
            taken[first, second] = taken[second, first] = True
            triangles = _least_area(corners, taken)
        if len(triangles):
            faces.append(loop[triangles].astype(np.int32))
        else:
            around = np.stack([loop, np.roll(loop, -1), np.full(len(loop), added)], axis=1)
            faces.append(around.astype(np.int32))
            vertices.append(corners.mean(axis=0, keepdims=True).astype(np.float32))
            added += 1
    return as_mesh(np.concatenate(vertices), np.concatenate(faces))


def boundary_loops(mesh: Mesh) -> list[NDArray[np.int64]]:
    """Boundary loops of an oriented manifold, each as its vertices in the winding order of triangles that fill it."""
    edges = boundary_edges(mesh.faces)
    following = {int(b): int(a) for a, b in edges}
    if len(following) != len(edges):
        raise ValueError("mesh: two holes meet in a vertex; split it first (`repair`)")
    loops = []
    while following:
        start, current = following.popitem()
        loop = [start]
        while current != start:
            loop.append(current)
            current = following.pop(current)
        loops.append(np.array(loop, np.int64))
    return loops


@kernel
def _least_area(corners: Any, taken: Any) -> Any:
    """(n - 2, 3) triangles of the polygon `corners` (n, 3) of least area; none if all of them use a taken edge."""
    count = len(corners)
    cost = np.full((count, count), np.inf)
    choice = np.full((count, count), -1, np.int32)
    for i in range(count - 1):
        cost[i, i + 1] = 0.0
    for width in range(2, count):
        for i in range(count - width):
            k = i + width
            if taken[i, k] and width < count - 1:
                continue
            ux, uy, uz = corners[k, 0] - corners[i, 0], corners[k, 1] - corners[i, 1], corners[k, 2] - corners[i, 2]
            best = np.inf
            for j in range(i + 1, k):
                rest = cost[i, j] + cost[j, k]
                if rest >= best:
                    continue
                vx, vy, vz = corners[j, 0] - corners[i, 0], corners[j, 1] - corners[i, 1], corners[j, 2] - corners[i, 2]
                x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
                # The square of the length breaks ties between triangulations of a flat hole in favour of short chords.
                total = rest + np.sqrt(x * x + y * y + z * z) + 1e-3 * (ux * ux + uy * uy + uz * uz)
                if total < best:
                    best = total
                    choice[i, k] = j
            cost[i, k] = best
    if count < 3 or not np.isfinite(cost[0, count - 1]):
        return np.zeros((0, 3), np.int64)
    triangles = np.zeros((count - 2, 3), np.int64)
    stack = np.zeros((count, 2), np.int64)
    stack[0, 1] = count - 1
    depth, found = 1, 0
    while depth > 0:
        depth -= 1
        i, k = stack[depth, 0], stack[depth, 1]
        if k - i < 2:
            continue
        j = choice[i, k]
        triangles[found, 0], triangles[found, 1], triangles[found, 2] = i, j, k
        found += 1
        stack[depth, 0], stack[depth, 1] = i, j
        stack[depth + 1, 0], stack[depth + 1, 1] = j, k
        depth += 2
    return triangles
