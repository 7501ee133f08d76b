"""Pen of a drawing: detection of contours and their width, and the same lines elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

STROKE: Final = 0.2
"""Threshold of a palette colour's weight, below which it occurs only as strokes."""

DARK: Final = 0.3
"""Threshold of relative luminance, below which a colour may be ink."""

DRAWN: Final = 0.5
"""Least share of a border with ink along it for the border to count as drawn."""

REACH: Final = 1.5
"""Search distance for ink from a border, line widths."""

ALIKE: Final = 60.0
"""Colour tolerance, RGB 0-255: nearer colours are shades of one thing, or the pen's own colour in a wash."""

BAND: Final = 1.8
"""Distance from the silhouette within which its line lies, line widths."""

INKY: Final = 110.0
"""Colour tolerance, RGB 0-255, of the pen's line, soft edges included."""

MIN_BORDER_PX: Final = 12
"""Least length of a border, pixels; shorter ones are not evaluated."""


@dataclass(frozen=True)
class Pen:
    """colour : (3,) 0-255; width : pixels; near : (h, w) bool, within reach of a stroke."""

    colour: NDArray[np.float32]
    width: float
    near: NDArray[np.bool_]


def find_pen(
    palette: NDArray[np.float32], index: NDArray[np.int_], weight: NDArray[np.float64], own: NDArray[np.bool_]
) -> Pen | None:
    """Pen of a drawing whose silhouette has a contour; None where it has none.

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
    commonest = inks[int(np.argmax([(index[strokes] == ink).sum() for ink in inks]))]
    return Pen(palette[commonest], width, near)


def without_contour(
    picture: NDArray[np.float32], own: NDArray[np.bool_], pen: Pen, width: float
) -> NDArray[np.float32]:
    """Replace the line along the silhouette of a picture (H, W, 3) by the colours further in.

    own : (H, W) bool, the silhouette; width : of the line in pixels of the picture
    """
    within = ndimage.distance_transform_edt(own) <= BAND * width
    inky = np.linalg.norm(picture - pen.colour, axis=-1) < INKY
    # Where the line ends it is mixed with what is beside it.
    line = within & ndimage.binary_dilation(inky & within, iterations=max(1, round(width / 4)))
    away, source = ndimage.distance_transform_edt(line | ~own, return_indices=True)
    # Clothes as dark as ink continue further in, and are kept.
    line &= away <= 1.5 * BAND * width
    near = ndimage.distance_transform_edt(~line) <= BAND * width
    return np.where(((line | ~own) & near)[..., None], picture[tuple(source)], picture)


def lined_pairs(
    palette: NDArray[np.float32], kind: NDArray[np.int_], own: NDArray[np.bool_], pen: Pen | None
) -> NDArray[np.bool_]:
    """(K, K) bool: colours between which the drawing has lines.

    palette : (K, 3) 0-255; kind : (h, w) palette colour of each pixel
    own : (h, w) bool, visible pixels of these areas
    """
    result = np.zeros((len(palette), len(palette)), bool)
    if pen is None:
        return result
    apart = np.linalg.norm(palette[:, None] - palette, axis=-1) > ALIKE
    wet = np.linalg.norm(palette - pen.colour, axis=-1) <= ALIKE
    may = apart & ~wet[:, None] & ~wet
    for axis in (0, 1):
        border, low, high = _border(kind, may, axis)
        for a, b in np.unique(np.stack([low[border], high[border]], axis=1), axis=0):
            shown = border & (low == a) & (high == b) & own
            if shown.sum() >= MIN_BORDER_PX and pen.near[shown].mean() >= DRAWN:
                result[a, b] = result[b, a] = True
    return result


def reinked(
    palette: NDArray[np.float32], kind: NDArray[np.int_], lined: NDArray[np.bool_], pen: Pen | None
) -> NDArray[np.float32]:
    """(h, w, 3) plain areas with lines where they meet, for pairs of colours between which the drawing has lines.

    palette : (K, 3) 0-255; kind : (h, w) palette colour of each pixel; lined : (K, K) bool, those pairs
    """
    picture = palette[kind]
    if pen is None or not lined.any():
        return picture
    lines = np.zeros(kind.shape, bool)
    for axis in (0, 1):
        lines |= _border(kind, lined, axis)[0]
    if not lines.any():
        return picture
    cover = np.clip(pen.width / 2 + 0.5 - ndimage.distance_transform_edt(~lines), 0.0, 1.0)[..., None]
    return np.asarray(picture + cover * (pen.colour - picture), np.float32)


def _border(
    kind: NDArray[np.int_], pairs: NDArray[np.bool_], axis: int
) -> tuple[NDArray[np.bool_], NDArray[np.int_], NDArray[np.int_]]:
    """Pixels with a different colour before them along an axis, if it is one of the pairs; and both colours, sorted."""
    before = np.roll(kind, 1, axis)
    border = pairs[kind, before] & (kind != before)
    np.moveaxis(border, axis, 0)[0] = False
    return border, np.minimum(kind, before), np.maximum(kind, before)
