"""Raster on which outlines are split and inflated: the silhouette at working resolution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from fig2mesh.image_frame import ImageFrame
from fig2mesh.parts.hairlines import thicken
from fig2mesh.records import Figure

CONTOUR_PX = 1024
"""Pictures are reduced to between this and twice this many pixels; finer would cost time and add pen jitter."""

MIN_CONTOUR_PX = 256
"""Smaller pictures are enlarged first: a limb of two pixels is still a limb."""

MARGIN_PX = 4

PINHOLE = 0.005
"""Holes that are smaller than a square of this side are filled, share of the figure's longer side."""

HAIR_PX = 0.9
"""Least half width of a stroke, pixels of the contour's raster."""

MIN_STROKE_WIDTH = 1.4
"""Least width of a stroke, nodes of the part grids and pixels of the canvas. At 0.9 limbs of one drawn
pixel fell into dozens of beads: with a radius of less than 0.6 of a node's distance, a slanted tube passes between."""


@dataclass(frozen=True)
class Canvas:
    """Silhouette on a raster of square pixels around the figure.

    sdf : (H, W) float64, signed distance to the drawn contour in FIGURE units, negative inside
    labels : (H, W) uint8, part labels given by the user, 0 elsewhere
    corner : FIGURE x, y of the centre of pixel (0, 0)
    pitch : FIGURE units per pixel
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
        """Bilinear values of a canvas image at (..., 2+) FIGURE points; extrapolated by the border."""
        rows = self.pixels(points)
        flat = ndimage.map_coordinates(image, rows.reshape(-1, 2).T, order=1, mode="nearest")
        return np.asarray(flat).reshape(rows.shape[:-1])


def make_canvas(figure: Figure, frame: ImageFrame, longest_px: int, voxel: float = 0.0) -> Canvas:
    """Silhouette of a figure, resampled so that its longer side has `longest_px` pixels.

    Strokes too thin for the canvas, or for part grids of spacing `voxel` (FIGURE units), are drawn `MIN_STROKE_WIDTH`
    times as wide as the coarser of the two.

    The contour is located to a fraction of a pixel: distances are measured on a raster of `CONTOUR_PX` and
    interpolated, so that a coarse canvas does not turn a slanted outline into stairs.
    """
    pad = 2
    mask = np.pad(figure.mask, pad)
    cover, scale = _contour_raster(mask)
    solid = cover >= 0.5
    if not solid.any():
        solid = cover >= cover.max()
    solid = _without_pinholes(solid)
    distance = ndimage.gaussian_filter(raster_distance(solid), 0.7)
    rows, columns = np.flatnonzero(solid.any(axis=1)), np.flatnonzero(solid.any(axis=0))
    tall, wide = rows[-1] - rows[0] + 1, columns[-1] - columns[0] + 1
    step = max(tall, wide) / longest_px
    units = frame.units_per_px / scale
    # Smoothing by itself breaks lines of one pixel, hence the minimum radius.
    distance = np.minimum(distance, thicken(solid, max(0.5 * MIN_STROKE_WIDTH * max(voxel / units, step), HAIR_PX)))
    margin = MARGIN_PX * step
    height, width = (int(np.ceil((length + 2 * margin) / step)) + 1 for length in (tall, wide))
    row = rows[0] - margin + step * np.arange(height)
    column = columns[0] - margin + step * np.arange(width)
    grid = np.meshgrid(row, column, indexing="ij")
    sampled = ndimage.map_coordinates(distance, grid, order=1, mode="nearest")
    # Beyond the measured raster distances only grow; the nearest value would flatten them.
    beyond = np.hypot(*(np.maximum(0, np.maximum(-g, g - (n - 1))) for g, n in zip(grid, solid.shape, strict=True)))
    source = [(g + 0.5) / scale - 0.5 for g in grid]
    labels = ndimage.map_coordinates(np.pad(figure.part_labels, pad), source, order=0, mode="constant")
    first = np.array([(column[0] + 0.5) / scale - pad, (row[0] + 0.5) / scale - pad])
    x, y = frame.figure_from_image(first)
    return Canvas((sampled + beyond) * units, labels, (float(x), float(y)), float(step * units))


def raster_distance(region: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Signed distance to the edges of pixels, pixels, negative inside."""
    distance = ndimage.distance_transform_edt(~region) - ndimage.distance_transform_edt(region)
    return np.asarray(distance - 0.5 * np.sign(distance))


def _without_pinholes(solid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Fill holes of a few pixels: they are faults of a mask, and solids would have tunnels there."""
    holes, count = ndimage.label(~solid)
    sizes = np.bincount(holes.ravel(), minlength=count + 1)
    limit = (PINHOLE * max(np.ptp(np.nonzero(solid), axis=1))) ** 2
    small = sizes <= limit
    small[0] = False
    return np.asarray(solid | small[holes])


def _contour_raster(mask: NDArray[np.bool_]) -> tuple[NDArray[np.float32], float]:
    """Coverage of the silhouette on a raster fine enough to measure, and its pixels per pixel of the mask.

    The factor is whole (or one over a whole number), so that it is the same in both directions.
    """
    longest = max(mask.shape)
    if longest >= 2 * CONTOUR_PX:
        factor = longest // CONTOUR_PX
        image = Image.fromarray(np.where(mask, np.uint8(255), np.uint8(0))).reduce(factor)
        # The last row and column may be cut short; the padding of the mask is wider than what is lost there.
        return np.asarray(image, np.float32) / 255.0, 1.0 / factor
    factor = -(-MIN_CONTOUR_PX // longest)
    if factor == 1:
        return mask.astype(np.float32), 1.0
    axes = [(np.arange(length * factor) + 0.5) / factor - 0.5 for length in mask.shape]
    grid = np.meshgrid(*axes, indexing="ij")
    return np.asarray(ndimage.map_coordinates(mask.astype(np.float32), grid, order=1, mode="nearest")), float(factor)
