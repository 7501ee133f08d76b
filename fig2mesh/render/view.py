"""Position of the camera, the same for all pictures of a turntable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.camera import Camera, axes

MARGIN = 0.05
"""Empty border on each side, share of the picture."""

NEARBY = 2.2
"""Distance of the camera of `perspective`, in heights of the figure: a man at four metres, field of view 30 degrees."""

GROUND_RADIUS = 0.36
"""Radius of the ground's disc, share of the figure's height; at least 1.1 times the extent of the figure."""


@dataclass(frozen=True)
class CameraView:
    """A camera that turns about the vertical axis through the centre of a figure, which never leaves the picture.

    near, far : distances from the camera's plane between which the figure lies
    """

    camera: Camera
    near: float
    far: float


def ground_radius(bounds: NDArray[np.float64]) -> float:
    """Radius of the disc under a figure with these bounds (2, 3)."""
    half = (bounds[1] - bounds[0]) / 2
    return float(max(GROUND_RADIUS * 2 * half[1], 1.1 * np.hypot(half[0], half[2])))


def make_view(
    bounds: Any, size: tuple[int, int], yaw_deg: float, pitch_deg: float, *, nearby: bool, ground: bool
) -> CameraView:
    """Camera for a figure in a box (2, 3); only its direction depends on the yaw.

    nearby : perspective; ground : also show the disc below it
    """
    box = np.asarray(bounds, np.float64)
    half = (box[1] - box[0]) / 2
    radius = float(np.hypot(half[0], half[2]))
    if ground:
        radius = max(radius, ground_radius(box))
    # The upright cylinder around everything that can be visible: its two rims, from this pitch.
    angle = np.linspace(0.0, 2 * np.pi, 181)
    rim = np.stack([radius * np.cos(angle), 0 * angle, radius * np.sin(angle)], axis=1)
    figure = float(np.hypot(half[0], half[2])) / radius
    corners = np.concatenate([rim * (figure, 1, figure) + (0, half[1], 0), rim - (0, half[1], 0)])
    across, up, towards = (corners @ axes(0.0, pitch_deg).T).T
    distance = 2.0 * float(np.hypot(half[1], radius))
    if nearby:
        distance = NEARBY * max(2 * float(half[1]), 2 * radius)
        larger = distance / (distance - towards)
        across, up = across * larger, up * larger
    width, height = size
    shown = 2 * max(float(np.abs(up).max()), float(np.abs(across).max()) * height / width) / (1 - 2 * MARGIN)
    reach = float(towards.max())
    camera = Camera(yaw_deg, pitch_deg, size, shown, box.mean(axis=0), distance, nearby)
    return CameraView(camera, distance - reach, distance + reach)
