"""Sampling of the body's outer surface as a uniform oriented point cloud (paper §4.5).

The paper scans the body by sphere tracing from many views. Views alone leave 1.6 % of a figure uncovered (26 views;
armpits, between fingers), so random points in the cells round the surface, projected onto it by Newton's method,
are added. Cells of cavities inside the body take no part, and rays do not reach them either.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.body import Body
from fig2mesh.field.camera import framing, orthographic
from fig2mesh.field.trace import trace
from fig2mesh.mesh.band import Band, band, throw
from fig2mesh.mesh.grid import Grid, sample_grid
from fig2mesh.mesh.newton import newton, outward
from fig2mesh.mesh.protocol import Field
from fig2mesh.mesh.thin import thin
from fig2mesh.records import ByteArray, FloatArray, PointCloud

VIEWS: tuple[tuple[float, float], ...] = (
    *((yaw, 0.0) for yaw in range(0, 360, 90)),
    *((yaw, pitch) for pitch in (-35.0, 35.0) for yaw in range(45, 360, 90)),
    (0.0, 90.0),
    (0.0, -90.0),
)
"""Yaw and pitch of the views, degrees: front, sides and back, the diagonals from above and below, top and bottom."""

MAX_PIXELS = 1024
"""Longest side of a view, pixels; finer rays would only be thinned again."""

PER_CELL = 6
"""Random points in each cell round the surface. At 36,000 points, 12 per cell and two rays per spacing cost twice the
time and shrink the widest gap from 1.19 to 1.14 spacings."""


def scan(body: Field, *, spacing: float, seed: int) -> PointCloud:
    """Sample points on the outer surface, nowhere nearer to each other than `spacing` and nowhere much farther apart.

    Where the body is thinner than three spacings the points are closer, in proportion, down to a quarter (`band`).

    Parameters
    ----------
    body : a `Body`, or any field; views are traced only of a `Body`, and only it has part labels
    spacing : least distance between points, FIGURE units
    seed : of the random points; the same seed gives the same cloud

    Returns
    -------
    Points in FIGURE, their normals (the field's gradient, unit length) and the label of the part they lie on.
    """
    random = np.random.default_rng(seed)
    tolerance = 5e-3 * spacing
    grid = sample_grid(body, spacing)
    cells = band(grid)
    each = np.ceil(PER_CELL / cells.share**2).astype(np.int64)
    landed, arrived = newton(body, throw(grid, cells, each, random), tolerance=tolerance, reach=spacing)
    points = landed[arrived]
    share = np.repeat(cells.share, each)[arrived]
    if isinstance(body, Body):
        traced = _traced(body, spacing, tolerance)
        points = np.concatenate([points, traced])
        share = np.concatenate([share, _share_at(traced, grid, cells)])
    order = random.permutation(len(points))
    points, share = points[order], share[order]
    points = points[thin(points, share * spacing)]
    normals = outward(body, points, spacing / 2)
    length = np.linalg.norm(normals, axis=1)
    # Where opposite slopes cancel (the ridge of a sheet) no direction is right, and a wrong one misleads ball pivoting.
    steep = length > 1e-3
    points, normals = points[steep], normals[steep] / length[steep, None]
    return PointCloud(points, normals, _labels(body, points))


def _share_at(points: FloatArray, grid: Grid, cells: Band) -> FloatArray:
    """(N,) local spacing, as a share, in the cells that hold the points."""
    shares = np.ones(grid.values.shape, np.float32)
    shares[tuple(cells.cells.T)] = cells.share
    index = np.floor((points - grid.origin) / grid.spacing).astype(np.int64)
    found: FloatArray = shares[tuple(np.clip(index, 0, np.array(shares.shape) - 1).T)]
    return found


def _traced(body: Body, spacing: float, tolerance: float) -> FloatArray:
    """Hits of rays from all views, one ray for each spacing."""
    bounds = body.bounds()
    side = int(np.clip(np.ceil(np.linalg.norm(bounds[1] - bounds[0]) / spacing), 16, MAX_PIXELS))
    found = []
    for yaw, pitch in VIEWS:
        centre, height = framing(bounds, (side, side), yaw, pitch)
        rays = orthographic(yaw, pitch, size=(side, side), height=height, centre=centre)
        hits = trace(body, rays, tolerance=tolerance, with_normals=False)
        found.append(hits.points[hits.hit])
    return np.concatenate(found)


def _labels(body: Any, points: NDArray[np.float32]) -> ByteArray:
    if not isinstance(body, Body) or len(points) == 0:
        return np.zeros(len(points), np.uint8)
    return body.nearest_labels(points)
