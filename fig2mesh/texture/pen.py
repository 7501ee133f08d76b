"""The draughtsman's pen: whether areas are drawn with contours, how wide they are, and the same lines elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

STROKE: Final = 0.2
"""Palette colours of less weight only occur as strokes."""

DARK: Final = 0.3
"""Relative luminance below which a colour may be ink."""

DRAWN: Final = 0.5
"""Share of a border along which there must be ink for it to count as drawn."""

REACH: Final = 1.5
"""Ink is looked for within this many line widths of a border."""

ALIKE: Final = 60.0
"""Colours nearer to each other than this (RGB 0-255) are shades of one thing, or the pen's own colour in a wash."""

BAND: Final = 1.8
"""The line along the silhouette lies within this many widths of it."""

INKY: Final = 110.0
"""Colours nearer to the pen's than this (RGB 0-255) are its line, soft edges included."""

LEAST_BORDER: Final = 12
"""Pixels; shorter borders tell nothing."""


@dataclass(frozen=True)
class Pen:
    """colour : (3,) 0-255; width : pixels; near : (h, w) bool, within reach of a stroke."""

    colour: NDArray[np.float32]
    width: float
    near: NDArray[np.bool_]


def find_pen(
    palette: NDArray[np.float32], index: NDArray[np.int_], weight: NDArray[np.float64], own: NDArray[np.bool_]
) -> Pen | None:
    """The pen of a drawing whose silhouette has a contour; None where it has none.

    Parameters
    ----------
    palette : (K, 3) 0-255; index : (h, w) palette colour of each pixel; weight : (K,) small for colours of strokes
    own : (h, w) bool, the figure
    """
    from skimage.morphology import skeletonize

    luminance = palette @ np.array([0.2126, 0.7152, 0.0722]) / 255.0
    inks = np.flatnonzero((weight < STROKE) & (luminance < DARK))
    strokes = own & np.isin(index, inks)
    if not strokes.any():
        return None
    width = float(strokes.sum() / max(int(skeletonize(strokes).sum()), 1))
    near = ndimage.distance_transform_edt(~strokes) <= REACH * width
    rim = own & ~ndimage.binary_erosion(own)
    if near[rim].mean() < DRAWN:
        return None
    most = inks[int(np.argmax([(index[strokes] == ink).sum() for ink in inks]))]
    return Pen(palette[most], width, near)


def without_contour(
    picture: NDArray[np.float32], own: NDArray[np.bool_], pen: Pen, width: float
) -> NDArray[np.float32]:
    """A picture (H, W, 3) with the line along the silhouette in the colours further in.

    own : (H, W) bool, the silhouette; width : of the line in pixels of the picture
    """
    within = ndimage.distance_transform_edt(own) <= BAND * width
    inky = np.linalg.norm(picture - pen.colour, axis=-1) < INKY
    # Where the line ends it is mixed with what is beside it.
    line = within & ndimage.binary_dilation(inky & within, iterations=max(1, round(width / 4)))
    away, source = ndimage.distance_transform_edt(line | ~own, return_indices=True)
    # Clothes as dark as ink go on further in, and stay.
    line &= away <= 1.5 * BAND * width
    near = ndimage.distance_transform_edt(~line) <= BAND * width
    return np.where(((line | ~own) & near)[..., None], picture[tuple(source)], picture)


def reinked(
    palette: NDArray[np.float32], kind: NDArray[np.int_], own: NDArray[np.bool_], pen: Pen | None
) -> NDArray[np.float32]:
    """(h, w, 3) plain areas with lines where they meet, for pairs of colours between which the drawing has lines.

    palette : (K, 3) 0-255; kind : (h, w) which colour each pixel has
    own : (h, w) bool, where the drawing shows these areas
    """
    picture = palette[kind]
    if pen is None:
        return picture
    apart = np.linalg.norm(palette[:, None] - palette, axis=-1) > ALIKE
    wet = np.linalg.norm(palette - pen.colour, axis=-1) <= ALIKE
    may = apart & ~wet[:, None] & ~wet
    lines = np.zeros(kind.shape, bool)
    for axis in (0, 1):
        before, after = (np.take(kind, np.arange(kind.shape[axis])[part], axis) for part in (slice(-1), slice(1, None)))
        border = np.zeros(kind.shape, bool)
        np.moveaxis(border, axis, 0)[1:] = np.moveaxis(before != after, axis, 0)
        other = np.roll(kind, 1, axis)
        for pair in _pairs(kind, border & may[kind, other], axis):
            shown = pair & own
            if shown.sum() >= LEAST_BORDER and pen.near[shown].mean() >= DRAWN:
                lines |= pair
    if not lines.any():
        return picture
    cover = np.clip(pen.width / 2 + 0.5 - ndimage.distance_transform_edt(~lines), 0.0, 1.0)[..., None]
    return np.asarray(picture + cover * (pen.colour - picture), np.float32)


def _pairs(kind: NDArray[np.int_], border: NDArray[np.bool_], axis: int) -> list[NDArray[np.bool_]]:
    """The border's pixels by the pair of colours that meet there."""
    before = np.roll(kind, 1, axis)
    count = int(kind.max()) + 1
    code = np.minimum(kind, before) * count + np.maximum(kind, before)
    return [border & (code == pair) for pair in np.unique(code[border])]
