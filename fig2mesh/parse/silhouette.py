"""Refinement of a coarse silhouette: a network's guess corrected by the picture's own lines and colours.

Colours of certain foreground and certain background decide near the guessed outline, smoothed along the picture's edges
by a guided filter (He, Sun, Tang 2013). On plain backgrounds (paper, one colour, soft gradients) lines are more exact:
all that can be reached from the rim without crossing one is background. Where the two differ, the guess decides piece
by piece.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parse.colours import by_colour, grown, reduced
from fig2mesh.records import BoolArray, ByteArray, FloatArray

WORKING_PX: Final = 800
"""Working size, pixels along the longer side; larger pictures are reduced to it."""

PLAIN_SHARE: Final = 0.7
"""A background is plain where this share of what the network calls background has the colour of a smooth fit."""

BACKGROUND_TOLERANCE: Final = 10.0
"""Colour tolerance of the background, 0-255."""

MAX_NOISE: Final = 7.0
"""Largest noise (grain of paper) of a plain background, 0-255."""

MIN_IOU: Final = 0.72
"""Threshold of IoU with the guess from which the outline by lines is used."""

EXCLUDE_BELOW: Final = 0.4
INCLUDE_ABOVE: Final = 0.8
"""Likelihoods below which pieces enclosed by lines but not found by colour are excluded, and above which pieces found
by colour but not enclosed are included."""

BLUR_PX: Final = 3
"""Width of the rim blurred by scanning, pixels."""

GAPS: Final = (0, 1, 2, 4, 7, 11)
"""Half widths of gaps in the drawn outline that are bridged, pixels of the working size."""


class PlainBackground(NamedTuple):
    """away : (H, W) float32, distance of a pixel's colour from the fitted background, 0-255; noise : its spread there
    share : of the background that has the fitted colour"""

    away: FloatArray
    noise: float
    share: float


def refine(rgb: ByteArray, likely: FloatArray) -> BoolArray:
    """(H, W) bool silhouette.

    rgb : (H, W, 3) uint8; likely : (H, W) float32, probability of each pixel to be foreground, by a network, 0-1
    """
    height, width = likely.shape
    step = max(1, int(np.ceil(max(height, width) / WORKING_PX)))
    small, guess = reduced(rgb.astype(np.float32), step), reduced(likely[..., None], step)[..., 0]
    found = _outline(small, guess)
    if step == 1:
        return found
    scale = (height / found.shape[0], width / found.shape[1])
    soft = ndimage.zoom(found.astype(np.float32), scale, order=1, grid_mode=True, mode="nearest")
    return np.asarray(soft[:height, :width] > 0.5)


def _outline(rgb: FloatArray, likely: FloatArray) -> BoolArray:
    guess = likely > 0.5
    if not guess.any():
        return guess
    coloured = by_colour(rgb, likely)
    background = plain_background(rgb, likely)
    if background is None or background.share < PLAIN_SHARE:
        return coloured
    enclosed, score = _enclosed(background, likely)
    return _merged(background, enclosed, coloured, likely) if score >= MIN_IOU else coloured


def _merged(background: PlainBackground, enclosed: BoolArray, coloured: BoolArray, likely: FloatArray) -> BoolArray:
    """Merge: the region enclosed by lines, without objects beside the figure, with what a gap in its outline lost."""
    beside = _pieces(enclosed & ~coloured, likely, below=EXCLUDE_BELOW)
    beside &= ~_bridges(beside, enclosed & ~beside)
    # An enclosed region of the background's colour is no shadow, but a limb left blank between its lines.
    beside &= ~_pieces(beside, (~drawn_lines(background)).astype(np.float32), above=0.5)
    lost = _pieces(coloured & ~enclosed, likely, above=INCLUDE_ABOVE)
    return (enclosed & ~beside) | lost


def _bridges(pieces: BoolArray, kept: BoolArray) -> BoolArray:
    """Pieces of a mask that join two pieces of another: a forearm between sleeve and hand."""
    regions, count = ndimage.label(pieces, np.ones((3, 3)))
    others, most = ndimage.label(kept, np.ones((3, 3)))
    if most < 2 or not count:
        return np.zeros_like(pieces)
    size = np.bincount(others.ravel())
    found = np.zeros(count + 1, bool)
    for index, window in enumerate(ndimage.find_objects(regions), start=1):
        wide = tuple(slice(max(cut.start - 1, 0), cut.stop + 1) for cut in window)
        near = ndimage.binary_dilation(regions[wide] == index, np.ones((3, 3)))
        touched = np.unique(others[wide][near])
        found[index] = (size[touched[touched > 0]] > 1e-4 * kept.size).sum() > 1
    return np.asarray(found[regions])


def _pieces(mask: BoolArray, likely: FloatArray, below: float = 2.0, above: float = -1.0) -> BoolArray:
    """Connected pieces of a mask whose mean likelihood lies between `above` and `below`."""
    regions, count = ndimage.label(mask, np.ones((3, 3)))
    if not count:
        return np.zeros_like(mask)
    index = np.arange(1, count + 1)
    mean = ndimage.mean(likely, regions, index)
    return np.asarray(np.isin(regions, index[(mean < below) & (mean > above)]))


def plain_background(rgb: FloatArray, likely: FloatArray) -> PlainBackground | None:
    """Fit the background's colour by a quadratic in x and y; None where there is too little background."""
    background = likely < 0.25
    height, width = likely.shape
    rim = np.zeros_like(background)
    reach = max(2, min(height, width) // 60)
    rim[:reach] = rim[-reach:] = rim[:, :reach] = rim[:, -reach:] = True
    rows = np.flatnonzero((background & (rim | (likely < 0.08))).ravel())
    if len(rows) < 60:
        return None
    rows = rows[:: max(1, len(rows) // 6000)]
    y, x = np.divmod(rows, width)
    x, y = x / width - 0.5, y / height - 0.5
    base = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    colours = rgb.reshape(-1, 3)[rows].astype(np.float64)
    # Robust fit, from the commonest colour outwards: lines and scenery are excluded step by step.
    middle = _mode(colours)
    kept = np.abs(colours - middle).max(axis=1) < 40
    terms = 1
    for terms in (1, 3, 6, 6):
        if kept.sum() < 40:
            return None
        fit, *_ = np.linalg.lstsq(base[kept, :terms], colours[kept], rcond=None)
        rest = np.abs(colours - base[:, :terms] @ fit).max(axis=1)
        noise = float(np.clip(1.5 * np.median(rest[kept]), 1.0, MAX_NOISE))
        kept = rest < max(4 * noise, 9)
    grid_y, grid_x = np.mgrid[:height, :width]
    gx, gy = (grid_x / width - 0.5).ravel(), (grid_y / height - 0.5).ravel()
    full = np.stack([np.ones_like(gx), gx, gy, gx * gx, gx * gy, gy * gy], axis=1)[:, :terms] @ fit
    away = np.abs(rgb - full.reshape(height, width, 3)).max(axis=2).astype(np.float32)
    share = float((away < max(4 * noise, 12))[background].mean()) if background.any() else 0.0
    return PlainBackground(away, noise, share)


def _mode(colours: NDArray[np.float64]) -> NDArray[np.float64]:
    cells = (colours // 16).astype(int)
    flat = cells[:, 0] * 256 + cells[:, 1] * 16 + cells[:, 2]
    values, counts = np.unique(flat, return_counts=True)
    return np.asarray(np.median(colours[flat == values[counts.argmax()]], axis=0))


def _enclosed(background: PlainBackground, likely: FloatArray) -> tuple[BoolArray, float]:
    """Region enclosed by lines or colours, for the gap width that agrees best with the guess; and its agreement."""
    line = drawn_lines(background)
    best, top = likely > 0.5, -1.0
    for gap in GAPS:
        found = _flooded(line, likely, gap)
        found = _half_way(found, background.away)
        score = agreement(found, likely)
        # Wider bridges round off corners: they must earn it.
        if score > top + (0.01 if gap else 0):
            best, top = found, score
    return best, top


def drawn_lines(background: PlainBackground) -> BoolArray:
    """(H, W) whether a pixel differs from the background."""
    return np.asarray(background.away > max(5 * background.noise, BACKGROUND_TOLERANCE))


def _flooded(line: BoolArray, likely: FloatArray, gap: int) -> BoolArray:
    """Foreground by flood fill: all that is not background, which reaches the rim through gaps wider than 2 `gap`."""
    barrier = grown(line, gap)
    free = ~np.pad(barrier, 1)
    # The background must not flood in where the rim cuts the figure off.
    free[0, 1:-1] = free[-1, 1:-1] = free[1:-1, 0] = free[1:-1, -1] = True
    rim_figure = np.pad(likely > 0.6, 1, mode="edge")
    inner = np.zeros_like(free)
    inner[1:-1, 1:-1] = True
    free &= inner | ~rim_figure
    regions, _count = ndimage.label(free)
    outside = regions == regions[0, 0] if free[0, 0] else np.zeros_like(free)
    rim_regions = np.unique(np.concatenate([regions[0], regions[-1], regions[:, 0], regions[:, -1]]))
    outside |= np.isin(regions, rim_regions[rim_regions > 0])
    outside = outside[1:-1, 1:-1]
    if gap:
        # Back to the lines, round corners too; through a gap only a little way.
        outside = ndimage.binary_dilation(outside, np.ones((3, 3)), iterations=gap + 1, mask=~line)
    figure = ~outside
    figure = _without_others(figure, likely)
    return _without_holes(figure, line, likely)


def _half_way(figure: BoolArray, away: FloatArray) -> BoolArray:
    """Remove the paler half of the figure's blurred rim: an edge is where a line has half of its strength."""
    soft = away < 0.5 * ndimage.maximum_filter(away, 2 * BLUR_PX + 1)
    outside = ndimage.binary_dilation(~figure, iterations=BLUR_PX, mask=soft | ~figure)
    return np.asarray(~outside)


def _without_others(figure: BoolArray, likely: FloatArray) -> BoolArray:
    """Remove pieces that the network does not hold for foreground, and what sticks out far from it."""
    reach = max(3, round(0.045 * max(figure.shape)))
    away = ndimage.distance_transform_edt(likely < 0.3)
    near = figure & ((away < reach) | (likely > 0.06))
    figure = near | _bridges(figure & ~near, near)
    regions, count = ndimage.label(figure, np.ones((3, 3)))
    if not count:
        return figure
    index = np.arange(1, count + 1)
    size, mean = ndimage.sum_labels(figure, regions, index), ndimage.mean(likely, regions, index)
    keep = (mean > 0.3) & (size > 2e-4 * figure.size)
    if not keep.any():
        keep[np.argmax(size * mean)] = True
    return np.asarray(np.isin(regions, index[keep]))


def _without_holes(figure: BoolArray, line: BoolArray, likely: FloatArray) -> BoolArray:
    """Cut holes where the background shows through the figure: enclosed, of the background's colour, unlikely."""
    regions, count = ndimage.label(figure & ~line)
    if not count:
        return figure
    index = np.arange(1, count + 1)
    size, mean = ndimage.sum_labels(figure, regions, index), ndimage.mean(likely, regions, index)
    holes = index[(mean < 0.4) & (size > 3e-4 * figure.size)]
    return figure & ~np.isin(regions, holes) if len(holes) else figure


def agreement(mask: BoolArray, likely: FloatArray) -> float:
    """IoU of a mask with a guess, weighted by the guess's confidence."""
    sure = np.abs(2 * likely - 1)
    guess = likely > 0.5
    either = float((sure * (mask | guess)).sum())
    return float((sure * (mask & guess)).sum()) / either if either else 0.0
