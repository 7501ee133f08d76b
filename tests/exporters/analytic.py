"""A textured solid whose properties are all known by formula: ground truth of the exporter tests."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from exporters.asset import Asset, Texture, TexturedMesh
from georef.placement import GeoPlacement

RADIUS, HALF_SEGMENT = 0.3, 0.6
HEIGHT = 2 * (RADIUS + HALF_SEGMENT)
EXACT_VOLUME = math.pi * RADIUS**2 * (2 * HALF_SEGMENT + 4 / 3 * RADIUS)
PART_NAMES = {1: "torso", 2: "head", 9: "l_upper_leg"}


def capsule(columns: int = 32, rings: int = 8, **changes: Any) -> TexturedMesh:
    """An upright capsule that stands on the origin, with a cylindrical texture.

    columns, rings : faces around, and along each half sphere and the cylinder between. The first column of vertices
        is doubled (u = 0 and u = 1) and each pole has one vertex per column, as texture seams want it.
    """
    quarter = np.linspace(0, math.pi / 2, rings + 1)
    angles = np.concatenate([-quarter[::-1], np.zeros(rings - 1), quarter])
    offset = np.concatenate(
        [
            np.full(rings, -HALF_SEGMENT),
            np.linspace(-HALF_SEGMENT, HALF_SEGMENT, rings + 1),
            np.full(rings, HALF_SEGMENT),
        ]
    )
    turn = np.linspace(0, 2 * math.pi, columns + 1)
    turn[-1] = 0.0  # the last column is the first one again, to the bit
    cos, sin = np.cos(angles), np.sin(angles)
    cos[0] = cos[-1] = 0.0
    # u = 1/2 is the front, +z, as the seam belongs at the back.
    across, along, up = -cos[:, None] * np.sin(turn), -cos[:, None] * np.cos(turn), sin[:, None]
    normals = np.stack(np.broadcast_arrays(across, up, along), axis=2)
    vertices = normals * RADIUS
    vertices[:, :, 1] += offset[:, None] + HEIGHT / 2
    v = 1 - vertices[:, :, 1] / HEIGHT
    u = np.broadcast_to(np.linspace(0, 1, columns + 1), v.shape)
    rows = len(angles)
    index = np.arange(rows * (columns + 1)).reshape(rows, columns + 1)
    solid = index.copy()
    solid[:, -1] = solid[:, 0]
    solid[0], solid[-1] = solid[0, 0], solid[-1, 0]
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    lower = np.stack([a, b, c], axis=2)[1:]  # no triangles with two corners in the lower pole
    upper = np.stack([a, c, d], axis=2)[:-1]
    faces = np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)])
    height = vertices[:, :, 1].reshape(-1)
    fields: dict[str, Any] = {
        "vertices": vertices.reshape(-1, 3),
        "faces": faces,
        "normals": normals.reshape(-1, 3),
        "uv": np.clip(np.stack([u, v], axis=2).reshape(-1, 2), 0, 1),
        "solid_index": solid.reshape(-1),
        "texture": gradient_texture(),
        "observed": half_observed(),
        "parts": np.where(height > 1.2, 2, np.where(height < 0.6, 9, 1)),
    }
    return TexturedMesh(**(fields | changes))


def gradient_texture(size: int = 64) -> Texture:
    """Red grows with u, green with v, so that a colour identifies its position."""
    ramp = (np.arange(size) + 0.5) / size * 255
    pixels = np.zeros((size, size, 3))
    pixels[:, :, 0], pixels[:, :, 1], pixels[:, :, 2] = ramp[None, :], ramp[:, None], 128
    return Texture(np.rint(pixels))


def half_observed(size: int = 64) -> Texture:
    """The front half, a quarter of the way round to three quarters, is observed."""
    pixels = np.zeros((size, size, 1), np.uint8)
    pixels[:, size // 4 : 3 * size // 4] = 255
    return Texture(pixels)


def asset(placement: GeoPlacement | None = None, **changes: Any) -> Asset:
    """A capsule in three levels of detail with the deviations that a chord leaves: r (1 - cos(pi / n))."""
    fields: dict[str, Any] = {
        "name": "farmer",
        "lods": (
            capsule(32, 8),
            capsule(16, 4, deviation_m=(0.003, RADIUS * (1 - math.cos(math.pi / 16)))),
            capsule(8, 2, deviation_m=(0.012, RADIUS * (1 - math.cos(math.pi / 8)))),
        ),
        "placement": placement,
        "part_names": PART_NAMES,
        "copyright": "© Zürich map, CC BY 4.0",
        "observed_pixels": True,
        "metadata": {"source": "farmer.png", "seed": 7},
    }
    return Asset(**(fields | changes))


def shrinking(texels: int = 64) -> tuple[TexturedMesh, ...]:
    """The levels of `asset`, with textures of `texels`, a half and a quarter of them, as figures have."""
    sizes = (texels, texels // 2, texels // 4)
    textures = [{"texture": gradient_texture(size), "observed": half_observed(size)} for size in sizes]
    return tuple(replace(mesh, **more) for mesh, more in zip(asset().lods, textures, strict=True))


ZURICH = GeoPlacement(8.5417, 47.3769, 455.34, "egm96", 135.0)
