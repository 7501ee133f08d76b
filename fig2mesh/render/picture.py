"""Rendering of one picture of a scene: camera rays, then, for the points they hit, only what the request needs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fig2mesh.mesh.pixels import straight_bytes
from fig2mesh.records import ByteArray
from fig2mesh.render.counts import Counts
from fig2mesh.render.effects import Effect, Mode
from fig2mesh.render.needs import Needs, needs
from fig2mesh.render.outline import ink_cover
from fig2mesh.render.scene import CLEARANCE, FieldScene, Floats, Scene, height_of
from fig2mesh.render.shading import (
    CLAY,
    GROUND,
    fill_direction,
    head_light,
    hemisphere,
    key_direction,
    light_of,
    lit,
    turns_at,
)
from fig2mesh.render.view import CameraView, make_view
from fig2mesh.render.visible import UP, VisiblePoints, to_ground, visible_points
from fig2mesh.skeleton import PART_COLOURS

RAYS_AT_ONCE = 1 << 19
"""Rays per band of rows: some 100 MB."""

AO_REACH = 0.25
"""Range of ambient occlusion, share of the figure's height."""


@dataclass(frozen=True)
class PictureRequest:
    """Parameters of a picture.

    effects : names, see `fig2mesh.render.effects`; smooth-union is part of the scene
    size : (width, height) pixels
    yaw_deg, pitch_deg : direction of the camera, see `fig2mesh.field.camera`
    samples : rays along each side of a pixel
    background : sRGB; None: transparent
    ground : whether to show a disc under the feet
    sun : (3,) unit vector towards the sun in the scene's axes; None: it is below the horizon
    outline_px, outline_colour : width in pixels and sRGB of ink lines
    """

    mode: Mode = "textured"
    effects: frozenset[Effect] = frozenset()
    size: tuple[int, int] = (480, 640)
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    samples: int = 1
    background: tuple[int, int, int] | None = None
    ground: bool = False
    sun: tuple[float, float, float] | None = None
    outline_px: float = 1.5
    outline_colour: tuple[int, int, int] = (34, 30, 28)

    def __post_init__(self) -> None:
        if min(*self.size, self.samples) < 1:
            raise ValueError(f"size and samples are {self.size} and {self.samples}, expected at least 1")


@dataclass(frozen=True)
class RenderedPicture:
    """rgba : (H, W, 4) uint8 sRGB, straight alpha; counts : of the work."""

    rgba: ByteArray
    counts: Counts


def view_of(scene: Scene, request: PictureRequest) -> CameraView:
    """Camera of a request; a change of yaw neither moves nor zooms it."""
    return make_view(
        scene.bounds,
        request.size,
        request.yaw_deg,
        request.pitch_deg,
        nearby="perspective" in request.effects,
        ground=request.ground,
    )


def render(scene: Scene, request: PictureRequest) -> RenderedPicture:
    """Render a picture of a scene. The same scene and request give the same bytes."""
    need = needs(request.mode, request.effects, fields=isinstance(scene, FieldScene))
    view = view_of(scene, request)
    width, height = request.size
    sampled = replace(view, camera=replace(view.camera, size=(width * request.samples, height * request.samples)))
    # Lines of one band extend into the next: a border of rows is rendered with each band, and cropped.
    border = math.ceil(request.outline_px / 2) + 2 if need.edges else 0
    rows = max(1, RAYS_AT_ONCE // (width * request.samples**2) - 2 * border)
    result = np.empty((height, width, 4), np.float32)
    counts = Counts()
    for first in range(0, height, rows):
        last = min(first + rows, height)
        band = (max(first - border, 0), min(last + border, height))
        rgba, spent = _band(scene, request, need, sampled, (band[0] * request.samples, band[1] * request.samples))
        pixels = rgba.reshape(band[1] - band[0], request.samples, width, request.samples, 4).mean(axis=(1, 3))
        result[first:last] = pixels[first - band[0] : last - band[0]]
        counts += spent
    return RenderedPicture(straight_bytes(result, request.background), counts)


def _band(
    scene: Scene, request: PictureRequest, need: Needs, view: CameraView, rows: tuple[int, int]
) -> tuple[Floats, Counts]:
    """(rows, W, 4) premultiplied colours 0-255 and coverage of the rays of some rows."""
    visible, counts = visible_points(scene, view.camera, rows, need, with_ground=request.ground)
    colours, spent = _colours(scene, request, need, view, visible)
    counts += spent
    if need.lamp != "none" or need.ao_samples:
        light, spent = _light(scene, request, need, visible)
        colours = lit(colours, light)
        counts += spent
    rgba = np.zeros((*visible.shape, 4))
    flat = rgba.reshape(-1, 4)
    flat[visible.pixels, :3], flat[visible.pixels, 3] = colours, 1.0
    if need.edges:
        cover = _ink(scene, request, visible)[..., None]
        rgba = rgba * (1 - cover) + cover * np.array([*request.outline_colour, 1.0])
        counts += Counts(pixels_compared=len(flat))
    return rgba, counts


def _colours(
    scene: Scene, request: PictureRequest, need: Needs, view: CameraView, visible: VisiblePoints
) -> tuple[Floats, Counts]:
    """(M, 3) sRGB 0-255 of the points, unlit."""
    counts = Counts()
    if request.mode == "depth":
        _, directions = visible.camera.lines(visible.pixels, visible.rows[0])
        away = visible.depth * -(directions @ visible.camera.axes[2])
        share = np.clip((view.far - away) / (view.far - view.near), 0.0, 1.0)
        return np.repeat(255.0 * share[:, None], 3, axis=1), counts
    if request.mode == "normals":
        return 127.5 * (visible.normals @ visible.camera.axes.T + 1.0), counts
    colours = np.empty((len(visible.pixels), 3))
    colours[visible.ground] = GROUND
    if request.mode == "textured":
        colours[visible.figure], counts = scene.colours(visible.surface, need)
    elif request.mode == "clay":
        colours[visible.figure] = CLAY
    else:
        colours[visible.figure] = np.array(PART_COLOURS, np.float64)[visible.surface.labels]
    return colours, counts


def _light(scene: Scene, request: PictureRequest, need: Needs, visible: VisiblePoints) -> tuple[Floats, Counts]:
    """(M,) linear light on the points."""
    counts, normals = Counts(), visible.normals
    start = (
        visible.points + CLEARANCE * height_of(scene) * normals if need.shadow or need.ao_samples else visible.points
    )
    openness: Any = 1.0
    if need.ao_samples:
        rows, columns = np.divmod(visible.pixels, visible.camera.size[0])
        turns = turns_at(columns, rows + visible.rows[0])
        openness = _openness(scene, start, normals, turns, need.ao_samples, request.ground)
        counts += Counts(ao_rays=need.ao_samples * len(normals))
    if need.lamp in ("none", "head"):
        bare = head_light(normals, request.yaw_deg, request.pitch_deg) if need.lamp == "head" else 1.0
        return np.broadcast_to(bare * openness, len(normals)), counts
    lamp: Floats | None = key_direction(request.yaw_deg)
    fill = fill_direction(request.yaw_deg)
    if need.lamp == "sun":
        lamp, fill = None if request.sun is None else np.array(request.sun, np.float64), UP
    reached = np.ones(len(normals))
    if need.shadow and lamp is not None:
        # Points that face away from the lamp are dark already.
        turned = np.flatnonzero(normals @ lamp > 0)
        reached[turned] = ~scene.blocked(start[turned], np.broadcast_to(lamp, (len(turned), 3)))
        counts += Counts(shadow_rays=len(turned))
    return light_of(normals, lamp, fill, reached, openness), counts


def _openness(scene: Scene, start: Floats, normals: Floats, turns: Floats, samples: int, ground: bool) -> Floats:
    """(M,) share of the hemisphere over each point, weighted by Lambert's cosine, that nothing nearby blocks."""
    reach = AO_REACH * height_of(scene)
    result = np.empty(len(start))
    chunk = max(1, RAYS_AT_ONCE // samples)
    for first in range(0, len(start), chunk):
        part = slice(first, first + chunk)
        directions = hemisphere(normals[part], samples, turns[part])
        origins = np.repeat(start[part], samples, axis=0)
        directions = directions.reshape(-1, 3)
        blocked = scene.blocked(origins, directions, reach)
        if ground:
            blocked |= to_ground(origins, directions, scene.bounds) < reach
        result[part] = 1.0 - blocked.reshape(-1, samples).mean(axis=1)
    return result


def _ink(scene: Scene, request: PictureRequest, visible: VisiblePoints) -> Floats:
    """(rows, W) share of each pixel that ink lines cover."""
    count = visible.shape[0] * visible.shape[1]
    kinds = np.zeros(count, np.int16)
    # The rim of the ground is not a line of the figure, so ground and background have the same label.
    kinds[visible.pixels[visible.figure]] = visible.surface.labels.astype(np.int16) + 1
    places, ways = np.zeros((count, 3)), np.zeros((count, 3))
    places[visible.pixels], ways[visible.pixels] = visible.points, visible.normals
    return ink_cover(
        kinds.reshape(visible.shape),
        places.reshape(*visible.shape, 3),
        ways.reshape(*visible.shape, 3),
        visible.camera.pixel,
        height_of(scene),
        request.outline_px * request.samples,
    )
