"""Colours of a surface from four painted sides, blended by the normal: the paper's own way (§4.4, appendices B and C).

The front is the drawing. Left, back and right are painted by the texture networks; where several sides show a point,
each counts the more, the more directly it looks at it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.field.camera import VIEW_YAW_DEG, axes

POWER: Final = 2.0
"""Exponent of the cosine between normal and view in the weight of a side."""

MAX_GAP: Final = 0.03
"""Largest distance behind what a side shows at which it shows a point, FIGURE units."""

UNSEEN: Final = 1e-3
"""Weight of a side that does not show a point, relative to one that does: decides only where none does."""


@dataclass(frozen=True)
class BlendedSides:
    """Pictures of a body from front, left, back and right.

    pictures : (4, H, W, 3) float32, sRGB 0-255, continued beyond the body
    depth : (4, H, W) float32, VIEW z, FIGURE units, -inf where nothing is visible
    centre : (3,) FIGURE, in the middle of all pictures; pitch : (4,) FIGURE units per pixel
    """

    pictures: NDArray[np.float32]
    depth: NDArray[np.float32]
    centre: NDArray[np.float64]
    pitch: tuple[float, ...]

    def colours(self, points: NDArray[np.floating], normals: NDArray[np.floating]) -> NDArray[np.float64]:
        """(N, 3) sRGB 0-255 at points (N, 3) with unit normals (N, 3), FIGURE."""
        total, weight = np.zeros((len(points), 3)), np.zeros((len(points), 1))
        size = self.pictures.shape[1]
        for side, yaw in enumerate(VIEW_YAW_DEG.values()):
            right, up, back = axes(yaw)
            flat = (points - self.centre) @ np.stack([right, -up], axis=1) / self.pitch[side] + size / 2 - 0.5
            where = [flat[:, 1], flat[:, 0]]
            near = self.depth[side][tuple(np.clip(np.round(where).astype(int), 0, size - 1))]
            shown = points @ back >= near - MAX_GAP
            facing = np.maximum(normals @ back, 1e-3) ** POWER
            own = (facing * np.where(shown, 1.0, UNSEEN))[:, None]
            picture = self.pictures[side]
            total += own * np.stack(
                [ndimage.map_coordinates(picture[..., c], where, order=1, mode="nearest") for c in range(3)], axis=1
            )
            weight += own
        return np.asarray(total / weight)
