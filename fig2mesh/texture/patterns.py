"""Areas that a drawing covers with marks: dots, checks, stripes, hatching, folds. They go on where it does not show."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

REACH: Final = 1.5
"""A mark covers what is within this many windows of it."""

COVERED: Final = 0.7
"""Share of an area that must be covered by marks."""

LEAST_MARKS: Final = 6
"""Fewer marks are details: buttons, a badge, a belt."""

RIM: Final = 0.6
"""Marks this near to the border of what is shown are its contour, windows."""

LEAST_PX: Final = 3
"""Smaller marks are noise, pixels."""


def patterned(
    index: NDArray[np.int_], kind: NDArray[np.int_], own: NDArray[np.bool_], window: float
) -> NDArray[np.bool_]:
    """(h, w) bool: pixels of areas with marks all over.

    Parameters
    ----------
    index : (h, w) palette colour of each pixel of the drawing; kind : (h, w) colour of the area that it lies in
    own : (h, w) bool, where the drawing shows these areas; window : pixels over which an area's colour dominates
    """
    inner = ndimage.distance_transform_edt(own) > max(RIM * window, 1.0)
    areas = _areas(kind, own)
    marks, count = ndimage.label(inner & (index != kind), np.ones((3, 3)))
    if not count:
        return np.zeros_like(own)
    size = np.bincount(marks.ravel())
    size[0] = 0
    marks[size[marks] < LEAST_PX] = 0
    # A mark belongs to the area in which most of it lies; areas' own borders are not marks.
    near = ndimage.distance_transform_edt(marks == 0) <= REACH * window
    total = int(areas.max()) + 1
    room = np.bincount(areas[inner], minlength=total)
    covered = np.bincount(areas[inner & near], minlength=total)
    pairs = np.unique(np.stack([areas[marks > 0], marks[marks > 0]]), axis=1)
    number = np.bincount(pairs[0], minlength=total)
    chosen = (covered >= COVERED * np.maximum(room, 1)) & (number >= LEAST_MARKS)
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
