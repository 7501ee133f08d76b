"""Gradients and shades within materials: differences from the material's colour, continued like the materials."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.texture.diffusion import diffused

BLUR: Final = 0.015
"""Standard deviation of the average over a drawing's own pixels, FIGURE units."""


MAX_TINT: Final = 30.0
"""Largest difference from a material's colour, RGB 0-255."""

MIN_WEIGHT: Final = 0.1
"""Least share of a material's own pixels in the average."""


def drawn_tints(
    picture: NDArray[np.float32],
    index: NDArray[np.int_],
    clear: NDArray[np.bool_],
    front: NDArray[np.int_],
    colour: NDArray[np.float32],
    flat: NDArray[np.bool_],
    pitch: float,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """(H, W, 3) mean difference of the pixels of each area's material from its colour; and where it is known.

    Parameters
    ----------
    picture : (H, W, 3) 0-255; index : (H, W) material of each pixel; clear : (H, W) bool, pixels that count
    front : (H, W) material of the areas; colour : (K, 3); flat : (K,) bool, materials of one colour; pitch : FIGURE
        units per pixel
    """
    result = np.zeros((*front.shape, 3))
    known = flat[front] & clear
    for k in np.unique(front[~flat[front]]):
        own = (clear & (index == k)).astype(np.float64)
        weight = ndimage.gaussian_filter(own, BLUR / pitch)
        there = (front == k) & (weight > MIN_WEIGHT)
        for channel in range(3):
            difference = own * (picture[..., channel] - colour[k, channel])
            mean = ndimage.gaussian_filter(difference, BLUR / pitch) / np.maximum(weight, 1e-9)
            result[there, channel] = np.clip(mean[there], -MAX_TINT, MAX_TINT)
        known |= there
    return result, known


def continued_tints(
    tints: NDArray[np.float64], fixed: NDArray[np.bool_], region: NDArray[np.bool_], index: NDArray[np.int_]
) -> NDArray[np.float64]:
    """(H, W, 3) tints diffused from the fixed pixels within each area of one material; 0 in areas without any."""
    if not np.abs(tints[fixed & region]).max(initial=0.0) > 0.5:
        return np.zeros_like(tints)
    result = diffused(region, fixed, tints, apart=index)
    for k in np.unique(index[region]):
        pieces, count = ndimage.label(region & (index == k))
        without = np.bincount(pieces[fixed & region], minlength=count + 1) == 0
        without[0] = False
        result[without[pieces]] = 0.0
    return result
