"""Materials of a drawing: palette colours that are light and shade of one thing, and the strokes that belong to none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.texture.pen import DARK, Pen

ALIKE: Final = 9.0
"""Colour tolerance, CIELAB units: nearer colours are one material."""

GRADIENT: Final = 13.0
"""The same for colours that lie beside each other."""

BESIDE: Final = 0.3
"""Least share of one's border that two steps of a gradient have in common."""

MIXED: Final = 18.0
"""Difference from the palette, RGB 0-255, above which a pixel beside a stroke is the stroke's soft edge."""

EXACT: Final = 6.0
"""Difference from the palette, RGB 0-255, below which a pixel has a colour of the palette."""

FLAT: Final = 0.6
"""Least share of such pixels of a material without gradients."""

SAME_HUE: Final = 0.13
"""Largest difference of the RGB ratios of light and shade of one material."""

MAX_SHADE: Final = 1.6
"""Largest mean RGB ratio of light and shade of one material."""

ENCLOSED: Final = 0.5
"""Least share of the border of a shade, lines left out, that it has with the light of its material."""

MIN_BORDER: Final = 0.15
"""Least common border of light and shade, FIGURE units."""

MAX_INKED: Final = 0.5
"""Largest share of that border along which there is ink: a draughtsman divides things by lines, not their shade."""

STROKE_WIDTH: Final = 0.012
"""Largest width of a stroke of ink where no pen was found, FIGURE units."""

BROAD: Final = 1.5
"""Largest width of a stroke, widths of the pen."""

MIN_FILL: Final = 10.0
"""Least area of the inside of a dark fill, squares of half the width of a stroke: smaller ones are blots."""

WIDE: Final = 2.0
"""Half width from which a dark area is a fill however small, in those of a stroke."""

MAX_BROAD: Final = 0.075
"""Largest width of a contour that is drawn with a brush or a marker, FIGURE units."""

ALL_ROUND: Final = 0.75
"""Least share of the silhouette that one dark colour covers to be its contour."""


@dataclass(frozen=True)
class Materials:
    """Materials on a raster of the drawing.

    colour : (K, 3) float32 0-255, of the largest areas of each material
    index : (h, w) int, material of each pixel
    ink : (h, w) bool, strokes and their soft edges
    flat : (K,) bool, False for materials with gradients
    width : of the strokes, pixels of the raster
    """

    colour: NDArray[np.float32]
    index: NDArray[np.int_]
    ink: NDArray[np.bool_]
    flat: NDArray[np.bool_]
    width: float


def find_materials(
    picture: NDArray[np.float32],
    palette: NDArray[np.float32],
    index: NDArray[np.int_],
    own: NDArray[np.bool_],
    pen: Pen | None,
    pitch: float,
) -> Materials:
    """Merge palette colours into materials.

    Parameters
    ----------
    picture : (h, w, 3) 0-255; palette : (K, 3); index : (h, w) palette colour of each pixel
    own : (h, w) bool, the figure; pitch : FIGURE units per pixel
    """
    width = _stroke_width(palette, index, own, pen, pitch)
    strokes = ink_strokes(palette, index, own, width)
    mixed = np.linalg.norm(picture - palette[index], axis=-1) > MIXED
    ink = strokes | (own & mixed & ndimage.binary_dilation(strokes, np.ones((3, 3)), iterations=2))
    if (own & ~ink).sum() < 0.02 * own.sum():
        ink = np.zeros_like(own)
    count = np.bincount(index[own & ~ink], minlength=len(palette))
    root = _merged(palette, index, own, ink, pitch, count)
    flat = _flat(picture, palette, index, own & ~ink, root)
    return Materials(palette, root[index], ink, flat, width)


def ink_strokes(
    palette: NDArray[np.float32], index: NDArray[np.int_], own: NDArray[np.bool_], width: float
) -> NDArray[np.bool_]:
    """(h, w) bool: dark pixels in pieces no wider than `width` pixels."""
    luminance = palette @ np.array([0.2126, 0.7152, 0.0722]) / 255.0
    result = np.zeros_like(own)
    reach = max(0.5 * width + 0.5, 1.0)
    for colour in np.flatnonzero(luminance < DARK):
        area = own & (index == colour)
        if not area.any():
            continue
        away = ndimage.distance_transform_edt(area)
        pieces, count = ndimage.label(away > reach)
        if count:
            # Where lines meet there are blots.
            numbers = np.arange(count + 1)
            large = np.bincount(pieces.ravel(), minlength=count + 1) > MIN_FILL * reach**2
            wide = np.asarray(ndimage.maximum(away, pieces, numbers)) > WIDE * reach
            core = (large | wide)[pieces] & (pieces > 0)
            if core.any():
                area &= ndimage.distance_transform_edt(~core) > reach + 1.0
        result |= area
    return result


def _stroke_width(
    palette: NDArray[np.float32], index: NDArray[np.int_], own: NDArray[np.bool_], pen: Pen | None, pitch: float
) -> float:
    """Largest width of strokes, pixels."""
    if pen is not None:
        return BROAD * pen.width
    # A marker's contour is no thinner than a limb, but it is as wide everywhere.
    luminance = palette @ np.array([0.2126, 0.7152, 0.0722]) / 255.0
    rim = own & ~ndimage.binary_erosion(own)
    for colour in np.flatnonzero(luminance < DARK):
        area = own & (index == colour)
        if area[rim].mean() >= ALL_ROUND:
            away = ndimage.distance_transform_edt(area)
            widest = 2.0 * float(np.quantile(away[area], 0.98))
            if widest * pitch <= MAX_BROAD and (own & ~area).sum() > 0.1 * own.sum():
                return widest
    return STROKE_WIDTH / pitch


def _merged(
    palette: NDArray[np.float32],
    index: NDArray[np.int_],
    own: NDArray[np.bool_],
    ink: NDArray[np.bool_],
    pitch: float,
    count: NDArray[np.int_],
) -> NDArray[np.int_]:
    """(K,) palette colour that stands for the material of each palette colour: its commonest."""
    from skimage.color import rgb2lab

    lab = rgb2lab(palette / 255.0)
    root = np.arange(len(palette))

    def merge(a: int, b: int) -> None:
        kept, gone = (root[a], root[b]) if count[root[a]] >= count[root[b]] else (root[b], root[a])
        root[root == gone] = kept

    border, inked = _borders(index, own, ink, len(palette))
    bare = border - inked
    total = bare.sum(axis=0) + bare.sum(axis=1)
    for a, b in np.argwhere(np.triu(np.linalg.norm(lab[:, None] - lab, axis=-1) < GRADIENT, 1)):
        # Steps of a gradient lie beside each other; others must not chain through colours in between.
        beside = bare[a, b] > BESIDE * min(total[a], total[b])
        if beside or np.linalg.norm(lab[root[a]] - lab[root[b]]) < ALIKE:
            merge(int(a), int(b))
    for a, b in np.argwhere(np.triu(border * pitch > MIN_BORDER, 1)):
        # Light and shade are compared with the material's commonest colour, or chains of shades would join everything.
        ratio = (palette[root[a]] + 4.0) / (palette[root[b]] + 4.0)
        mean = float(ratio.mean())
        same = float(np.abs(ratio / mean - 1.0).max()) < SAME_HUE
        less = a if count[a] < count[b] else b
        enclosed = bare[a, b] > ENCLOSED * (bare[less].sum() + bare[:, less].sum())
        if same and enclosed and max(mean, 1 / mean) < MAX_SHADE and inked[a, b] < MAX_INKED * border[a, b]:
            merge(int(a), int(b))
    return root


def _flat(
    picture: NDArray[np.float32],
    palette: NDArray[np.float32],
    index: NDArray[np.int_],
    clear: NDArray[np.bool_],
    root: NDArray[np.int_],
) -> NDArray[np.bool_]:
    """(K,) bool: materials of few exact colours, as in flat and cel-shaded drawings."""
    away = np.linalg.norm(picture[clear] - palette[index[clear]], axis=-1)
    material = root[index[clear]]
    exact = np.bincount(material[away < EXACT], minlength=len(palette))
    return np.asarray(exact >= FLAT * np.bincount(material, minlength=len(palette)))


def _borders(
    index: NDArray[np.int_], own: NDArray[np.bool_], ink: NDArray[np.bool_], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(K, K) length of the common border of each two colours, pixels, and how much of it lies in ink."""
    border, inked = np.zeros((count, count)), np.zeros((count, count))
    for axis in (0, 1):
        rolled = [np.moveaxis(image, axis, 0) for image in (index, own, ink)]
        (a, b), (own_a, own_b), (ink_a, ink_b) = ((image[:-1], image[1:]) for image in rolled)
        there = own_a & own_b & (a != b)
        low, high = np.minimum(a, b)[there], np.maximum(a, b)[there]
        np.add.at(border, (low, high), 1.0)
        np.add.at(inked, (low, high), (ink_a | ink_b)[there].astype(float))
    return border, inked

