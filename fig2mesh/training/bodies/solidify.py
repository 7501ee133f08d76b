"""A closed mesh around a triangle soup: pieces that overlap, are open where they meet, or are mere sheets.

On a grid, the generalised winding number of all triangles decides between inside and outside, and the distance to them
locates the surface; sheets get a thickness.
"""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.compiled import helper, kernel
from fig2mesh.mesh.grid import Grid
from fig2mesh.mesh.isosurface import extract
from fig2mesh.records import Mesh

THIN: tuple[tuple[float, float], ...] = ((0.5, 0.75), (1.2, 0.35))
"""Thickness, and offset of triangles of pieces thinner than that, in voxels: the grid's nodes would miss some."""

REACH = 2.5
"""Voxels from the triangles within which distances are measured."""

STEEP = 8.0
"""Voxels of distance that one unit of winding number stands for where no triangle is near, as under a skirt."""

BLOCKS = (4, 2, 1)
"""Edges of the blocks of nodes for which winding numbers are computed, coarse to fine."""

DECIDED = 0.35
"""Winding numbers this far from one half are far from a surface, too."""

MIN_PIECE_VOXELS = 27
"""Minimum size of loose pieces: smaller ones are dropped, larger ones connected to the body."""

CLUSTER, LARGER = 0.03, 6
"""Edge of the cells whose triangles count as one dipole from afar, FIGURE units, and of larger cells in such cells."""

FAR = 2.5
"""Distance in radii from which a cluster counts as a dipole: winding numbers were wrong by 0.08 at most."""


class Clusters(NamedTuple):
    """Groups of neighbouring items: items start[c] to start[c + 1] make group c.

    middle : (C, 3) by area; vector : (C, 3) sum of area vectors; radius : (C,) of the sphere round all triangles
    """

    start: NDArray[np.int64]
    middle: NDArray[np.float64]
    vector: NDArray[np.float64]
    radius: NDArray[np.float64]


def _clusters(owner: NDArray[np.int64], corners: NDArray[np.float64], start: NDArray[np.int64]) -> Clusters:
    """Clusters of triangles (F, 3, 3) that belong to the groups `owner` (F,), ascending."""
    vector = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    area = np.linalg.norm(vector, axis=1)
    count = int(owner[-1]) + 1
    total, middle, radius = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
    np.add.at(total, owner, vector)
    np.add.at(middle, owner, area[:, None] * corners.mean(axis=1))
    middle /= np.bincount(owner, area)[:, None]
    np.maximum.at(radius, owner, np.linalg.norm(corners - middle[owner][:, None], axis=2).max(axis=1))
    return Clusters(start, middle, total, radius)


@helper
def _far(clusters: Clusters, c: int, x: float, y: float, z: float) -> tuple[bool, float]:
    """Return whether a point is far from a cluster and, if so, the solid angle of its dipole."""
    dx, dy, dz = clusters.middle[c, 0] - x, clusters.middle[c, 1] - y, clusters.middle[c, 2] - z
    square = dx * dx + dy * dy + dz * dz
    if square <= (FAR * clusters.radius[c]) ** 2:
        return False, 0.0
    vector = clusters.vector
    return True, (vector[c, 0] * dx + vector[c, 1] * dy + vector[c, 2] * dz) / (square * np.sqrt(square))


@helper
def _solid_angle(corners: NDArray[np.float64], t: int, x: float, y: float, z: float) -> float:
    """Signed solid angle of one triangle (van Oosterom and Strackee 1983)."""
    ax, ay, az = corners[t, 0, 0] - x, corners[t, 0, 1] - y, corners[t, 0, 2] - z
    bx, by, bz = corners[t, 1, 0] - x, corners[t, 1, 1] - y, corners[t, 1, 2] - z
    cx, cy, cz = corners[t, 2, 0] - x, corners[t, 2, 1] - y, corners[t, 2, 2] - z
    a = np.sqrt(ax * ax + ay * ay + az * az)
    b = np.sqrt(bx * bx + by * by + bz * bz)
    c = np.sqrt(cx * cx + cy * cy + cz * cz)
    top = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    low = a * b * c + (ax * bx + ay * by + az * bz) * c
    low += (bx * cx + by * cy + bz * cz) * a + (cx * ax + cy * ay + cz * az) * b
    return float(2.0 * np.arctan2(top, low))


@kernel
def _winding(
    points: NDArray[np.float64], corners: NDArray[np.float64], small: Clusters, large: Clusters
) -> NDArray[np.float64]:
    """(N,) generalised winding number: solid angles of near triangles, dipoles of small and large far clusters."""
    result = np.zeros(len(points))
    for i in range(len(points)):
        x, y, z = points[i]
        total = 0.0
        for group in range(len(large.middle)):
            far, angle = _far(large, group, x, y, z)
            total += angle
            if far:
                continue
            for c in range(large.start[group], large.start[group + 1]):
                far, angle = _far(small, c, x, y, z)
                total += angle
                if far:
                    continue
                for t in range(small.start[c], small.start[c + 1]):
                    total += _solid_angle(corners, t, x, y, z)
        result[i] = total / (4.0 * np.pi)
    return result


class Winding:
    """Generalised winding number of a triangle soup (F, 3, 3) at points (N, 3); above 0.5 is inside."""

    def __init__(self, corners: NDArray[np.float64]) -> None:
        middle = corners.mean(axis=1)
        cell = np.floor((middle - middle.min(axis=0)) / CLUSTER).astype(np.int64)
        # Columns of large cells first: small cells of one large one follow each other.
        _, owner = np.unique(np.hstack([cell // LARGER, cell]), axis=0, return_inverse=True)
        order = np.argsort(owner.reshape(-1), kind="stable")
        owner, cell = owner.reshape(-1)[order], cell[order]
        self.corners = np.ascontiguousarray(corners[order])
        start = np.searchsorted(owner, np.arange(owner[-1] + 2))
        self.small = _clusters(owner, self.corners, start)
        _, group = np.unique(cell // LARGER, axis=0, return_inverse=True)
        group = group.reshape(-1)
        edges = np.searchsorted(group[start[:-1]], np.arange(group[-1] + 2))
        self.large = _clusters(group, self.corners, edges)

    def __call__(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        points = np.ascontiguousarray(points, np.float64)
        return np.asarray(_winding(points, self.corners, self.small, self.large))


class SoupSurface:
    """Triangles of a soup (F, 3, 3), for distance queries."""

    def __init__(self, corners: NDArray[np.float64]) -> None:
        import open3d

        self.scene: Any = open3d.t.geometry.RaycastingScene(nthreads=1)
        # Typed loosely: its stub requires arguments that have defaults.
        self.tensor = cast(Any, open3d.core.Tensor)
        index = np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3)
        self.scene.add_triangles(self.tensor(corners.reshape(-1, 3).astype(np.float32)), self.tensor(index))

    def distance(self, points: NDArray[Any]) -> NDArray[np.float32]:
        """(N,) to the nearest triangle."""
        query = self.tensor(np.ascontiguousarray(points, np.float32))
        return np.asarray(self.scene.compute_distance(query, nthreads=1).numpy())

    def nearest(self, points: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """(N,) nearest triangle and (N, 3) weights of its corners at the nearest point."""
        query = self.tensor(np.ascontiguousarray(points, np.float32))
        found = self.scene.compute_closest_points(query, nthreads=1)
        u, v = np.asarray(found["primitive_uvs"].numpy()).T
        return found["primitive_ids"].numpy().astype(np.int64), np.stack([1 - u - v, u, v], axis=1)


def solidify(corners: NDArray[np.float64], voxel: float) -> tuple[Mesh, NDArray[np.bool_]]:
    """Return one closed mesh around a triangle soup (F, 3, 3), and (F,) bool: triangles visible from outside it."""
    winding = Winding(corners)
    thin, visible = _sides(corners, winding, voxel)
    low = corners.min(axis=(0, 1)) - 4 * voxel
    shape = np.ceil((corners.max(axis=(0, 1)) + 4 * voxel - low) / voxel).astype(int) // 4 * 4 + 4
    surface = SoupSurface(corners)
    number, close = _numbers(winding, surface, low, shape, voxel)
    nodes = low + voxel * np.argwhere(close)
    reach = np.full(shape, REACH * voxel)
    reach[close] = np.minimum(reach[close], surface.distance(nodes))
    # At a triangle the number jumps by one and the distance decides; across open rims it changes slowly and decides.
    slope = STEEP * voxel * (0.5 - number)
    values = np.sign(slope) * np.minimum(np.abs(slope), reach)
    for (_, cover), chosen in zip(THIN, thin, strict=True):
        if chosen.any():
            coat = SoupSurface(corners[chosen]).distance(nodes) - cover * voxel
            values[close] = np.minimum(values[close], coat)
    field = _one_piece(values, voxel)
    grid = Grid(field.astype(np.float32), np.ones(shape, bool), _outside(field), low, voxel)
    return extract(grid), visible


def _numbers(
    winding: Winding, surface: SoupSurface, low: NDArray[np.float64], shape: NDArray[np.int64], voxel: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Winding number of each node of a grid, and bool: nodes that may have a triangle within reach."""
    number, close = np.zeros(shape), np.ones(shape, bool)
    undecided = np.ones(shape // BLOCKS[0], bool)
    for edge in BLOCKS:
        at = np.argwhere(undecided)
        middles = low + voxel * (edge * at + (edge - 1) / 2)
        level, distance = winding(middles), surface.distance(middles) / voxel
        half = (edge - 1) / 2 * 3**0.5
        values = np.zeros(undecided.shape)
        values[undecided] = level
        number = np.where(_spread(undecided, edge), _spread(values, edge), number)
        if edge == BLOCKS[0]:
            close = _spread((distance < REACH + half).reshape(undecided.shape), edge)
        # Away from triangles the number is smooth: where it is decided in the middle of a block, it is in all of it.
        undecided[undecided] = (distance < 1 + half) | (np.abs(level - 0.5) < DECIDED)
        undecided = _spread(undecided, 2)
    return number, close


def _spread(blocks: NDArray[Any], edge: int) -> NDArray[Any]:
    """Repeat every value `edge` times along each of the three axes."""
    return blocks.repeat(edge, 0).repeat(edge, 1).repeat(edge, 2)


def _sides(
    corners: NDArray[np.float64], winding: Winding, voxel: float
) -> tuple[list[NDArray[np.bool_]], NDArray[np.bool_]]:
    """For each of `THIN` (F,) bool: triangles whose far side is that near; and (F,) bool: triangles visible outside."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    spread = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
    at = np.einsum("sc,fcd->sfd", spread, corners)

    def inside(step: float) -> NDArray[np.bool_]:
        return (winding((at + step * voxel * normal).reshape(-1, 3)) > 0.5).reshape(len(spread), -1)

    before = inside(0.5)
    behind = [inside(-depth) for depth, _ in THIN]
    visible = np.logical_not((before & behind[0]).all(axis=0))
    return [(~before & ~side).sum(axis=0) >= 2 for side in behind], np.asarray(visible)


def _one_piece(field: NDArray[np.float64], voxel: float) -> NDArray[np.float64]:
    """Drop small loose pieces of the field and connect larger ones to the largest by short rods."""
    from scipy.ndimage import label
    from scipy.spatial import cKDTree

    field = np.where(np.abs(field) < 1e-6, 1e-6, field)
    for _ in range(32):
        pieces, count = label(field < 0)
        sizes = np.bincount(pieces.reshape(-1), minlength=count + 1)
        sizes[0] = 0
        field = np.where((sizes < MIN_PIECE_VOXELS)[pieces] & (field < 0), 0.5 * voxel, field)
        loose = [piece for piece in range(1, count + 1) if MIN_PIECE_VOXELS <= sizes[piece] < sizes.max()]
        if not loose:
            break
        own = np.argwhere(pieces == loose[0])
        rest = np.argwhere((pieces > 0) & (pieces != loose[0]) & (sizes >= MIN_PIECE_VOXELS)[pieces])
        gap, nearest = cKDTree(rest).query(own)
        a, b = own[gap.argmin()], rest[nearest[gap.argmin()]]
        # Only the rod's own box of nodes changes.
        first, last = np.minimum(a, b) - 2, np.maximum(a, b) + 3
        window = tuple(slice(int(i), int(j)) for i, j in zip(first, last, strict=True))
        at = first + np.moveaxis(np.indices(last - first), 0, -1)
        along = ((at - a) @ (b - a) / ((b - a) @ (b - a))).clip(0, 1)[..., None]
        rod = voxel * (np.linalg.norm(at - a - along * (b - a), axis=-1) - 1.5)
        field[window] = np.minimum(field[window], rod)
    return field


def _outside(field: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Nodes connected with the space around the body."""
    from scipy.ndimage import label

    spaces, _ = label(field > 0)
    return np.asarray(spaces == spaces[0, 0, 0])
