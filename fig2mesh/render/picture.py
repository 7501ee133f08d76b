"""One picture of a scene: rays, then for the points they meet what the request needs, and nothing else."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.camera import axes
from fig2mesh.records import ByteArray, Rays
from fig2mesh.render.counts import Counts
from fig2mesh.render.effects import Effect, Mode
from fig2mesh.render.needs import Needs, needs
from fig2mesh.render.outline import ink_cover
from fig2mesh.render.scene import CLEARANCE, FieldScene, Floats, Scene, Surface, height_of
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
from fig2mesh.render.view import View, ground_radius, make_view
from fig2mesh.skeleton import PART_COLOURS

RAYS_AT_ONCE = 1 << 19
"""Pictures are made in bands of rows with so many rays: some 100 MB."""

AO_REACH = 0.25
"""What is further away shades nothing, share of the figure's height."""

ON_GROUND = 255
"""Label of points of the ground."""

UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Request:
    """What a picture shows.

    effects : names, see `fig2mesh.render.effects`; smooth-union is a matter of the scene
    size : (width, height) pixels
    yaw_deg, pitch_deg : where the camera stands, see `fig2mesh.field.camera`
    samples : rays along each side of a pixel
    background : sRGB; None: transparent
    ground : a disc under the feet
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
class Picture:
    """rgba : (H, W, 4) uint8 sRGB, straight alpha; counts : what it took."""

    rgba: ByteArray
    counts: Counts


def view_of(scene: Scene, request: Request) -> View:
    """The camera of a request; the same for every yaw."""
    return make_view(
        scene.bounds,
        request.size,
        request.pitch_deg,
        nearby="perspective" in request.effects,
        ground=request.ground,
    )


def render(scene: Scene, request: Request) -> Picture:
    """A picture of a scene. Same scene, same request: same bytes."""
    need = needs(request.mode, request.effects, fields=isinstance(scene, FieldScene))
    view = view_of(scene, request)
    fine = replace(request, size=(request.size[0] * request.samples, request.size[1] * request.samples))
    # Lines of one band reach into the next: a border of rows is drawn with each, and cut off again.
    border = math.ceil(request.outline_px / 2) + 2 if need.edges else 0
    rows = max(1, RAYS_AT_ONCE // (fine.size[0] * request.samples) - 2 * border)
    width, height = request.size
    result = np.empty((height, width, 4), np.float32)
    counts = Counts()
    for first in range(0, height, rows):
        last = min(first + rows, height)
        band = (max(first - border, 0), min(last + border, height))
        rgba, spent = _band(scene, fine, need, view, (band[0] * request.samples, band[1] * request.samples))
        pixels = rgba.reshape(band[1] - band[0], request.samples, width, request.samples, 4).mean(axis=(1, 3))
        result[first:last] = pixels[first - band[0] : last - band[0]]
        counts += spent
    return Picture(_finished(result, request.background), counts)


def _finished(picture: NDArray[np.float32], background: tuple[int, int, int] | None) -> ByteArray:
    """Bytes of premultiplied colours 0-255 and coverage 0-1."""
    cover = picture[..., 3:]
    if background is not None:
        colour = picture[..., :3] + (1 - cover) * np.array(background, np.float32)
        cover = np.ones_like(cover)
    else:
        colour = picture[..., :3] / np.maximum(cover, 1e-9)
    return np.asarray(np.rint(np.concatenate([np.clip(colour, 0, 255), 255 * cover], axis=2)), np.uint8)


def _band(scene: Scene, request: Request, need: Needs, view: View, rows: tuple[int, int]) -> tuple[Floats, Counts]:
    """(rows, W, 4) premultiplied colours 0-255 and coverage, a ray for every pixel of the request."""
    rays = view.rays(request.yaw_deg, request.pitch_deg, request.size, rows)
    met = scene.meet(rays, need)
    hit = np.isfinite(met.depth)
    floor = np.zeros(len(hit), bool)
    depth = met.depth.astype(np.float64)
    if request.ground:
        below = _to_ground(rays.origins.astype(np.float64), rays.directions.astype(np.float64), scene.bounds)
        floor = ~hit & np.isfinite(below)
        depth = np.where(floor, below, depth)
    counts = Counts(camera_rays=len(hit), normals=len(met.normals))
    # One order for both kinds of points, that of the pixels.
    seen = np.flatnonzero(hit | floor)
    on_floor = floor[seen]
    points = rays.origins[seen] + depth[seen, None] * rays.directions[seen]
    points[~on_floor] = met.points
    normals = np.empty((0, 3))
    if need.normals:
        normals = np.broadcast_to(UP, points.shape).copy()
        normals[~on_floor] = met.normals
    colours, spent = _colours(scene, request, need, view, met, rays, depth, on_floor, seen)
    counts += spent
    if need.lamp != "none" or need.ao_samples:
        light, spent = _light(scene, request, need, points, normals, seen, rows[0])
        colours = lit(colours, light)
        counts += spent
    columns = request.size[0]
    flat = np.zeros((len(hit), 4))
    flat[seen, :3], flat[seen, 3] = colours, 1.0
    rgba = flat.reshape(-1, columns, 4)
    if need.edges:
        cover = _ink(scene, request, view, met, points, normals, seen, on_floor, len(hit))[..., None]
        rgba = rgba * (1 - cover) + cover * np.array([*request.outline_colour, 1.0])
        counts += Counts(pixels_compared=len(hit))
    return rgba, counts


def _colours(
    scene: Scene,
    request: Request,
    need: Needs,
    view: View,
    met: Surface,
    rays: Rays,
    depth: Floats,
    on_floor: NDArray[np.bool_],
    seen: NDArray[np.intp],
) -> tuple[Floats, Counts]:
    """(M, 3) sRGB 0-255 of the points before any light."""
    colours, counts = np.empty((len(seen), 3)), Counts()
    colours[on_floor] = GROUND
    view_from_scene = axes(request.yaw_deg, request.pitch_deg)
    if request.mode == "textured":
        colours[~on_floor], counts = scene.colours(met, need)
    elif request.mode == "clay":
        colours[~on_floor] = CLAY
    elif request.mode == "parts":
        colours[~on_floor] = np.array(PART_COLOURS, np.float64)[met.labels]
    elif request.mode == "normals":
        colours[~on_floor] = 127.5 * (met.normals @ view_from_scene.T + 1.0)
        colours[on_floor] = 127.5 * (UP @ view_from_scene.T + 1.0)
    else:
        away = depth[seen] * -(rays.directions[seen] @ view_from_scene[2])
        share = np.clip((view.far - away) / (view.far - view.near), 0.0, 1.0)
        colours[:] = 255.0 * share[:, None]
    return colours, counts


def _light(
    scene: Scene, request: Request, need: Needs, points: Floats, normals: Floats, seen: NDArray[np.intp], row: int
) -> tuple[Floats, Counts]:
    """(M,) linear light on the points."""
    counts = Counts()
    start = points + CLEARANCE * height_of(scene) * normals
    openness: Any = 1.0
    if need.ao_samples:
        columns = request.size[0]
        turns = turns_at(seen % columns, seen // columns + row)
        openness = _openness(scene, start, normals, turns, need.ao_samples, request.ground)
        counts += Counts(ao_rays=need.ao_samples * len(points))
    if need.lamp in ("none", "head"):
        bare = head_light(normals, request.yaw_deg, request.pitch_deg) if need.lamp == "head" else np.ones(len(points))
        return bare * openness, counts
    lamp: Floats | None = key_direction(request.yaw_deg)
    fill = fill_direction(request.yaw_deg)
    if need.lamp == "sun":
        lamp, fill = None if request.sun is None else np.array(request.sun, np.float64), UP
    reached = np.ones(len(points))
    if need.shadow and lamp is not None:
        # What is turned away from the lamp is dark already.
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
            blocked |= _to_ground(origins, directions, scene.bounds) < reach
        result[part] = 1.0 - blocked.reshape(-1, samples).mean(axis=1)
    return result


def _to_ground(origins: Floats, directions: Floats, bounds: Floats) -> Floats:
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


def _ink(
    scene: Scene,
    request: Request,
    view: View,
    met: Surface,
    points: Floats,
    normals: Floats,
    seen: NDArray[np.intp],
    on_floor: NDArray[np.bool_],
    count: int,
) -> Floats:
    columns = request.size[0]
    kinds = np.zeros(count, np.int16)
    # The rim of the ground is no line of the figure: ground and nothing are one kind.
    kinds[seen[~on_floor]] = met.labels.astype(np.int16) + 1
    places, ways = np.zeros((count, 3)), np.zeros((count, 3))
    places[seen], ways[seen] = points, normals
    shape = (-1, columns)
    return ink_cover(
        kinds.reshape(shape),
        places.reshape(*shape, 3),
        ways.reshape(*shape, 3),
        view.height / request.size[1],
        height_of(scene),
        request.outline_px * request.samples,
    )
