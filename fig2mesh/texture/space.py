"""Body texture space: camera pictures resampled by their texture coordinates (Grigorev et al. 2019)."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

SIZE: Final = 128
"""Texels per edge: four pictures of 256 x 256 pixels cover nearly all texels of a body at that size."""

INNER_PX: Final = 5.0
"""Distance inside a side's silhouette from which pixels have full weight: at the rim is the contour, at a slant."""


def inwards(inside: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(..., H, W) distance of each pixel of pictures to the outside of its silhouette, pixels; 0 outside."""
    flat = inside.reshape(-1, *inside.shape[-2:])
    away = [ndimage.distance_transform_edt(np.pad(side, 1))[1:-1, 1:-1] for side in flat]
    return np.stack(away).reshape(inside.shape)


def shown_alike(labels: NDArray[np.uint8], places: NDArray[np.floating]) -> NDArray[np.bool_]:
    """(4, H, W) bool: the front shows the same part at the location of each pixel's point.

    labels : (4, H, W) parts, the front first; places : (4, H, W, 2) in the front picture, edges at -1 and 1
    """
    size = labels.shape[1]
    pixel = np.clip(((places + 1) / 2 * size).astype(int), 0, size - 1)
    return np.asarray(labels[0][pixel[..., 1], pixel[..., 0]] == labels)


def trust(inner: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights of pixels by their distance inside the silhouette."""
    return np.clip(inner / INNER_PX, 0.05, 1.0)


def spread(
    uv: NDArray[np.floating], values: NDArray[np.floating], weights: NDArray[np.floating], size: int = SIZE
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Splat values: weighted means in the texels that they fall into.

    Parameters
    ----------
    uv : (N, 2) texture coordinates in [0, 1]; row 0 of the texture is v = 0
    values : (N, C); weights : (N,) not negative

    Returns
    -------
    (size, size, C) float32, zeros where nothing falls, and (size, size) float32, sums of weights
    """
    cell = np.clip((np.asarray(uv, np.float64) * size).astype(np.int64), 0, size - 1)
    index = cell[:, 1] * size + cell[:, 0]
    total = np.bincount(index, weights, size * size)
    sums = np.stack([np.bincount(index, weights * column, size * size) for column in np.asarray(values).T], axis=1)
    means = sums / np.maximum(total, 1e-9)[:, None]
    return means.reshape(size, size, -1).astype(np.float32), total.reshape(size, size).astype(np.float32)
