"""Segmentation by colour: a guess corrected by the colours of foreground and background, and guided filters."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.records import BoolArray, FloatArray

BINS: Final = 12
"""Cells per axis of the colour histograms."""


def by_colour(rgb: FloatArray, likely: FloatArray) -> BoolArray:
    """Correct the guess near its outline by the colours of foreground and background and the picture's edges."""
    inside, outside = np.clip((likely - 0.6) / 0.4, 0, 1), np.clip((0.4 - likely) / 0.4, 0, 1)
    cells = (np.clip(rgb, 0, 255) * (BINS / 256)).astype(int)
    flat = (cells[..., 0] * BINS + cells[..., 1]) * BINS + cells[..., 2]
    shares = []
    for weight in (inside, outside):
        count = np.bincount(flat.ravel(), weight.ravel(), BINS**3).reshape(BINS, BINS, BINS)
        smooth = ndimage.gaussian_filter(count, 0.7)
        shares.append(smooth / max(smooth.sum(), 1e-9) + 2e-5)
    colour = np.log(shares[0] / shares[1]).ravel()[flat]
    prior = np.log(np.clip(likely, 0.01, 0.99) / np.clip(1 - likely, 0.01, 0.99))
    both = 1 / (1 + np.exp(-(prior + 0.45 * np.clip(colour, -3, 3))))
    side = max(likely.shape)
    smooth = guided((rgb / 255).astype(np.float32), both.astype(np.float32), max(2, side // 90), 2e-3)
    mask = (smooth > 0.5) & (likely > 0.04)
    return tidy(mask, likely)


def tidy(mask: BoolArray, likely: FloatArray) -> BoolArray:
    """Remove small or unlikely pieces of a mask, and fill small or likely holes."""
    regions, count = ndimage.label(mask)
    if not count:
        return likely > 0.5
    index = np.arange(1, count + 1)
    size, mean = ndimage.sum_labels(mask, regions, index), ndimage.mean(likely, regions, index)
    mask = np.isin(regions, index[(size > 0.01 * mask.sum()) & (mean > 0.4)]) if count > 1 else mask
    holes, count = ndimage.label(~mask)
    if not count:
        return np.asarray(mask)
    index = np.arange(1, count + 1)
    size, mean = ndimage.sum_labels(~mask, holes, index), ndimage.mean(likely, holes, index)
    fill = index[(mean > 0.45) | (size < 1e-4 * mask.size)]
    return np.asarray(mask | np.isin(holes, fill))


def guided(guide: FloatArray, values: FloatArray, radius: int, softness: float) -> FloatArray:
    """Guided filter: `values` (H, W) smoothed so that it follows the edges of `guide` (H, W, 3), both 0-1.

    Each window's values are a linear function of its colours (He, Sun, Tang 2013, equation 19).
    """

    def mean(field: NDArray[Any]) -> NDArray[np.float64]:
        return np.asarray(ndimage.uniform_filter(field, (2 * radius + 1,) * 2, mode="nearest"), np.float64)

    channels = [guide[..., i].astype(np.float64) for i in range(3)]
    means = [mean(channel) for channel in channels]
    middle = mean(values)
    r, g, b = (mean(c * values) - m * middle for c, m in zip(channels, means, strict=True))
    s = {
        (i, j): mean(channels[i] * channels[j]) - means[i] * means[j] + (softness if i == j else 0.0)
        for i in range(3)
        for j in range(i, 3)
    }
    # The inverse of a symmetric 3 × 3 matrix by cofactors.
    c00, c01 = s[1, 1] * s[2, 2] - s[1, 2] ** 2, s[0, 2] * s[1, 2] - s[0, 1] * s[2, 2]
    c02, c11 = s[0, 1] * s[1, 2] - s[0, 2] * s[1, 1], s[0, 0] * s[2, 2] - s[0, 2] ** 2
    c12, c22 = s[0, 1] * s[0, 2] - s[0, 0] * s[1, 2], s[0, 0] * s[1, 1] - s[0, 1] ** 2
    scale = 1 / (s[0, 0] * c00 + s[0, 1] * c01 + s[0, 2] * c02)
    slope = (
        (c00 * r + c01 * g + c02 * b) * scale,
        (c01 * r + c11 * g + c12 * b) * scale,
        (c02 * r + c12 * g + c22 * b) * scale,
    )
    shift = middle - sum(a * m for a, m in zip(slope, means, strict=True))
    out = mean(shift) + sum(mean(a) * c for a, c in zip(slope, channels, strict=True))
    return np.asarray(out, np.float32)


def grown(mask: BoolArray, radius: int) -> BoolArray:
    """Dilate a mask by a number of pixels."""
    if radius == 0:
        return mask
    return np.asarray(ndimage.distance_transform_edt(~mask) <= radius) if mask.any() else mask


def reduced(picture: FloatArray, step: int) -> FloatArray:
    """Downsample: means of step × step pixels."""
    if step == 1:
        return picture
    height, width = (length // step * step for length in picture.shape[:2])
    cut = picture[:height, :width]
    return np.asarray(cut.reshape(height // step, step, width // step, step, -1).mean(axis=(1, 3)), np.float32)
