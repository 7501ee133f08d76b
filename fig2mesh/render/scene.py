"""Scenes to render: the part fields of a figure, or a finished mesh, with a common interface."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from exporters.asset import TexturedMesh
from fig2mesh.field.body import Body
from fig2mesh.field.camera import Camera
from fig2mesh.field.trace import trace
from fig2mesh.image_frame import ImageFrame
from fig2mesh.mesh.bake import drawn_colours, plain_colours
from fig2mesh.mesh.raycast import MeshCaster, MeshHits
from fig2mesh.records import Rays
from fig2mesh.render.counts import Counts
from fig2mesh.render.frame import render_frame
from fig2mesh.render.needs import Needs
from fig2mesh.texture.sources import Sources

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

CLEARANCE = 1e-3
"""Distance from the surface at which secondary rays start, so that they do not hit it there; share of the figure's
height."""

BLEND_SPAN = 0.5
"""`blend`: range of the normal's z over which the drawing fades in, above the threshold of `Sources.grazing`."""


@dataclass(frozen=True)
class SurfaceHits:
    """Hits of N rays on the surface, at M points; arrays that were not needed have no rows.

    depth : (N,) along the rays; infinite where nothing is hit
    points : (M, 3); normals : (M, 3) unit; labels : (M,) uint8
    hits : on the triangles of a mesh; None for fields
    """

    depth: NDArray[np.float32]
    points: Floats
    normals: Floats
    labels: NDArray[np.uint8]
    hits: MeshHits | None = None


class Scene(Protocol):
    """A figure in coordinates of its own: x right as seen from its front, y up, z towards the front."""

    @property
    def bounds(self) -> Floats:
        """(2, 3) bounding box of the surface."""

    @property
    def unit(self) -> float:
        """Length of a unit of these coordinates, in units of the input."""

    @property
    def line_width(self) -> float:
        """Width of the drawn contour in these coordinates; 0 where it is unknown, or none is drawn."""

    def meet(self, camera: Camera, rows: tuple[int, int], needs: Needs) -> tuple[SurfaceHits, Counts]:
        """First hits of the rays of a picture's rows, from the first to before the last."""

    def blocked(self, origins: Floats, directions: Floats, reach: float = np.inf) -> Bools:
        """(N,) whether rays hit the surface within `reach`."""

    def colours(self, surface: SurfaceHits, needs: Needs) -> tuple[Floats, Counts]:
        """(M, 3) sRGB 0-255 of the points."""


def height_of(scene: Scene) -> float:
    """Height of the figure in the scene's coordinates."""
    low, high = scene.bounds
    return max(float(high[1] - low[1]), 1e-9)


@dataclass(frozen=True)
class FieldScene:
    """The part fields of a figure, FIGURE.

    sources, frame : colours, see `fig2mesh.mesh.bake`; None where no picture needs them
    """

    body: Body
    sources: Sources | None = None
    frame: ImageFrame | None = None

    @cached_property
    def bounds(self) -> Floats:
        return self.body.bounds().astype(np.float64)

    @property
    def unit(self) -> float:
        return 1.0

    @property
    def line_width(self) -> float:
        return 0.0 if self.sources is None or self.sources.pen is None else self.sources.pen.width

    def meet(self, camera: Camera, rows: tuple[int, int], needs: Needs) -> tuple[SurfaceHits, Counts]:
        frame = render_frame(self.body, camera, rows, with_parts=needs.labels, with_normals=needs.normals)
        depth = frame.depth.reshape(-1)
        hit = np.flatnonzero(np.isfinite(depth))
        points, normals, labels = np.empty((0, 3)), np.empty((0, 3)), np.empty(0, np.uint8)
        if needs.points:
            origins, directions = camera.lines(hit, rows[0])
            points = origins + depth[hit, None] * directions
        if frame.normals is not None:
            normals = frame.normals.reshape(-1, 3)[hit].astype(np.float64)
        if frame.parts is not None:
            labels = self.body.labels[frame.parts.reshape(-1)[hit]]
        counts = Counts(camera_rays=len(depth), normals=frame.normals_computed)
        return SurfaceHits(depth, points, normals, labels), counts

    def blocked(self, origins: Floats, directions: Floats, reach: float = np.inf) -> Bools:
        rays = Rays(origins.astype(np.float32), directions.astype(np.float32))
        return np.asarray(trace(self.body, rays, with_normals=False).depth < reach)

    def colours(self, surface: SurfaceHits, needs: Needs) -> tuple[Floats, Counts]:
        if self.sources is None or self.frame is None:
            raise ValueError("sources and frame: None, expected the colours of the figure")
        # The viewer of the drawing is far along +z, as in the bake; there the mesh decides visibility, here the field.
        facing = surface.normals[:, 2]
        share = (facing > self.sources.grazing).astype(np.float64)
        if needs.blend:
            share = smooth_step((facing - self.sources.grazing) / BLEND_SPAN)
        turned = np.flatnonzero(share > 0)
        start = surface.points[turned] + CLEARANCE * height_of(self) * surface.normals[turned]
        share[turned[self.blocked(start, np.broadcast_to([0.0, 0.0, 1.0], start.shape))]] = 0.0
        drawn, plain = share > 0, share < 1
        colour = np.zeros((len(share), 3))
        colour[plain] = plain_colours(
            self.sources, self.frame, surface.points[plain], surface.normals[plain], surface.labels[plain], self.body
        )
        front = drawn_colours(self.sources, self.frame, surface.points[drawn])
        colour[drawn] += share[drawn, None] * (front - colour[drawn])
        samples = int(drawn.sum()) + int(plain.sum())
        return colour, Counts(texture_samples=samples, sight_rays=len(turned))


@dataclass(frozen=True)
class MeshScene:
    """A finished mesh, ASSET, in coordinates of `MeshCaster`."""

    mesh: TexturedMesh

    @cached_property
    def _caster(self) -> MeshCaster:
        return MeshCaster(self.mesh)

    @cached_property
    def bounds(self) -> Floats:
        low, high = self._caster.box
        return np.stack([low - high, high - low]) / (2 * self.unit)

    @property
    def unit(self) -> float:
        return self._caster.unit

    @property
    def line_width(self) -> float:
        return 0.0 if self.mesh.outline is None else self.mesh.outline.width_m / self.unit

    def meet(self, camera: Camera, rows: tuple[int, int], needs: Needs) -> tuple[SurfaceHits, Counts]:
        rays = camera.rays(rows)
        hits = self._caster.cast(rays.origins, rays.directions)
        points, normals, labels = np.empty((0, 3)), np.empty((0, 3)), np.empty(0, np.uint8)
        if needs.points:
            points = rays.origins[hits.hit] + hits.depth[hits.hit, None].astype(np.float64) * rays.directions[hits.hit]
        if needs.normals:
            normals = self._caster.normals(hits)
        if needs.labels:
            labels = self._caster.labels(hits)
        counts = Counts(camera_rays=len(hits.depth), normals=len(normals))
        return SurfaceHits(hits.depth, points, normals, labels, hits), counts

    def blocked(self, origins: Floats, directions: Floats, reach: float = np.inf) -> Bools:
        return self._caster.blocked(origins, directions, reach)

    def colours(self, surface: SurfaceHits, needs: Needs) -> tuple[Floats, Counts]:
        assert surface.hits is not None
        found = self._caster.colours(surface.hits)
        if found is None:
            raise ValueError("mesh: no texture and no colours, expected one of them")
        return found.astype(np.float64), Counts(texture_samples=len(found))


def smooth_step(share: Floats) -> Floats:
    """0 below 0, 1 above 1, and a cubic between them."""
    inside = np.clip(share, 0.0, 1.0)
    return np.asarray(inside * inside * (3.0 - 2.0 * inside))
