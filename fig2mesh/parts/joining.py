"""Detection of floating layers: what is drawn as one piece must be one solid (paper fig. 14, gaps between parts)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

TOUCH = 0.7
"""Two layers are joined where their middles are nearer than this share of the sum of their half thicknesses."""

MIN_CONTACT_PX = 6
"""Least contact area, pixels, for a joint that a mesh can hold."""

EIGHT = np.ones((3, 3))


def floating(
    half: Sequence[NDArray[np.float64]], middle: Sequence[NDArray[np.float64]], inside: NDArray[np.bool_]
) -> set[int]:
    """Indices of the layers above 0 (the core) that must move so that every drawn piece holds together.

    Parameters
    ----------
    half : (H, W) half thickness of each layer, 0 outside it
    middle : (H, W) FIGURE z of the middle of each layer
    inside : (H, W) bool, the silhouette
    """
    drawn, _ = ndimage.label(inside, EIGHT)
    numbered, first = [], [0]
    for thickness in half:
        nodes, count = ndimage.label(thickness > 0, EIGHT)
        numbered.append(nodes)
        first.append(first[-1] + count)
    total = first[-1]
    if total < 2:
        return set()
    edges = [np.zeros((0, 2), np.int64)]
    for a, b in combinations(range(len(half)), 2):
        near = (half[a] > 0) & (half[b] > 0) & (np.abs(middle[a] - middle[b]) < TOUCH * (half[a] + half[b]))
        pairs = np.stack([numbered[a][near] - 1 + first[a], numbered[b][near] - 1 + first[b]], axis=1)
        found, count = np.unique(pairs, axis=0, return_counts=True)
        edges.append(found[count >= MIN_CONTACT_PX])
    links = np.concatenate(edges)
    graph = coo_matrix((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(total, total))
    _, group = connected_components(graph, directed=False)
    return _outside_main(numbered, first, group, drawn)


def _outside_main(
    numbered: list[NDArray[np.int32]], first: list[int], group: NDArray[np.int32], drawn: NDArray[np.int32]
) -> set[int]:
    """Indices of layers with a node that is not in the largest group of its drawn piece."""
    areas, pieces, layers = [], [], []
    for index, nodes in enumerate(numbered):
        count = first[index + 1] - first[index]
        areas.append(np.bincount(nodes.ravel(), minlength=count + 1)[1:])
        pieces.append(ndimage.maximum(drawn, nodes, np.arange(1, count + 1)) if count else np.zeros(0))
        layers.append(np.full(count, index))
    area, piece, layer = np.concatenate(areas), np.concatenate(pieces), np.concatenate(layers)
    loose: set[int] = set()
    for drawing in np.unique(piece):
        members = np.flatnonzero((piece == drawing) & (area >= MIN_CONTACT_PX))
        weight = np.bincount(group[members], weights=area[members]) if len(members) else np.zeros(1)
        for node in members[group[members] != np.argmax(weight)]:
            index = int(layer[node])
            if index > 0:
                loose.add(index)
                continue
            # A floating island of the core: the limbs that pass it should hold it.
            here = ndimage.binary_dilation(numbered[0] == node - first[0] + 1, EIGHT, iterations=2)
            loose |= {other for other in range(1, len(numbered)) if (numbered[other][here] > 0).any()}
    return loose
