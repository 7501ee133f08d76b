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

MIN_MARKED: Final = 0.18
"""Least share of an area that its marks take up: lines of a placket or of folds take less."""

MIN_STRIPES: Final = 3
"""Least number of stripes of one colour."""

MIN_TURN: Final = 0.22
"""Least share of each of two colours nearby where they are in turn."""

MIN_STRIPED: Final = 2.0
"""Least half width of an area of stripes, windows: at a plain border two colours are near too."""

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
    marked = np.bincount(areas[inner & (marks > 0)], minlength=total)
    chosen &= marked >= MIN_MARKED * np.bincount(areas[inner], minlength=total)
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
    result = np.zeros_like(own)
    inside = np.maximum(ndimage.gaussian_filter(own.astype(np.float32), 1.5 * window), 1e-3)
    share = {
        colour: ndimage.gaussian_filter((own & (front == colour)).astype(np.float32), 1.5 * window) / inside
        for colour in np.unique(front[own]).tolist()
    }
    for first in share:
        for second in share:
            if first >= second:
                continue
            zone = own & (share[first] > MIN_TURN) & (share[second] > MIN_TURN)
            zone &= (front == first) | (front == second)
            pieces, count = ndimage.label(zone)
            if not count:
                continue
            numbers = np.arange(count + 1)
            wide = np.asarray(ndimage.maximum(ndimage.distance_transform_edt(zone), pieces, numbers))
            several = [_parts(zone & (front == colour), pieces, count) for colour in (first, second)]
            good = (wide >= MIN_STRIPED * window) & (np.maximum(*several) >= MIN_STRIPES)
            good[0] = False
            result |= good[pieces]
    return result


def _parts(stripes: NDArray[np.bool_], pieces: NDArray[np.int_], count: int) -> NDArray[np.int_]:
    """(count + 1,) number of separate stripes in each piece."""
    parts, _ = ndimage.label(stripes)
    pairs = np.unique(np.stack([pieces[stripes], parts[stripes]]), axis=1)
    return np.bincount(pairs[0], minlength=count + 1)


def _areas(kind: NDArray[np.int_], own: NDArray[np.bool_]) -> NDArray[np.int_]:
    """(h, w) number of the area of one colour that each shown pixel lies in, from 1; 0 elsewhere."""
    result = np.zeros(kind.shape, np.int_)
    last = 0
    for colour in np.unique(kind[own]):
        found, count = ndimage.label(own & (kind == colour))
        result = np.where(found > 0, found + last, result)
        last += count
    return result
