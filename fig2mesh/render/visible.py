"""Visible points of a picture: of the figure, and of the ground below it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.camera import Camera
from fig2mesh.render.counts import Counts
from fig2mesh.render.needs import Needs
from fig2mesh.render.scene import Floats, Scene, SurfaceHits
from fig2mesh.render.view import ground_radius

UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class VisiblePoints:
    """M points visible in some rows of a picture, in the order of the pixels.

    camera : of the whole picture; rows : first, and one past the last
    surface : hits on the figure
    pixels : (M,) indices of the pixels that show them, counted from the first of `rows`
    ground : (M,) bool, on the ground; the others lie on the figure
    depth : (M,) along the rays
    points, normals : (M, 3), or (0, 3) where they are not needed
    """

    camera: Camera
    rows: tuple[int, int]
    surface: SurfaceHits
    pixels: NDArray[np.intp]
    ground: NDArray[np.bool_]
    depth: Floats
    points: Floats
    normals: Floats

    @property
    def figure(self) -> NDArray[np.bool_]:
        """(M,) bool, on the figure."""
        return ~self.ground

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and of columns."""
        return self.rows[1] - self.rows[0], self.camera.size[0]


def visible_points(
    scene: Scene, camera: Camera, rows: tuple[int, int], needs: Needs, *, with_ground: bool
) -> tuple[VisiblePoints, Counts]:
    """Points of the figure and, if requested, of the ground that are visible to a camera."""
    surface, counts = scene.meet(camera, rows, needs)
    depth = surface.depth.astype(np.float64)
    hit = np.isfinite(depth)
    if with_ground:
        missed = np.flatnonzero(~hit)
        depth[missed] = to_ground(*camera.lines(missed, rows[0]), scene.bounds)
    pixels = np.flatnonzero(np.isfinite(depth))
    ground = ~hit[pixels]
    depth = depth[pixels]
    points, normals = surface.points, surface.normals
    if ground.any():
        if needs.points:
            origins, directions = camera.lines(pixels[ground], rows[0])
            points = _merged(ground, origins + depth[ground, None] * directions, points)
        if needs.normals:
            normals = _merged(ground, UP, normals)
    return VisiblePoints(camera, rows, surface, pixels, ground, depth, points, normals), counts


def to_ground(origins: Floats, directions: Floats, bounds: Floats) -> Floats:
    """(N,) distance along rays (N, 3) down to the disc under the figure; infinite where they miss it."""
    falling = directions[:, 1] < 0
    depth = np.full(len(origins), np.inf)
    depth[falling] = (bounds[0, 1] - origins[falling, 1]) / directions[falling, 1]
    depth[depth < 0] = np.inf
    middle, flat = bounds.mean(axis=0), [0, 2]
    with np.errstate(invalid="ignore"):
        off = origins[:, flat] + depth[:, None] * directions[:, flat] - middle[flat]
        depth[~(np.hypot(off[:, 0], off[:, 1]) <= ground_radius(bounds))] = np.inf
    return depth


def _merged(ground: NDArray[np.bool_], of_ground: Floats, of_figure: Floats) -> Floats:
    """(M, 3) of both kinds of points, in the order of the pixels."""
    result = np.empty((len(ground), 3))
    result[ground], result[~ground] = of_ground, of_figure
    return result
