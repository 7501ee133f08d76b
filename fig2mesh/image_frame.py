"""Mapping between pixels of the drawing and FIGURE units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.records import Figure
from fig2mesh.skeleton import FIGURE_HEIGHT, JOINT

MAX_ASPECT = 3.0
"""Largest ratio of width to height; wider drawings are scaled by width, or a figure lying down would be 30 m long."""


@dataclass(frozen=True)
class ImageFrame:
    """Mapping between IMAGE and FIGURE (x right, y up, pelvis at the origin, drawn height 1.79 units).

    origin_px : (x, y) of the FIGURE origin in IMAGE pixels
    units_per_px : FIGURE units per pixel
    """

    origin_px: tuple[float, float]
    units_per_px: float

    def figure_from_image(self, points_px: NDArray[Any]) -> NDArray[np.float64]:
        """(..., 2) IMAGE → (..., 2) FIGURE x, y."""
        offset = np.asarray(points_px, np.float64) - self.origin_px
        return offset * (self.units_per_px, -self.units_per_px)

    def image_from_figure(self, points: NDArray[Any]) -> NDArray[np.float64]:
        """(..., 2 or 3) FIGURE → (..., 2) IMAGE."""
        return np.asarray(points, np.float64)[..., :2] / (self.units_per_px, -self.units_per_px) + self.origin_px


def image_frame(figure: Figure) -> ImageFrame:
    """Frame of a figure: its silhouette is 1.79 units high, its pelvis the origin (paper §4.1)."""
    rows, columns = np.flatnonzero(figure.mask.any(axis=1)), np.flatnonzero(figure.mask.any(axis=0))
    drawn_height_px = max(rows[-1] - rows[0] + 1, (columns[-1] - columns[0] + 1) / MAX_ASPECT)
    x, y = figure.joints_px[JOINT["pelvis"]].tolist()
    return ImageFrame((x, y), FIGURE_HEIGHT / float(drawn_height_px))
