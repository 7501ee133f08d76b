"""Frame of a drawn head: its axis, its size and where its face looks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.split import head_radius
from fig2mesh.skeleton import JOINT

MIN_BONE = 0.5
"""Least drawn length of the neck relative to the head's radius, below which it has no direction: heads are upright."""

CHIN = 0.75
"""Distance of the chin from the middle of the head, share of that of the neck; see `CHIN_RADII`."""

CHIN_RADII = (0.9, 1.5)
"""Bounds of the chin's distance from the middle of the head, radii of the head."""

FRONTAL = (0.3, 0.6)
"""Distance of the eyes from the axis up to which a face looks at the viewer, and from which it does not, radii."""

AWAY = 0.3
"""Least distance of the eyes behind the middle of a head that is seen from behind, radii of the head."""

PROFILE = 0.5
"""Least distance of the eyes from the axis of a head in profile, radii of the head."""


@dataclass(frozen=True)
class HeadFrame:
    """Head in the drawing; coordinates along and across its axis are in FIGURE units from its middle.

    middle : (2,) float64, FIGURE x, y
    up : (2,) float64, unit vector from the neck to the crown
    radius : half width, FIGURE units
    chin : height of the chin, negative
    eyes : (across, along) the axis
    facing : 1 where the face looks at the viewer, 0 in profile, -1 where it looks away
    """

    middle: NDArray[np.float64]
    up: NDArray[np.float64]
    radius: float
    chin: float
    eyes: tuple[float, float]
    facing: float = 1.0

    @property
    def looks(self) -> int:
        """-1 or 1: side to which a head in profile looks; 0: not in profile."""
        return int(np.sign(self.eyes[0])) if abs(self.eyes[0]) > PROFILE * self.radius else 0

    @property
    def right(self) -> NDArray[np.float64]:
        """(2,) unit vector across the axis, to the viewer's right where the head is upright."""
        return np.array([self.up[1], -self.up[0]])

    def coordinates(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Coordinates of FIGURE points (..., 2) across and along the axis."""
        offset = points - self.middle
        return np.asarray(offset @ self.right), np.asarray(offset @ self.up)

    def points(self, across: NDArray[np.float64], along: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., 2) FIGURE points with these coordinates."""
        return np.asarray(self.middle + across[..., None] * self.right + along[..., None] * self.up)


def head_frame(canvas: Canvas, joints: NDArray[np.float64]) -> HeadFrame:
    """Frame of the head of (21, 3) FIGURE joints."""
    middle, neck, eyes = (joints[JOINT[name], :2] for name in ("head", "neck", "eyes"))
    radius = head_radius(canvas, joints)
    bone = middle - neck
    length = float(np.linalg.norm(bone))
    up = bone / length if length > MIN_BONE * radius else np.array([0.0, 1.0])
    chin = -float(np.clip(CHIN * length, CHIN_RADII[0] * radius, CHIN_RADII[1] * radius))
    offset = eyes - middle
    across, along = float(offset @ [up[1], -up[0]]), float(offset @ up)
    turned = (FRONTAL[1] - abs(across) / radius) / (FRONTAL[1] - FRONTAL[0])
    away = joints[JOINT["eyes"], 2] - joints[JOINT["head"], 2] < -AWAY * radius
    facing = float(np.clip(turned, 0.0, 1.0)) * (-1.0 if away else 1.0)
    return HeadFrame(middle, up, radius, chin, (across, along), facing)
