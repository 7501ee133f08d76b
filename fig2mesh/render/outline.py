"""Ink lines where neighbouring rays meet different things."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

STEP = 0.012
"""A pixel's point so far off the plane of its neighbour's lies on another surface; share of the figure's height."""

CREASE_COSINE = 0.5
"""Surfaces that turn by more than 60 degrees from one pixel to the next have a crease there."""

JOINT_COSINE = 0.94
"""Where parts meet 20 degrees are enough. Parts of one limb overlap and share their surface: no line belongs there,
and it would be a scribble, as either part may be the one that is met."""

SPECK = 10.0
"""Pieces of a line with fewer pixels are left out, widths."""


def ink_cover(
    kinds: NDArray[np.int16],
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    pixel: float,
    height: float,
    width: float,
) -> NDArray[np.float64]:
    """(H, W) share of each pixel that lines cover.

    kinds : (H, W) what is seen; 0 is nothing
    points, normals : (H, W, 3) of the surface where there is one
    pixel, height : of a pixel, of the figure, in the units of the points
    width : of the line, pixels; half of it on either side of the border
    """
    beside = np.zeros(kinds.shape, bool)
    for axis in (0, 1):
        first = tuple(slice(None, -1) if i == axis else slice(None) for i in (0, 1))
        second = tuple(slice(1, None) if i == axis else slice(None) for i in (0, 1))
        both = (kinds[first] > 0) & (kinds[second] > 0)
        border = (kinds[first] > 0) != (kinds[second] > 0)
        a, b = normals[first][both], normals[second][both]
        way = points[second][both] - points[first][both]
        # Off the tangent plane: on a round limb seen at its rim depth changes fast, but along the plane.
        off = np.maximum(np.abs((way * a).sum(axis=1)), np.abs((way * b).sum(axis=1)))
        bend = np.where(kinds[first][both] == kinds[second][both], CREASE_COSINE, JOINT_COSINE)
        border[both] = (off > max(STEP * height, 2 * pixel)) | ((a * b).sum(axis=1) < bend)
        beside[first] |= border
        beside[second] |= border
    # Specks are no lines.
    pieces, _ = ndimage.label(beside, np.ones((3, 3)))
    beside &= np.bincount(pieces.ravel())[pieces] >= SPECK * width
    if not beside.any():
        return np.zeros(kinds.shape)
    return np.asarray(np.clip(width / 2 - ndimage.distance_transform_edt(~beside), 0.0, 1.0))
