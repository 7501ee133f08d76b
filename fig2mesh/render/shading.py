"""Shading of points, as functions of arrays; light is summed linearly, not as sRGB."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.colour import linear_from_srgb, srgb_from_linear
from fig2mesh.field.camera import axes

Floats = NDArray[np.float64]

AMBIENT, FILL, KEY = 0.10, 0.24, 0.88
"""Shares of white light: from everywhere, soft from one side, and of the lamp at right angles. A white wall facing the
viewer of `light` has 0.85: drawings keep most of their brightness, and only surfaces that face the lamp clip."""

KEY_LIGHT = (-0.50, 0.62, 0.60)
"""Towards the lamp: right and up as seen, and towards the viewer, over level ground whatever the camera's pitch."""

FILL_LIGHT = (0.55, 0.10, 0.83)
"""Towards the middle of the soft fill of `light`, likewise; that of `sun` is the sky."""

HEAD_LIGHT = (-0.30, 0.45, 0.84)
"""Towards the light on clay without the effects light and sun: turns with the camera."""

CLAY = (206.0, 190.0, 174.0)
GROUND = (232.0, 230.0, 226.0)


def key_direction(yaw_deg: float) -> Floats:
    """(3,) unit vector towards the lamp of `light`, for a camera at this yaw."""
    return _from_view(KEY_LIGHT, yaw_deg, 0.0)


def fill_direction(yaw_deg: float) -> Floats:
    """(3,) unit vector towards the middle of the fill of `light`."""
    return _from_view(FILL_LIGHT, yaw_deg, 0.0)


def _from_view(direction: Any, yaw_deg: float, pitch_deg: float) -> Floats:
    vector = np.asarray(direction, np.float64) @ axes(yaw_deg, pitch_deg)
    return np.asarray(vector / np.linalg.norm(vector))


def light_of(normals: Floats, lamp: Floats | None, fill: Floats, reached: Any = 1.0, openness: Any = 1.0) -> Floats:
    """(N,) linear light on points: Lambert's law for the lamp, half-Lambert for the fill.

    normals : (N, 3) unit; lamp, fill : (3,) unit, towards them; no lamp: None
    reached : (N,) 1 where the lamp's rays arrive, 0 in shadow
    openness : (N,) share of the hemisphere that is not occluded
    """
    soft = AMBIENT + FILL * (0.5 + 0.5 * normals @ fill)
    direct = 0.0 if lamp is None else KEY * np.maximum(normals @ lamp, 0.0) * reached
    return np.asarray(soft * openness + direct, np.float64)


def head_light(normals: Floats, yaw_deg: float, pitch_deg: float) -> Floats:
    """(N,) linear light on clay without other lights: soft, so that no side is black."""
    half = 0.5 + 0.5 * normals @ _from_view(HEAD_LIGHT, yaw_deg, pitch_deg)
    return np.asarray(0.1 + 0.95 * half**2, np.float64)


def lit(colours: Floats, light: Floats) -> Floats:
    """(N, 3) sRGB 0-255 of surfaces of colours (N, 3) in linear light (N,)."""
    linear = linear_from_srgb(colours / 255.0) * light[:, None]
    return 255.0 * srgb_from_linear(np.minimum(linear, 1.0))


def hemisphere(normals: Floats, count: int, turns: Floats) -> Floats:
    """(N, count, 3) cosine-weighted directions around normals (N, 3), for unweighted means.

    turns : (N,) in [0, 1), rotation of each set about its normal, full turns
    """
    index = np.arange(count) + 0.5
    radius, rise = np.sqrt(index / count), np.sqrt(1.0 - index / count)
    # A golden angle apart (Vogel's spiral): even in the disc, hence cosine-weighted on the hemisphere (Malley).
    angle = 2 * np.pi * (turns[:, None] + 0.618033988749895 * np.arange(count))
    # An orthonormal basis without branches: Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    x, y, z = normals.T
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1)
    second = np.stack([b, sign + y * y * a, -y], axis=1)
    across, along = radius * np.cos(angle), radius * np.sin(angle)
    return np.asarray(
        across[..., None] * first[:, None] + along[..., None] * second[:, None] + rise[:, None] * normals[:, None]
    )


def turns_at(columns: NDArray[np.int64], rows: NDArray[np.int64]) -> Floats:
    """(N,) in [0, 1): interleaved gradient noise of pixels (Jimenez 2014): neighbours differ as much as possible."""
    return np.asarray((52.9829189 * ((0.06711056 * columns + 0.00583715 * rows) % 1.0)) % 1.0)
