"""Balanced tree over places on the earth, each node with an oriented bounding box of all its descendants.

Sort-tile-recursive packing (Leutenegger, Lopez, Edgington 1997) on earth-centred coordinates: the figures of a node
are split by rank along their longest extent into enough groups, all full. Poles and antimeridian need no special
cases, and many figures at one place do not make the tree deeper.

Boxes are aligned to the local horizon: a sphere around figures 100 km apart would reach 50 km up, and a viewer at that
height would visit all of it. As a box contains the corners of its children's boxes, it contains the bulge of the earth.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from exporters.placed_figure import ecef_matrix
from exporters.tiles.tileset import BOX_MARGIN_M
from georef.geodesy import enu_at, geodetic_from_ecef
from georef.placement import GeoPlacement

BRANCHES = 8
"""Maximum number of children of a node, and of figures of a leaf."""

MIN_RADIUS_M = 1e6
"""Threshold of the mean's distance from the earth's centre; below it, the box is aligned to the axes of ECEF."""

Floats = NDArray[np.float64]

SIGNS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
"""(8, 3): the corners of a box in half lengths of its axes."""


@dataclass(frozen=True, slots=True)
class PlaceNode:
    """A node of the tree.

    box : centre and three half axes, ECEF, metres, as in 3D Tiles; contains the boxes of all descendants
    count : number of figures below
    depth : number of nodes on the longest path down, 1 for a leaf
    children : of an inner node, at least two; empty for a leaf
    figures : indices of a leaf's figures; empty for an inner node
    """

    box: tuple[float, ...]
    count: int
    depth: int
    children: tuple[PlaceNode, ...] = ()
    figures: tuple[int, ...] = ()


def figure_corners(placement: GeoPlacement, low: ArrayLike, high: ArrayLike) -> Floats:
    """(8, 3) corners, ECEF, of a figure's box with its margin; low, high : corners in the TILE frame, metres."""
    bottom, top = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    local = (bottom + top) / 2 + SIGNS * ((top - bottom) / 2 + 2 * BOX_MARGIN_M)
    matrix = ecef_matrix(placement)
    return np.asarray(local @ matrix[:3, :3].T + matrix[:3, 3])


def figure_box(placement: GeoPlacement, low: ArrayLike, high: ArrayLike) -> tuple[float, ...]:
    """Return a figure's box with its margin, as 3D Tiles write boxes in ECEF; low, high : as for `figure_corners`."""
    bottom, top = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    matrix = ecef_matrix(placement)
    centre = matrix[:3, :3] @ ((bottom + top) / 2) + matrix[:3, 3]
    half_axes = matrix[:3, :3] * ((top - bottom) / 2 + 2 * BOX_MARGIN_M)
    return tuple((np.concatenate([centre, half_axes.T.ravel()]) + 0.0).tolist())


def place_tree(corners: Floats) -> PlaceNode:
    """Build the tree over figures.

    corners : (N, 8, 3) float64, N >= 1, ECEF, metres; order matters only among figures with equal centres

    Its depth is minimal for 8 children per node: ceil(log8 N), at least 1.
    """
    corners = np.asarray(corners, dtype=np.float64)
    return _node(np.arange(len(corners)), corners, corners.mean(axis=1))


def _node(indices: NDArray[np.int64], corners: Floats, centres: Floats) -> PlaceNode:
    count = len(indices)
    if count <= BRANCHES:
        box = enclosing_box(corners[indices].reshape(-1, 3))
        return PlaceNode(box, count, 1, figures=tuple(indices.tolist()))
    capacity = BRANCHES
    while capacity * BRANCHES < count:
        capacity *= BRANCHES
    groups = _split(indices, centres, -(-count // capacity))
    children = tuple(_node(group, corners, centres) for group in groups)
    box = enclosing_box(np.concatenate([box_corners(child.box) for child in children]))
    return PlaceNode(box, count, 1 + max(child.depth for child in children), children)


def _split(indices: NDArray[np.int64], centres: Floats, groups: int) -> list[NDArray[np.int64]]:
    """Split indices into groups of neighbours of nearly equal size."""
    if groups == 1:
        return [indices]
    own = centres[indices]
    axis = int(np.argmax(np.ptp(own, axis=0)))
    order = indices[np.argsort(own[:, axis], kind="stable")]
    left = groups // 2
    # Rounded up, or the groups on the right could exceed the capacity of a node by one.
    split = -(-len(indices) * left // groups)
    return _split(order[:split], centres, left) + _split(order[split:], centres, groups - left)


def box_corners(box: ArrayLike) -> Floats:
    """(8, 3) corners of a box of 3D Tiles, in its frame."""
    values = np.asarray(box, dtype=np.float64)
    return np.asarray(values[:3] + SIGNS @ values[3:].reshape(3, 3))


def enclosing_box(points: Floats) -> tuple[float, ...]:
    """Return a bounding box of points, aligned to east, north and up at their mean.

    points : (N, 3) float64, N >= 1, ECEF, metres
    returns : 12 numbers, centre (whole millimetres) and half axes east, north and up, each at least 1 mm longer than
        necessary: float64 ECEF coordinates are accurate to 1e-9 m
    """
    mean = points.mean(axis=0)
    axes = np.eye(3)
    if np.linalg.norm(mean) > MIN_RADIUS_M:
        lon, lat, _ = geodetic_from_ecef(mean).tolist()
        axes = enu_at(lon, lat).matrix[:3, :3]
    local = (points - mean) @ axes
    middle = (local.min(axis=0) + local.max(axis=0)) / 2
    centre = np.round(mean + axes @ middle, 3)
    half = np.ceil(np.abs((points - centre) @ axes).max(axis=0) * 1e3 + 1) / 1e3
    return tuple((np.concatenate([centre, (axes * half).T.ravel()]) + 0.0).tolist())
