"""A body cut into its 14 closed parts (paper §3).

A rig's faces and skin weights never change, so its cuts, their borders and the caps that close them are computed
once; posing only moves the vertices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import BODY_PARTS
from fig2mesh.training.bodies.rig import Rig

RINGS = 2
"""Rings of faces by which neighbouring parts overlap, so that assembled parts leave no gap at a bent joint."""


@dataclass(frozen=True)
class PartTopology:
    """One closed part: faces into the vertices of the rig, followed by one centre per border.

    faces : (F, 3) int32
    borders : for each cut, the (N,) indices of its vertices; the mean of them is the centre that closes it
    """

    part: int
    faces: NDArray[np.int32]
    borders: tuple[NDArray[np.int32], ...]

    def solid(self, vertices: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Return vertices and faces of the closed part of a posed body, without unused vertices."""
        centres = [vertices[border].mean(axis=0) for border in self.borders]
        everything = np.concatenate([vertices, np.asarray(centres).reshape(-1, 3)])
        used, inverse = np.unique(self.faces, return_inverse=True)
        return np.asarray(everything[used], np.float64), inverse.reshape(-1, 3).astype(np.int32)


def partition(rig: Rig, rings: int = RINGS) -> tuple[PartTopology, ...]:
    """Cut a rig into its parts, in the order of their labels; parts that the rig lacks are left out."""
    count = len(rig.vertices)
    result = []
    for part in BODY_PARTS:
        chosen = rig.face_part == part
        if not chosen.any():
            continue
        for _ in range(rings):
            touched = np.zeros(count, bool)
            touched[rig.faces[chosen].ravel()] = True
            chosen = chosen | touched[rig.faces].any(axis=1)
        faces = rig.faces[chosen]
        borders = _borders(faces)
        caps = [
            np.column_stack([edges[:, 1], edges[:, 0], np.full(len(edges), count + index)])
            for index, edges in enumerate(borders)
        ]
        closed = np.concatenate([faces, *caps]).astype(np.int32)
        result.append(PartTopology(part, closed, tuple(np.unique(edges).astype(np.int32) for edges in borders)))
    return tuple(result)


def _borders(faces: NDArray[np.int32]) -> list[NDArray[np.int32]]:
    """Connected boundary loops of an open surface, each as its directed edges (E, 2)."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    size = int(edges.max()) + 1
    forward = edges[:, 0].astype(np.int64) * size + edges[:, 1]
    backward = edges[:, 1].astype(np.int64) * size + edges[:, 0]
    open_edges = edges[~np.isin(forward, backward)]
    if not len(open_edges):
        return []
    root = np.arange(size)
    # Borders are short: labels spread along them in a few dozen rounds.
    while True:
        low = np.minimum(root[open_edges[:, 0]], root[open_edges[:, 1]])
        before = root.copy()
        np.minimum.at(root, open_edges[:, 0], low)
        np.minimum.at(root, open_edges[:, 1], low)
        root = root[root]
        if (root == before).all():
            break
    label = root[open_edges[:, 0]]
    return [open_edges[label == value] for value in np.unique(label)]
