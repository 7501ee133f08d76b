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

AT_RIM: Final = 3.0
"""Distance from the rim, windows, within which marks must cover as much: details lie in the middle, patterns go on."""

MIN_RIM: Final = 5.0
"""Least length of an area's rim, windows."""

MIN_MARKS: Final = 8
"""Least number of marks; fewer are details: buttons, a badge, a belt."""

RIM: Final = 0.6
"""Marks nearer than this to the border of what is shown are its contour, windows."""

MIN_STRIPES: Final = 3
"""Least number of stripes of each of two colours."""

MAX_STRIPE: Final = 1.4
"""Largest half width of a stripe, windows."""

MIN_STRIPED: Final = 5.0
"""Edge of the square that striped areas cover at least, windows."""

MIN_PX: Final = 3
"""Least size of a mark, pixels; smaller ones are noise."""


def patterned(
    index: NDArray[np.int_],
    kind: NDArray[np.int_],
    own: NDArray[np.bool_],
    region: NDArray[np.bool_],
    window: float,
) -> NDArray[np.bool_]:
    """(h, w) bool: pixels of areas with marks all over.

    Parameters
    ----------
    index : (h, w) colour of each pixel of the drawing; kind : (h, w) colour of the area that it lies in
    own : (h, w) bool, visible pixels of these areas; region : (h, w) bool, their whole outline
    window : pixels, over which an area's colour dominates
    """
    inner = ndimage.distance_transform_edt(own) > max(RIM * window, 1.0)
    depth = ndimage.distance_transform_edt(np.pad(region, 1))[1:-1, 1:-1]
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
    outer = inner & (depth <= AT_RIM * window)
    chosen = np.ones(total, bool)
    for room in (inner, outer):
        there = np.bincount(areas[room], minlength=total)
        covered = np.bincount(areas[room & near], minlength=total)
        chosen &= covered >= MIN_COVERED * np.maximum(there, 1)
    # An area that does not reach the rim does not go on behind.
    chosen &= np.bincount(areas[outer], minlength=total) >= MIN_RIM * window * (AT_RIM - RIM) * window
    pairs = np.unique(np.stack([areas[marks > 0], marks[marks > 0]]), axis=1)
    chosen &= np.bincount(pairs[0], minlength=total) >= MIN_MARKS
    chosen[0] = False
    return np.asarray(inner & chosen[areas])


def striped(front: NDArray[np.int_], own: NDArray[np.bool_], window: float) -> NDArray[np.bool_]:
    """(h, w) bool: pixels of narrow areas of two colours in turn.

    front : (h, w) colour of each area; own : (h, w) bool, visible pixels; window : pixels, see `patterned`
    """
    stripes: dict[int, NDArray[np.int_]] = {}
    for colour in np.unique(front[own]).tolist():
        areas, count = ndimage.label(own & (front == colour))
        numbers = np.arange(count + 1)
        wide = np.asarray(ndimage.maximum(ndimage.distance_transform_edt(areas > 0), areas, numbers))
        size = np.bincount(areas.ravel(), minlength=count + 1)
        narrow = (wide <= MAX_STRIPE * window) & (size >= window**2)
        narrow[0] = False
        if narrow.sum() >= MIN_STRIPES:
            stripes[colour] = np.where(narrow[areas], areas, 0)
    result = np.zeros_like(own)
    for first in stripes:
        for second in stripes:
            if first != second:
                result |= _in_turn(stripes[first], stripes[second], window)
    pieces, count = ndimage.label(ndimage.binary_closing(result, np.ones((3, 3))) & own)
    large = np.bincount(pieces.ravel(), minlength=count + 1) >= (MIN_STRIPED * window) ** 2
    large[0] = False
    return np.asarray(large[pieces])


def _in_turn(first: NDArray[np.int_], second: NDArray[np.int_], window: float) -> NDArray[np.bool_]:
    """Areas of the first colour that are beside two of the second, and those, if there are enough of both."""
    _, source = ndimage.distance_transform_edt(second == 0, return_indices=True)
    near = ndimage.distance_transform_edt(second == 0) <= 0.5 * window
    at = (first > 0) & near
    pairs = np.unique(np.stack([first[at], second[tuple(source)][at]]), axis=1)
    neighbours = np.bincount(pairs[0], minlength=int(first.max()) + 1) if pairs.size else np.zeros(1)
    between = np.flatnonzero(neighbours >= 2)
    if len(between) < MIN_STRIPES - 1:
        return np.zeros(first.shape, bool)
    beside = np.unique(pairs[1][np.isin(pairs[0], between)])
    if len(beside) < MIN_STRIPES:
        return np.zeros(first.shape, bool)
    return np.asarray(np.isin(first, between) | np.isin(second, beside))


def _areas(kind: NDArray[np.int_], own: NDArray[np.bool_]) -> NDArray[np.int_]:
    """(h, w) number of the area of one colour that each shown pixel lies in, from 1; 0 elsewhere."""
    result = np.zeros(kind.shape, np.int_)
    last = 0
    for colour in np.unique(kind[own]):
        found, count = ndimage.label(own & (kind == colour))
        result = np.where(found > 0, found + last, result)
        last += count
    return result
