"""Raster around a layer on which its colours are continued, between the canvas of its outline and a picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fig2mesh.image_frame import ImageFrame
from fig2mesh.parts.canvas import Canvas

PITCH: Final = 0.004
"""Spacing of the raster, FIGURE units: half a thin contour."""

MARGIN: Final = 8
"""Pixels around the layer."""


@dataclass(frozen=True)
class LayerWindow:
    """Raster of square pixels of `PITCH`.

    corner : FIGURE x, y of the centre of its first pixel; shape : rows and columns
    rows, columns : position of each row and column in a picture, pixels with centres at whole numbers
    """

    corner: tuple[float, float]
    shape: tuple[int, int]
    rows: NDArray[np.float64]
    columns: NDArray[np.float64]

    def points(self) -> NDArray[np.float64]:
        """(H, W, 2) FIGURE x, y of the pixel centres."""
        x = self.corner[0] + PITCH * np.arange(self.shape[1])
        y = self.corner[1] - PITCH * np.arange(self.shape[0])
        return np.stack(np.meshgrid(x, y), axis=-1)

    def of_canvas(self, image: NDArray[np.generic], canvas: Canvas, outside: int = 0) -> NDArray[np.generic]:
        """Nearest pixels of an image of the canvas."""
        row, column = _nearest(self._on(canvas))
        inside = np.logical_and.outer(_within(row, image.shape[0]), _within(column, image.shape[1]))
        taken = image[np.ix_(np.clip(row, 0, image.shape[0] - 1), np.clip(column, 0, image.shape[1] - 1))]
        return np.where(inside, taken, np.array(outside, image.dtype))

    def _on(self, canvas: Canvas) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        row = (canvas.corner[1] - self.corner[1]) / canvas.pitch + np.arange(self.shape[0]) * (PITCH / canvas.pitch)
        column = (self.corner[0] - canvas.corner[0]) / canvas.pitch + np.arange(self.shape[1]) * (PITCH / canvas.pitch)
        return np.asarray(row, np.float64), np.asarray(column, np.float64)

    def of_picture(self, image: NDArray[np.generic]) -> NDArray[np.generic]:
        """Nearest pixels of a picture, continued by its border."""
        row, column = _nearest((self.rows, self.columns))
        return image[np.ix_(np.clip(row, 0, image.shape[0] - 1), np.clip(column, 0, image.shape[1] - 1))]

    def reach(self, shape: tuple[int, ...]) -> tuple[slice, slice]:
        """Pixels of a picture of this shape that the window covers, at least one."""
        spans = []
        for places, size in zip((self.rows, self.columns), shape, strict=False):
            start = int(np.clip(np.ceil(places[0]), 0, size - 1))
            spans.append(slice(start, int(np.clip(np.floor(places[-1]) + 1, start + 1, size))))
        return spans[0], spans[1]

    def to_picture(self, image: NDArray[np.float64], reach: tuple[slice, slice]) -> NDArray[np.float32]:
        """(h, w) bilinear values of an image of the window at pixels of a picture."""
        first = _weights(self.rows, reach[0])
        second = _weights(self.columns, reach[1])
        lower, upper, share = first
        rows = image[lower] * (1 - share)[:, None] + image[upper] * share[:, None]
        lower, upper, share = second
        return np.asarray(rows[:, lower] * (1 - share) + rows[:, upper] * share, np.float32)


def window_around(region: NDArray[np.bool_], canvas: Canvas, frame: ImageFrame, factor: int) -> LayerWindow:
    """Window around a region of the canvas.

    factor : IMAGE pixels per pixel of the picture
    """
    rows, columns = np.flatnonzero(region.any(axis=1)), np.flatnonzero(region.any(axis=0))
    extent = canvas.pitch * np.array([np.ptp(rows) + 1, np.ptp(columns) + 1])
    height, width = (int(np.ceil(length / PITCH)) + 2 * MARGIN for length in extent)
    x = canvas.corner[0] + canvas.pitch * float(columns[0]) - PITCH * MARGIN
    y = canvas.corner[1] - canvas.pitch * float(rows[0]) + PITCH * MARGIN
    step = PITCH / (frame.units_per_px * factor)
    start = frame.image_from_figure(np.array([x, y])) / factor - 0.5
    return LayerWindow((x, y), (height, width), start[1] + step * np.arange(height), start[0] + step * np.arange(width))


def _nearest(
    places: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    return np.round(places[0]).astype(int), np.round(places[1]).astype(int)


def _within(places: NDArray[np.int_], size: int) -> NDArray[np.bool_]:
    return np.asarray((places >= 0) & (places < size))


def _weights(
    places: NDArray[np.float64], reach: slice
) -> tuple[NDArray[np.int_], NDArray[np.int_], NDArray[np.float64]]:
    """Indices before and after pixels of a picture in evenly spaced places, and the share of the latter."""
    step = (places[-1] - places[0]) / max(len(places) - 1, 1)
    at = (np.arange(reach.start, reach.stop) - places[0]) / max(float(step), 1e-9)
    at = np.clip(at, 0, len(places) - 1)
    lower = np.floor(at).astype(int)
    return lower, np.minimum(lower + 1, len(places) - 1), at - lower
