"""Body texture space: pictures of what cameras see, spread out by their texture coordinates (Grigorev et al. 2019)."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

SIZE: Final = 128
"""Texels of an edge: four pictures of 256 x 256 pixels cover nearly all that a body has of that many."""


def spread(
    uv: NDArray[np.floating], values: NDArray[np.floating], weights: NDArray[np.floating], size: int = SIZE
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Weighted means of values in the texels that they fall into.

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
