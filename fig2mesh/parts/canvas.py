"""The raster on which outlines are split and inflated: the silhouette at working resolution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from fig2mesh.parse.frame import ImageFrame
from fig2mesh.parts.hairlines import thicken
from fig2mesh.records import Figure

CONTOUR_PX = 1024
"""Longest side at which the contour is measured; finer would cost time and add pen jitter."""

MARGIN_PX = 4

HAIR_PX = 0.9
"""Half the width of the thinnest stroke, pixels of the contour's raster."""


@dataclass(frozen=True)
class Canvas:
    """The silhouette on a square raster around the figure.

    sdf : (H, W) float64, signed distance to the drawn contour in FIGURE units, negative inside
    labels : (H, W) uint8, part labels given by the user, 0 elsewhere
    corner : FIGURE x, y of the centre of pixel (0, 0)
    pitch : FIGURE units a pixel
    """

    sdf: NDArray[np.float64]
    labels: NDArray[np.uint8]
    corner: tuple[float, float]
    pitch: float

    @property
    def inside(self) -> NDArray[np.bool_]:
        """(H, W) bool: pixel centres inside the drawn contour."""
        return self.sdf < 0

    def points(self) -> NDArray[np.float64]:
        """(H, W, 2) FIGURE x, y of the pixel centres."""
        height, width = self.sdf.shape
        x = self.corner[0] + self.pitch * np.arange(width)
        y = self.corner[1] - self.pitch * np.arange(height)
        return np.stack(np.meshgrid(x, y), axis=-1)

    def pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., 2+) FIGURE → (..., 2) row, column (fractional; pixel centres are integers)."""
        column = (points[..., 0] - self.corner[0]) / self.pitch
        row = (self.corner[1] - points[..., 1]) / self.pitch
        return np.stack([row, column], axis=-1)

    def sample(self, image: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Bilinear values of a canvas image at (..., 2+) FIGURE points; the border is continued."""
        rows = self.pixels(points)
        flat = ndimage.map_coordinates(image, rows.reshape(-1, 2).T, order=1, mode="nearest")
        return np.asarray(flat).reshape(rows.shape[:-1])


def make_canvas(figure: Figure, frame: ImageFrame, height_px: int, thinnest: float = 0.0) -> Canvas:
    """The silhouette of a figure, resampled so that its longer side has `height_px` pixels.

    Strokes narrower than `thinnest` (FIGURE units) are drawn that wide: a grid could not hold them.

    The contour is located to a fraction of a pixel: distances are measured on the drawing's own raster and
    interpolated, so that a coarse canvas does not turn a slanted outline into stairs.
    """
    mask = figure.mask
    longest = max(mask.shape)
    scale = 1.0
    labels = figure.part_labels
    if longest > CONTOUR_PX:
        scale = CONTOUR_PX / longest
        size = (max(1, round(mask.shape[1] * scale)), max(1, round(mask.shape[0] * scale)))
        cover = Image.fromarray(np.where(mask, np.uint8(255), np.uint8(0))).resize(size, Image.Resampling.BOX)
        labels = np.asarray(Image.fromarray(labels).resize(size, Image.Resampling.NEAREST))
        scale_x, scale_y = size[0] / mask.shape[1], size[1] / mask.shape[0]
        small = np.asarray(cover) >= 128
        mask = small if small.any() else np.asarray(cover) == np.asarray(cover).max()
    else:
        scale_x = scale_y = 1.0
    pad = 2
    mask = np.pad(mask, pad)
    distance = ndimage.distance_transform_edt(~mask) - ndimage.distance_transform_edt(mask)
    distance = ndimage.gaussian_filter(distance - 0.5 * np.sign(distance), 0.7)
    # Smoothing by itself breaks lines of one pixel, hence the least radius.
    strokes, _ = thicken(mask, max(0.5 * thinnest * scale_y / frame.units_per_px, HAIR_PX))
    distance = np.minimum(distance, strokes)

    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    tall, wide = rows[-1] - rows[0] + 1, columns[-1] - columns[0] + 1
    step = max(tall, wide) / height_px
    margin = MARGIN_PX * step
    height, width = (int(np.ceil((length + 2 * margin) / step)) + 1 for length in (tall, wide))
    row = rows[0] - margin + step * np.arange(height)
    column = columns[0] - margin + step * np.arange(width)
    grid = np.meshgrid(row, column, indexing="ij")
    sampled = ndimage.map_coordinates(distance, grid, order=1, mode="nearest")
    # Beyond the measured raster distances only grow; the nearest value would flatten them.
    beyond = np.hypot(*(np.maximum(0, np.maximum(-g, g - (n - 1))) for g, n in zip(grid, mask.shape, strict=True)))
    chosen = ndimage.map_coordinates(np.pad(labels, pad), grid, order=0, mode="constant")

    units_per_px = frame.units_per_px / scale_y
    first = np.array([(column[0] - pad + 0.5) / scale_x, (row[0] - pad + 0.5) / scale_y])
    x, y = frame.figure_from_image(first)
    return Canvas((sampled + beyond) * units_per_px, chosen, (float(x), float(y)), float(step * units_per_px))
