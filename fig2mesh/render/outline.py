"""Ink lines between neighbouring pixels that show different surfaces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

STEP = 0.012
"""Distance from the tangent plane of the neighbouring pixel beyond which a point lies on another surface; share of the
figure's height."""

CREASE_COSINE = 0.5
"""Cosine of the angle between neighbouring normals, 60 degrees, beyond which there is a crease."""

JOINT_COSINE = 0.94
"""The same where parts meet: 20 degrees. A border of parts alone makes no line: parts of one limb overlap and share
their surface, and either may be hit there."""

SPECK = 10.0
"""Minimum number of pixels of a piece of a line, in line widths."""


def ink_cover(
    kinds: NDArray[np.int16],
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    pixel: float,
    height: float,
    width: float,
) -> NDArray[np.float64]:
    """(H, W) share of each pixel that lines cover.

    kinds : (H, W) label of the visible surface; 0 for none
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
        # Distance from the tangent plane: at the rim of a round limb depth changes fast, but along the plane.
        off = np.maximum(np.abs((way * a).sum(axis=1)), np.abs((way * b).sum(axis=1)))
        bend = np.where(kinds[first][both] == kinds[second][both], CREASE_COSINE, JOINT_COSINE)
        border[both] = (off > max(STEP * height, 2 * pixel)) | ((a * b).sum(axis=1) < bend)
        beside[first] |= border
        beside[second] |= border
    # Drop specks.
    pieces, _ = ndimage.label(beside, np.ones((3, 3)))
    beside &= np.bincount(pieces.ravel())[pieces] >= SPECK * width
    if not beside.any():
        return np.zeros(kinds.shape)
    return np.asarray(np.clip(width / 2 - ndimage.distance_transform_edt(~beside), 0.0, 1.0))
