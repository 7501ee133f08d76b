"""Thickening of strokes too thin for the grids, so that they neither vanish nor break."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

EIGHT = np.ones((3, 3))


def thicken(mask: NDArray[np.bool_], radius: float) -> NDArray[np.float64]:
    """Distance to the middle lines of everything thinner than `radius` pixels from middle to rim.

    Corners are thin at their tips too, and are left unchanged. Strokes are the residues of a morphological opening that
    join two pieces or are longer than they are wide.

    Returns
    -------
    (H, W) float64, pixels to the nearest middle line minus `radius`: negative where a stroke should be; infinite
    everywhere where there are no strokes
    """
    from skimage.morphology import skeletonize

    none = np.full(mask.shape, np.inf)
    # Distances run between pixel centres; a line of one pixel is half a pixel deep.
    depth = ndimage.distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1] - 0.5
    core = depth > radius
    opened = ndimage.distance_transform_edt(~core) <= radius + 0.5 if core.any() else np.zeros_like(mask)
    residue, count = ndimage.label(mask & ~opened, EIGHT)
    if not count:
        return none
    pieces, _ = ndimage.label(opened, EIGHT)
    long = np.bincount(residue.ravel(), minlength=count + 1) >= (4.0 * radius) ** 2
    strokes = np.zeros(count + 1, bool)
    for index, window in enumerate(ndimage.find_objects(residue), start=1):
        around = tuple(slice(max(0, s.start - 1), s.stop + 1) for s in window)
        here = ndimage.binary_dilation(residue[around] == index, EIGHT)
        joined = np.unique(pieces[around][here])
        strokes[index] = long[index] or (joined > 0).sum() > 1 or not (joined > 0).any()
    middle = skeletonize(mask) & strokes[residue]
    if not middle.any():
        return none
    return np.asarray(ndimage.distance_transform_edt(~middle) - radius)
