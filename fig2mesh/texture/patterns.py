"""Detection of areas with patterns: dots, checks, stripes, hatching, folds. They continue on the sides not drawn."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

REACH: Final = 1.5
"""Radius, windows, of the area covered by a mark."""

MIN_COVERED: Final = 0.7
"""Least share of an area covered by marks."""

MIN_MARKS: Final = 6
"""Least number of marks; fewer are details: buttons, a badge, a belt."""

RIM: Final = 0.6
"""Marks nearer than this to the border of what is shown are its contour, windows."""

MIN_PX: Final = 3
"""Least size of a mark, pixels; smaller ones are noise."""


def patterned(
    index: NDArray[np.int_], kind: NDArray[np.int_], own: NDArray[np.bool_], window: float
) -> NDArray[np.bool_]:
    """(h, w) bool: pixels of areas with marks all over.

    Parameters
    ----------
    index : (h, w) palette colour of each pixel of the drawing; kind : (h, w) colour of the area that it lies in
    own : (h, w) bool, visible pixels of these areas; window : pixels, over which an area's colour dominates
    """
    inner = ndimage.distance_transform_edt(own) > max(RIM * window, 1.0)
    areas = _areas(kind, own)
    marks, count = ndimage.label(inner & (index != kind), np.ones((3, 3)))
    if not count:
        return np.zeros_like(own)
    size = np.bincount(marks.ravel())
    size[0] = 0
    marks[size[marks] < MIN_PX] = 0
    # A mark belongs to the area in which most of it lies; areas' own borders are not marks.
    near = ndimage.distance_transform_edt(marks == 0) <= REACH * window
    total = int(areas.max()) + 1
    room = np.bincount(areas[inner], minlength=total)
    covered = np.bincount(areas[inner & near], minlength=total)
    pairs = np.unique(np.stack([areas[marks > 0], marks[marks > 0]]), axis=1)
    number = np.bincount(pairs[0], minlength=total)
    chosen = (covered >= MIN_COVERED * np.maximum(room, 1)) & (number >= MIN_MARKS)
    chosen[0] = False
    return np.asarray(inner & chosen[areas])


def _areas(kind: NDArray[np.int_], own: NDArray[np.bool_]) -> NDArray[np.int_]:
    """(h, w) number of the area of one colour that each shown pixel lies in, from 1; 0 elsewhere."""
    result = np.zeros(kind.shape, np.int_)
    last = 0
    for colour in np.unique(kind[own]):
        found, count = ndimage.label(own & (kind == colour))
        result = np.where(found > 0, found + last, result)
        last += count
    return result
