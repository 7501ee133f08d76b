"""Inset of a mesh by the width of the line that is drawn along its rim.

Widths are known on the rim only. Between and behind they are continued over the surface so that they change as little
as possible, which is a linear system with as many unknowns as there are vertices.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array, eye_array
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from fig2mesh.contour.rim import Rim
from fig2mesh.mesh.raycast import scene_of
from fig2mesh.mesh.topology import face_vectors, half_edges
from fig2mesh.records import FloatArray, Mesh

Floats = NDArray[np.float64]

NEIGHBOURS: Final = 9
"""Number of rim points, the point itself included, of whose widths the median is taken."""

APART: Final = 0.03
"""Largest distance of these, FIGURE units."""

STIFFNESS: Final = 0.5
"""Weight of equal widths at both ends of an edge, relative to one reading of the width."""

MAX_OF_THICKNESS: Final = 0.35
"""Largest inset relative to the thickness of the solid: both sides move."""

CLEARANCE: Final = 1e-3
"""Distance below the surface at which rays start, FIGURE units: they must not hit the triangles they start from."""

SMOOTHING: Final = 2
"""Passes over the directions of the inset; sharp creases would fold without."""

TURNED: Final = 0.4
"""Threshold of the cosine between a triangle's normals before and after, below which its inset is reduced."""

ATTEMPTS: Final = 24
"""Largest number of reductions; after it the inset is undone where triangles are still turned."""


def steady(rim: Rim, values: Floats) -> Floats:
    """(N,) median of a reading (N,) over nearby points of the rim; NaN where none of them has one.

    Where most readings are 0 it is 0, otherwise the median of the others: a line has its width up to its end.
    """
    if not len(values):
        return values
    count = min(NEIGHBOURS, len(values))
    distance, index = cKDTree(rim.points).query(rim.points, count)
    distance, index = distance.reshape(len(values), -1), index.reshape(len(values), -1)
    near = np.where(distance <= APART, values[index], np.nan)
    drawn = np.where(near > 0, near, np.nan)
    known, some = np.isfinite(near).sum(axis=1), np.isfinite(drawn).sum(axis=1)
    result = np.full(len(values), np.nan)
    result[known > 0] = 0.0
    line = 2 * some > known
    result[line] = np.nanmedian(drawn[line], axis=1)
    return result


def continued_over(mesh: Mesh, rim: Rim, readings: Floats) -> Floats:
    """(V, K) values at the vertices from readings (N, K) on the rim, rows with NaN left out; 0 where there are none."""
    known = np.isfinite(readings).all(axis=1)
    count = len(mesh.vertices)
    if not known.any():
        return np.zeros((count, readings.shape[1]))
    rows = np.repeat(np.arange(int(known.sum())), 2)
    share = rim.share[known]
    weights = np.stack([1 - share, share], axis=1).reshape(-1)
    reading = csr_array((weights, (rows, rim.edges[known].reshape(-1))), shape=(int(known.sum()), count))
    smooth = STIFFNESS * _laplacian(mesh) + 1e-9 * eye_array(count)
    solver = splu((reading.T @ reading + smooth).tocsc())
    return np.asarray(solver.solve(np.asarray(reading.T @ readings[known])))


def thickness(mesh: Mesh, inwards: Floats) -> Floats:
    """(V,) length of the solid below each vertex, along five directions within 30 degrees of `inwards` (V, 3)."""
    import open3d as o3d

    scene = scene_of(mesh.vertices, mesh.faces)
    across = np.cross(inwards, np.where(np.abs(inwards[:, 2:]) < 0.7, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]]))
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    third = np.cross(inwards, across)
    result = np.full(len(inwards), np.inf)
    for first, second in ((0.0, 0.0), (0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)):
        way = inwards + first * across + second * third
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        start = mesh.vertices + CLEARANCE * inwards
        rays = np.concatenate([start, way], axis=1).astype(np.float32)
        found = scene.cast_rays(o3d.core.Tensor.from_numpy(rays))["t_hit"].numpy().astype(np.float64)
        result = np.minimum(result, found)
    return result


def inset(mesh: Mesh, normals: FloatArray, width: Floats) -> FloatArray:
    """(V, 3) vertices of a closed mesh moved inwards by `width` (V,), less where the solid is thin, FIGURE.

    No triangle is turned over: where one would be, the inset is reduced around it.
    """
    adjacent = _adjacency(mesh)
    outwards = _smoothed(adjacent, np.asarray(normals, np.float64), SMOOTHING)
    outwards /= np.maximum(np.linalg.norm(outwards, axis=1, keepdims=True), 1e-9)
    depth = np.minimum(width, MAX_OF_THICKNESS * thickness(mesh, -outwards))
    depth = np.minimum(depth, np.maximum(_smoothed(adjacent, depth[:, None], 2)[:, 0], 0.0))
    before = face_vectors(mesh)
    length = np.linalg.norm(before, axis=1)
    for _ in range(ATTEMPTS):
        moved = (mesh.vertices - depth[:, None] * outwards).astype(np.float32)
        after = face_vectors(Mesh(moved, mesh.faces))
        cosine = np.einsum("fd,fd->f", before, after)
        turned = cosine <= TURNED * length * np.linalg.norm(after, axis=1)
        if not turned.any():
            return moved
        around = np.unique(mesh.faces[turned])
        depth[around] *= 0.6
        depth = np.minimum(depth, np.maximum(_smoothed(adjacent, depth[:, None], 1)[:, 0], 0.0) * 1.05)
    depth[around] = 0.0
    return (mesh.vertices - depth[:, None] * outwards).astype(np.float32)


def _adjacency(mesh: Mesh) -> Any:
    """(V, V) 1 for each pair of neighbours."""
    edges = half_edges(mesh.faces)
    count = len(mesh.vertices)
    adjacent = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count)).tocsr()
    adjacent.data[:] = 1.0
    return adjacent


def _laplacian(mesh: Mesh) -> Any:
    """(V, V) graph Laplacian: number of neighbours minus adjacency."""
    adjacent = _adjacency(mesh)
    return diags_array(np.asarray(adjacent.sum(axis=1)).ravel()) - adjacent


def _smoothed(adjacent: Any, values: Floats, passes: int) -> Floats:
    """(V, K) means of values over each vertex and its neighbours, `passes` times."""
    valence = np.asarray(adjacent.sum(axis=1)).ravel()[:, None]
    for _ in range(passes):
        values = 0.5 * values + 0.5 * (adjacent @ values) / np.maximum(valence, 1.0)
    return values
