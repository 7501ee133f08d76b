"""What is looked at: the part fields of a figure, or a finished mesh; both answer the same three questions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from exporters.asset import TexturedMesh
from fig2mesh.field.body import Body
from fig2mesh.field.trace import trace
from fig2mesh.image_frame import ImageFrame
from fig2mesh.mesh.bake import drawn_colours, plain_colours
from fig2mesh.mesh.preview import interpolated, mesh_colours, raycasting_scene
from fig2mesh.records import Rays
from fig2mesh.render.counts import Counts
from fig2mesh.render.needs import Needs
from fig2mesh.texture.sources import Sources

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

CLEARANCE = 1e-3
"""Rays start this share of the figure's height off the surface, so that they do not meet it where they start."""

BLEND_SPAN = 0.5
"""`blend`: over so much of the normal's z the drawing comes in, from the angle at which it would have appeared."""


@dataclass(frozen=True)
class Surface:
    """Where N rays meet the surface, at M points.

    depth : (N,) along the rays; infinite where nothing is met
    points : (M, 3); normals : (M, 3) unit, or (0, 3); labels : (M,) uint8, or (0,)
    corners, weights : (M, 3) vertices of the triangles met and barycentric coordinates; None for fields
    """

    depth: NDArray[np.float32]
    points: Floats
    normals: Floats
    labels: NDArray[np.uint8]
    corners: NDArray[np.int32] | None = None
    weights: NDArray[np.float32] | None = None


class Scene(Protocol):
    """A figure in coordinates of its own: x right as seen from its front, y up, z towards the front."""

    @property
    def bounds(self) -> Floats:
        """(2, 3) box around the surface."""

    @property
    def unit(self) -> float:
        """Length of a unit of these coordinates in the units of what was given."""

    def meet(self, rays: Rays, needs: Needs) -> Surface:
        """First meeting of each ray with the surface."""

    def blocked(self, origins: Floats, directions: Floats, reach: float = np.inf) -> Bools:
        """(N,) whether the surface is met within `reach`."""

    def colours(self, surface: Surface, needs: Needs) -> tuple[Floats, Counts]:
        """(M, 3) sRGB 0-255 of the points of a surface."""


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

    def meet(self, rays: Rays, needs: Needs) -> Surface:
        hits = trace(self.body, rays, with_normals=needs.normals)
        hit = hits.hit
        normals = hits.normals[hit] if needs.normals else np.empty((0, 3))
        labels = self.body.labels[hits.part_index[hit]] if needs.labels else np.empty(0, np.uint8)
        return Surface(hits.depth, hits.points[hit].astype(np.float64), normals.astype(np.float64), labels)

    def blocked(self, origins: Floats, directions: Floats, reach: float = np.inf) -> Bools:
        rays = Rays(origins.astype(np.float32), directions.astype(np.float32))
        return np.asarray(trace(self.body, rays, with_normals=False).depth < reach)

    def colours(self, surface: Surface, needs: Needs) -> tuple[Floats, Counts]:
        if self.sources is None or self.frame is None:
            raise ValueError("sources and frame: None, expected the colours of the figure")
        # The drawing is seen from far along +z, as in the bake; there the mesh decides, here the field itself.
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
    """A finished mesh, ASSET, moved and scaled to a box of unit size about the origin: single precision then serves
    figures of a millimetre and of a kilometre alike."""

    mesh: TexturedMesh

    @cached_property
    def _box(self) -> tuple[Floats, Floats]:
        vertices = self.mesh.vertices.astype(np.float64)
        return vertices.min(axis=0), vertices.max(axis=0)

    @cached_property
    def bounds(self) -> Floats:
        low, high = self._box
        return np.stack([low - high, high - low]) / (2 * self.unit)

    @cached_property
    def unit(self) -> float:
        low, high = self._box
        return max(float((high - low).max()), 1e-30)

    @cached_property
    def _scene(self) -> Any:
        low, high = self._box
        return raycasting_scene((self.mesh.vertices - (low + high) / 2) / self.unit, self.mesh.faces)

    def meet(self, rays: Rays, needs: Needs) -> Surface:
        answer = self._scene.cast_rays(_packed(rays.origins, rays.directions))
        depth = answer["t_hit"].numpy()
        hit = np.isfinite(depth)
        corners = self.mesh.faces[answer["primitive_ids"].numpy()[hit]]
        second, third = answer["primitive_uvs"].numpy()[hit].T
        weights = np.stack([1 - second - third, second, third], axis=1)
        points = rays.origins[hit].astype(np.float64) + depth[hit, None].astype(np.float64) * rays.directions[hit]
        normals = np.empty((0, 3))
        if needs.normals:
            normals = interpolated(self.mesh.shading_normals, corners, weights).astype(np.float64)
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        labels = np.empty(0, np.uint8)
        if needs.labels:
            nearest = corners[np.arange(len(corners)), weights.argmax(axis=1)]
            labels = np.zeros(len(nearest), np.uint8) if self.mesh.parts is None else self.mesh.parts[nearest]
        return Surface(depth, points, normals, labels, corners, weights)

    def blocked(self, origins: Floats, directions: Floats, reach: float = np.inf) -> Bools:
        answer = self._scene.test_occlusions(_packed(origins, directions), tnear=0.0, tfar=float(reach))
        return np.asarray(answer.numpy())

    def colours(self, surface: Surface, needs: Needs) -> tuple[Floats, Counts]:
        assert surface.corners is not None
        assert surface.weights is not None
        found = mesh_colours(self.mesh, surface.corners, surface.weights)
        if found is None:
            raise ValueError("mesh: no texture and no colours, expected one of them")
        return found.astype(np.float64), Counts(texture_samples=len(found))


def smooth_step(share: Floats) -> Floats:
    """0 below 0, 1 above 1, and a cubic between them."""
    inside = np.clip(share, 0.0, 1.0)
    return np.asarray(inside * inside * (3.0 - 2.0 * inside))


def _packed(origins: NDArray[Any], directions: NDArray[Any]) -> Any:
    import open3d as o3d

    return o3d.core.Tensor.from_numpy(np.concatenate([origins, directions], axis=1).astype(np.float32))
