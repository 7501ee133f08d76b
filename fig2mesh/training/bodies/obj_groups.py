"""Groups of triangles of an OBJ file, and their connected components."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def read_groups(
    path: Path,
) -> tuple[NDArray[np.int64], NDArray[np.str_], NDArray[np.int64], NDArray[np.float32]]:
    """Triangles, the group of each, their texture corners, and the texture coordinates of an OBJ file."""
    faces, groups, corners, uv, group = [], [], [], [], ""
    for line in path.read_text(encoding="utf-8", errors="ignore").splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == "vt":
            uv.append([float(words[1]), 1.0 - float(words[2])])
        elif words[0] == "g":
            group = words[1]
        elif words[0] == "f":
            pairs = [word.split("/") for word in words[1:]]
            for k in range(1, len(pairs) - 1):
                fan = (pairs[0], pairs[k], pairs[k + 1])
                faces.append([int(p[0]) - 1 for p in fan])
                corners.append([int(p[1]) - 1 if len(p) > 1 and p[1] else 0 for p in fan])
                groups.append(group)
    return np.array(faces), np.array(groups), np.array(corners), np.array(uv, np.float32)


def pieces(faces: NDArray[np.integer]) -> NDArray[np.integer]:
    """(F,) label of the connected component that each face belongs to."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    size = int(faces.max()) + 1
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    _, label = connected_components(coo_matrix((np.ones(len(edges)), edges.T), shape=(size, size)), directed=False)
    return np.asarray(label[faces[:, 0]])


def largest_piece(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Faces of the largest connected component."""
    label = pieces(faces)
    return np.asarray(faces[label == np.bincount(label).argmax()])


def in_piece(faces: NDArray[np.int64], piece: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(F,) bool mask of the faces whose first vertex belongs to a component."""
    return np.isin(faces[:, 0], np.unique(piece))
