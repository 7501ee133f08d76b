"""The shader's picture by the compiled tracer, and its colour rule in NumPy."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.field.body import Body
from fig2mesh.field.camera import axes, orthographic, perspective
from fig2mesh.field.trace import trace
from fig2mesh.mesh.bake import crease_ink
from fig2mesh.records import Rays
from tests.fig2mesh.view.conftest import Painted

Array = NDArray[np.float64]


def picture(
    painted: Painted, yaw: float, pitch: float, effects: Collection[str], *, size: int, height: float, centre: Any
) -> Array:
    """(size, size, 4) colours 0-255, premultiplied by alpha 0-1."""
    body = painted.body if "smooth-union" in effects else Body(painted.body.parts)
    camera = {"size": (size, size), "height": height, "centre": centre}
    if "perspective" in effects:
        rays = perspective(yaw, pitch, **camera, distance=2.2 * height)
    else:
        rays = orthographic(yaw, pitch, **camera)
    hits = trace(body, rays)
    hit = hits.hit
    points, normals = hits.points[hit].astype(float), hits.normals[hit].astype(float)
    colour = _painted(painted, body, hits.part_index[hit], points, normals, effects)
    if "light" in effects:
        lamp = np.array([-0.30, 0.45, 0.84])
        light = 0.5 + 0.5 * normals @ axes(yaw, pitch).T @ (lamp / np.linalg.norm(lamp))
        colour *= (0.5 + 0.55 * light**1.5)[:, None]
    if "ao" in effects:
        closed = np.zeros(len(points))
        for k, weight in enumerate(0.5 * 0.6 ** np.arange(4)):
            reach = 0.015 * 2**k
            closed += weight * (1 - np.clip(body.distance(points + reach * normals), 0, reach) / reach)
        colour *= (1 - 0.55 * np.minimum(closed, 1))[:, None]
    image = np.zeros((size * size, 4))
    image[hit] = np.concatenate([np.minimum(colour, 255), np.ones((len(colour), 1))], axis=1)
    return image.reshape(size, size, 4)


def _painted(
    painted: Painted, body: Body, part: NDArray[np.int32], points: Array, normals: Array, effects: Collection[str]
) -> Array:
    sources = painted.sources
    start = np.concatenate([points[:, :2], np.full((len(points), 1), 5.0)], axis=1).astype(np.float32)
    front = trace(body, Rays(start, np.tile(np.float32([0, 0, -1]), (len(points), 1))), with_normals=False)
    behind = 5.0 - np.where(front.hit, front.depth, np.inf) - points[:, 2]
    if "blend" in effects:
        shown = _step(sources.grazing - 0.15, sources.grazing + 0.15, normals[:, 2]) * (1 - _step(3e-3, 18e-3, behind))
    else:
        shown = ((normals[:, 2] > sources.grazing) & (behind < 3e-3)).astype(float)
    at = painted.frame.image_from_figure(points)
    plain = np.empty((len(points), 3))
    for index in np.unique(part):
        own = part == index
        plain[own] = _sampled(sources.plain[int(body.labels[index])], at[own] * sources.plain_scale)
    if "creases" in effects:
        assert sources.pen is not None
        ink = crease_ink(body, points, normals, sources.pen.width)[:, None]
        plain += ink * (sources.pen.colour - plain)
    return plain + shown[:, None] * (_sampled(sources.seen, at) - plain)


def _sampled(image: NDArray[np.float32], at: Array) -> Array:
    rows, columns = at[:, 1] - 0.5, at[:, 0] - 0.5
    channels = [ndimage.map_coordinates(image[..., c], (rows, columns), order=1, mode="nearest") for c in range(3)]
    return np.stack(channels, axis=1).astype(float)


def _step(low: float, high: float, x: Array) -> Array:
    t = np.clip((x - low) / (high - low), 0, 1)
    return np.asarray(t * t * (3 - 2 * t))
