"""Brims of hats: flat lobes that stick out on both sides of a head at one height, and the disc between them.

In profile a cap's peak sticks out on the side of the face; it is the foremost part of a disc as wide as the head.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.heads.frame import HeadFrame

THICKEST = 1.0
"""Largest thickness of a brim, radii of the head."""

MIN_OVERHANG = 0.22
"""Least overhang of a brim, radii of the head."""

FLAT = 1.0
"""Largest mean thickness of a brim relative to its overhang."""

CAP_FLAT = 2.2
"""The same for the overhanging top of a cap, which has nothing above it."""

CAP_TOP = 0.25
"""Largest height of what is above the sides of a cap's top, radii of the head."""

SOLID = 0.45
"""Least share of the area between base, tip, top and bottom that a side of a brim covers: strands of hair do less."""

ABOVE_EYES = 0.1
"""Least height of a brim above the eyes, radii of the head: ears are lower."""

LEVEL = 0.7
"""Largest difference in height between the two sides of a brim, radii of the head."""

ALIKE = 0.4
"""Least overhang of one side relative to the other."""

MIN_PX = 9
"""Least number of pixels of a side of a brim."""

EIGHT = np.ones((3, 3))


@dataclass(frozen=True)
class Wing:
    """Flat lobe on one side of a head.

    pixels : (H, W) bool
    side : -1 or 1, side of the axis
    base, tip : (across, along) of its middle where it is attached, and at its end
    thickness : at its base, FIGURE units
    """

    pixels: NDArray[np.bool_]
    side: int
    base: tuple[float, float]
    tip: tuple[float, float]
    thickness: float

    @property
    def overhang(self) -> float:
        return self.side * (self.tip[0] - self.base[0])


@dataclass(frozen=True)
class Brim:
    """Disc around a head.

    wings : its sides that stick out, from left to right; a peak in profile has one
    middle : of the disc, across the axis
    """

    wings: tuple[Wing, ...]
    middle: float

    @property
    def pixels(self) -> NDArray[np.bool_]:
        """(H, W) bool, what sticks out of the head."""
        return np.asarray(np.logical_or.reduce([wing.pixels for wing in self.wings]))

    @property
    def thickness(self) -> float:
        """Thickness at the head, FIGURE units."""
        return float(np.mean([wing.thickness for wing in self.wings]))

    @property
    def top(self) -> float:
        """Height of its upper side at the head."""
        return float(np.mean([wing.base[1] for wing in self.wings])) + self.thickness / 2

    def height(self, across: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height of its middle along the axis, at some distances from the axis."""
        places = sorted(place for wing in self.wings for place in (wing.base, wing.tip))
        return np.asarray(np.interp(across, *np.transpose(places)))


def find_brim(canvas: Canvas, frame: HeadFrame, region: NDArray[np.bool_], head: NDArray[np.bool_]) -> Brim | None:
    """Brim of a head; None where there is none.

    region : (H, W) bool, the layer with the head; head : its pixels that belong to the head
    """
    wings = _wings(canvas, frame, region, head)
    pairs = [
        (left, right)
        for left, right in product(wings, wings)
        if left.side < 0 < right.side
        and abs(left.base[1] - right.base[1]) < LEVEL * frame.radius
        and min(left.overhang, right.overhang) > ALIKE * max(left.overhang, right.overhang)
    ]
    if pairs:
        widest = max(pairs, key=lambda pair: pair[0].overhang + pair[1].overhang)
        return Brim(widest, (widest[0].tip[0] + widest[1].tip[0]) / 2)
    peaks = [wing for wing in wings if wing.side == frame.looks]
    if not peaks:
        return None
    peak = max(peaks, key=lambda wing: wing.overhang)
    return Brim((peak,), peak.tip[0] - peak.base[0])


def raise_brim(canvas: Canvas, frame: HeadFrame, brim: Brim) -> NDArray[np.float64]:
    """(H, W) squared half thickness of a brim, FIGURE units²; 0 elsewhere.

    Each row of it, seen from its edge, is a disc: half as deep as its drawn ends are apart.
    """
    pitch = canvas.pitch
    across, along = frame.coordinates(canvas.points())
    row = (along - brim.height(across)) / pitch
    own = row[brim.pixels]
    first = int(np.floor(own.min())) - 2
    count = int(np.ceil(own.max())) - first + 3
    ends = []
    for wing in brim.wings:
        end = np.full(count, abs(wing.base[0] - brim.middle))
        reach = np.abs(across[wing.pixels] - brim.middle) + pitch / 2
        np.maximum.at(end, np.round(row[wing.pixels]).astype(int) - first, reach)
        ends.append(ndimage.gaussian_filter1d(end, 0.7, mode="nearest"))
    places = np.clip(row - first, 0.0, count - 1.0)
    half = np.interp(places, np.arange(count), np.mean(ends, axis=0))
    left, right = (np.interp(places, np.arange(count), end) for end in (ends[0], ends[-1]))
    aside = (across - brim.middle) / np.where(across < brim.middle, left, right)
    there = (row > first + 1.5) & (row < first + count - 2.5)
    return np.where(there, half**2 * np.maximum(1.0 - aside**2, 0.0), 0.0)


def _wings(canvas: Canvas, frame: HeadFrame, region: NDArray[np.bool_], head: NDArray[np.bool_]) -> list[Wing]:
    """Parts of a head that are thin along its axis, and flat."""
    pitch, radius = canvas.pitch, frame.radius
    across, along = frame.coordinates(canvas.points())
    margin = THICKEST * radius
    s = np.arange(across[head].min() - pitch, across[head].max() + pitch, pitch)
    t = np.arange(along[head].min() - margin, along[head].max() + margin, pitch)
    inside = canvas.sample(region.astype(float), frame.points(*np.meshgrid(s, t))) > 0.5
    thick = ndimage.binary_opening(inside, np.ones((max(3, round(THICKEST * radius / pitch)), 1)))
    where = np.stack([(along - t[0]) / pitch, (across - s[0]) / pitch])
    trunk = ndimage.map_coordinates(thick.astype(float), where, order=1, mode="constant") > 0.25
    around = ndimage.binary_dilation(trunk, EIGHT, iterations=2)
    numbered, count = ndimage.label(head & ~trunk, EIGHT)
    found = []
    for number in range(1, count + 1):
        lobe = numbered == number
        if lobe.sum() < MIN_PX or not (lobe & around).any():
            continue
        wing = _wing(lobe, float(np.median(across[lobe & around])), across, along, pitch)
        if wing is None or wing.overhang < MIN_OVERHANG * radius or wing.base[1] < frame.eyes[1] + ABOVE_EYES * radius:
            continue
        area = float(lobe.sum()) * pitch**2
        beside = trunk & head & (np.abs(across - wing.base[0]) < 0.15 * radius)
        capped = beside.any() and along[beside].max() - along[lobe].max() < CAP_TOP * radius
        flat = CAP_FLAT if capped else FLAT
        if SOLID * wing.overhang * np.ptp(along[lobe]) < area < flat * wing.overhang**2:
            found.append(wing)
    return found


def _wing(
    lobe: NDArray[np.bool_], root: float, across: NDArray[np.float64], along: NDArray[np.float64], pitch: float
) -> Wing | None:
    side = 1 if root > 0 else -1
    beyond = side * (across[lobe] - root)
    overhang = float(beyond.max()) + pitch / 2
    near, far = beyond < 0.3 * overhang, beyond > 0.8 * overhang
    if not near.any() or not far.any():
        return None
    heights = along[lobe]
    base, tip = (root, float(heights[near].mean())), (root + side * overhang, float(heights[far].mean()))
    return Wing(lobe, side, base, tip, float(np.ptp(heights[near])) + pitch)
