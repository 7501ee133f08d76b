"""A balanced tree over places on the earth, each node with a sphere round all that is below it.

Sort-tile-recursive packing (Leutenegger, Lopez, Edgington 1997) on earth-centred coordinates: the figures of a node
are cut at ranks, across their longest extent, until there are enough groups, all full. Poles and antimeridian are
places like any other there, and no number of figures at one place makes the tree deeper.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.tiles import BOX_MARGIN_M
from georef.geodesy import ecef_from_tile

BRANCHES = 8
"""Largest number of children of a node, and of figures of a leaf."""

ROUNDING_M = 1e-3
"""Spheres are written with centres and radii of whole millimetres, the radius rounded up."""

Floats = NDArray[np.float64]
Sphere = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class PlaceNode:
    """A node of the tree.

    sphere : centre and radius, ECEF, metres; holds the spheres of all nodes and figures below
    count : how many figures are below
    depth : how many nodes lie on the longest way down, 1 for a leaf
    children : of an inner node, at least two; empty for a leaf
    figures : indices of a leaf's figures; empty for an inner node
    """

    sphere: Sphere
    count: int
    depth: int
    children: tuple[PlaceNode, ...] = ()
    figures: tuple[int, ...] = ()


def figure_sphere(placement: Any, low: Any, high: Any) -> Sphere:
    """Sphere, in ECEF, round a figure's box with its margin; low, high : corners in the TILE frame, metres."""
    centre = (np.asarray(low) + np.asarray(high)) / 2
    half = (np.asarray(high) - np.asarray(low)) / 2 + 2 * BOX_MARGIN_M
    x, y, z = ecef_from_tile(placement).apply(centre).tolist()
    return (x, y, z, float(np.linalg.norm(half)))


def place_tree(spheres: Floats) -> PlaceNode:
    """The tree over figures.

    spheres : (N, 4) float64, N >= 1, centres and radii in ECEF, metres; order matters only among equal coordinates

    Its depth is the least that nodes of 8 allow: ceil(log8 N), at least 1.
    """
    spheres = np.asarray(spheres, dtype=np.float64)
    return _node(np.arange(len(spheres)), spheres)


def _node(indices: NDArray[np.int64], spheres: Floats) -> PlaceNode:
    count = len(indices)
    if count <= BRANCHES:
        return PlaceNode(enclosing_sphere(spheres[indices]), count, 1, figures=tuple(indices.tolist()))
    capacity = BRANCHES
    while capacity * BRANCHES < count:
        capacity *= BRANCHES
    groups = _cut(indices, spheres, -(-count // capacity))
    children = tuple(_node(group, spheres) for group in groups)
    sphere = enclosing_sphere(np.array([child.sphere for child in children]))
    return PlaceNode(sphere, count, 1 + max(child.depth for child in children), children)


def _cut(indices: NDArray[np.int64], spheres: Floats, groups: int) -> list[NDArray[np.int64]]:
    """That many groups of neighbours of nearly equal size."""
    if groups == 1:
        return [indices]
    centres = spheres[indices, :3]
    axis = int(np.argmax(np.ptp(centres, axis=0)))
    order = indices[np.argsort(centres[:, axis], kind="stable")]
    left = groups // 2
    # Rounded up, or the groups on the right could be one too large for what a node holds.
    place = -(-len(indices) * left // groups)
    return _cut(order[:place], spheres, left) + _cut(order[place:], spheres, groups - left)


def enclosing_sphere(spheres: Floats) -> Sphere:
    """A sphere, close to the smallest, round spheres.

    spheres : (N, 4) float64, N >= 1, centres and radii in metres
    returns : centre and radius in whole millimetres, the radius rounded up

    After Badoiu and Clarkson (2003): the centre moves towards the farthest sphere by ever shorter steps.
    """
    centres, radii = spheres[:, :3], spheres[:, 3]
    centre = (centres.min(axis=0) + centres.max(axis=0)) / 2
    best, least = centre, np.inf
    for step in range(24):
        reach = np.linalg.norm(centres - centre, axis=1) + radii
        far = int(reach.argmax())
        if reach[far] < least:
            best, least = centre, float(reach[far])
        centre = centre + (centres[far] - centre) / (step + 2)
    rounded = np.round(best, 3) + 0.0
    reach = np.linalg.norm(centres - rounded, axis=1) + radii
    # One millimetre more than needed: float64 at the size of the earth is good to 1e-9 m, sums of such are too.
    radius = np.ceil(float(reach.max()) / ROUNDING_M + 1) * ROUNDING_M
    x, y, z = rounded.tolist()
    return (x, y, z, round(float(radius), 3))
