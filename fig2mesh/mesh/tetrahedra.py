"""Marching tetrahedra: the fallback that cannot fail.

Every cell of the grid is cut into six tetrahedra along the same diagonal (Freudenthal), so that neighbouring cells
agree on their faces. The zero level of a linear function without zeros at the nodes is a manifold, whatever its
values. The price is three times the triangles, many of them thin; so it serves where marching cubes fails.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from fig2mesh.records import FloatArray, IntArray


def tetrahedra(values: FloatArray) -> tuple[FloatArray, IntArray]:
    """Zero level set of a grid.

    values : (nx, ny, nz) without zeros, negative inside, positive on the outermost nodes
    Returns vertices (V, 3) float32 in units of the grid and faces (F, 3) int32, counter-clockwise from outside.
    """
    shape = np.array(values.shape)
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    inside = values < 0
    low, high = inside[:-1, :-1, :-1].copy(), inside[:-1, :-1, :-1].copy()
    for corner in np.ndindex(2, 2, 2):
        window = inside[tuple(slice(c, c + n - 1) for c, n in zip(corner, shape, strict=True))]
        low &= window
        high |= window
    cells = np.argwhere(high & ~low) @ strides
    flat, sign = values.reshape(-1).astype(np.float64), inside.reshape(-1)
    triangles = []
    for order in permutations(range(3)):
        steps = np.cumsum(np.concatenate([[0], strides[list(order)]]))
        odd = bool(np.linalg.det(np.eye(3)[list(order)]) < 0)
        triangles += _cut(cells[:, None] + steps, sign, odd)
    corners = np.concatenate(triangles) if triangles else np.zeros((0, 3, 2), np.int64)
    keys = np.sort(corners, axis=-1).reshape(-1, 2)
    edges, inverse = np.unique(keys, axis=0, return_inverse=True)
    first, second = flat[edges[:, 0]], flat[edges[:, 1]]
    share = (first / (first - second))[:, None]
    ends = np.stack(np.unravel_index(edges, values.shape), axis=-1).astype(np.float64)
    vertices = ends[:, 0] + share * (ends[:, 1] - ends[:, 0])
    return vertices.astype(np.float32), inverse.reshape(-1, 3).astype(np.int32)


def _cut(nodes: NDArray[np.int64], sign: NDArray[np.bool_], odd: bool) -> list[NDArray[np.int64]]:
    """Triangles of tetrahedra (T, 4) as (N, 3, 2): each corner lies on the edge between two nodes."""
    found = []
    case = sign[nodes] @ (1 << np.arange(4))
    for number in range(1, 15):
        rows = nodes[case == number]
        if len(rows) == 0:
            continue
        within = [k for k in range(4) if number >> k & 1]
        without = [k for k in range(4) if not number >> k & 1]
        # `within + without` is an even permutation of the corners or not, which decides the winding.
        flip = (np.linalg.det(np.eye(4)[within + without]) < 0) != odd
        if len(within) == 1:
            polygon = [(within[0], k) for k in without]
        elif len(within) == 3:
            polygon = [(k, without[0]) for k in within]
        else:
            (a, b), (c, d) = within, without
            polygon = [(a, c), (a, d), (b, d), (b, c)]
        if flip:
            polygon = polygon[::-1]
        for k in range(1, len(polygon) - 1):
            found.append(rows[:, [polygon[0], polygon[k], polygon[k + 1]]])
    return found
