"""A crisp silhouette from a coarse one: what the picture's own lines and colours say of a network's guess.

Colours of what is surely figure and surely ground decide near the guessed outline, smoothed along the picture's edges
by a guided filter (He, Sun, Tang 2013). On plain grounds (paper, one colour, soft gradients) lines know better: all
that can be reached from the rim without crossing one is ground. Where the two differ, the guess decides piece by piece.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parse.colours import by_colour, grown, reduced
from fig2mesh.records import BoolArray, ByteArray, FloatArray

WORKING: Final = 800
"""Pixels of the longer side at which the outline is sought; larger pictures are reduced for it."""

PLAIN_SHARE: Final = 0.7
"""A ground is plain where this share of what the network calls ground has the colour of a smooth sheet."""

FAINT: Final = 10.0
"""Colours nearer to the ground's than this are the ground's, 0-255."""

ROUGH: Final = 7.0
"""Grain of paper beyond which a ground is not plain, 0-255."""

AGREED: Final = 0.72
"""IoU with the guess from which an outline that lines have is believed."""

BESIDE: Final = 0.4
LOST: Final = 0.8
"""Pieces that lines enclose and colours do not are left out below the one likelihood; those that colours find and
lines do not are taken in above the other."""

BLUR: Final = 3
"""Width of the rim that scans blur, pixels."""

GAPS: Final = (0, 1, 2, 4, 7, 11)
"""Half widths of gaps in the drawn outline that are bridged, pixels of the working size."""


class Sheet(NamedTuple):
    """away : (H, W) float32, how far a pixel's colour is from the plain ground's, 0-255; noise : its spread there
    share : of the ground that has the sheet's colour"""

    away: FloatArray
    noise: float
    share: float


def refine(rgb: ByteArray, likely: FloatArray) -> BoolArray:
    """(H, W) bool silhouette.

    rgb : (H, W, 3) uint8; likely : (H, W) float32, how likely a network holds each pixel for the figure, 0-1
    """
    height, width = likely.shape
    step = max(1, int(np.ceil(max(height, width) / WORKING)))
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
    sheet = plain_sheet(rgb, likely)
    if sheet is None or sheet.share < PLAIN_SHARE:
        return coloured
    enclosed, score = _enclosed(sheet, likely)
    return _merged(sheet, enclosed, coloured, likely) if score >= AGREED else coloured


def _merged(sheet: Sheet, enclosed: BoolArray, coloured: BoolArray, likely: FloatArray) -> BoolArray:
    """What lines enclose, without what stands or lies beside the figure, and with what a gap in its outline lost."""
    beside = _pieces(enclosed & ~coloured, likely, below=BESIDE)
    beside &= ~_bridges(beside, enclosed & ~beside)
    # What has the ground's colour and is enclosed all the same is no shadow: a limb left blank between its lines.
    beside &= ~_pieces(beside, (~_lines(sheet)).astype(np.float32), above=0.5)
    lost = _pieces(coloured & ~enclosed, likely, above=LOST)
    return (enclosed & ~beside) | lost


def _bridges(pieces: BoolArray, kept: BoolArray) -> BoolArray:
    """The pieces of a mask that join two pieces of another: a forearm between sleeve and hand."""
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
    """The connected pieces of a mask whose mean likelihood lies between."""
    regions, count = ndimage.label(mask, np.ones((3, 3)))
    if not count:
        return np.zeros_like(mask)
    index = np.arange(1, count + 1)
    mean = ndimage.mean(likely, regions, index)
    return np.asarray(np.isin(regions, index[(mean < below) & (mean > above)]))


def plain_sheet(rgb: FloatArray, likely: FloatArray) -> Sheet | None:
    """The ground as a smooth sheet (a quadratic in x and y); None where there is too little of it."""
    ground = likely < 0.25
    height, width = likely.shape
    rim = np.zeros_like(ground)
    reach = max(2, min(height, width) // 60)
    rim[:reach] = rim[-reach:] = rim[:, :reach] = rim[:, -reach:] = True
    rows = np.flatnonzero((ground & (rim | (likely < 0.08))).ravel())
    if len(rows) < 60:
        return None
    rows = rows[:: max(1, len(rows) // 6000)]
    y, x = np.divmod(rows, width)
    x, y = x / width - 0.5, y / height - 0.5
    base = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    colours = rgb.reshape(-1, 3)[rows].astype(np.float64)
    # From the commonest colour outwards: lines and scenery are left out step by step.
    middle = _mode(colours)
    kept = np.abs(colours - middle).max(axis=1) < 40
    terms = 1
    for terms in (1, 3, 6, 6):
        if kept.sum() < 40:
            return None
        fit, *_ = np.linalg.lstsq(base[kept, :terms], colours[kept], rcond=None)
        rest = np.abs(colours - base[:, :terms] @ fit).max(axis=1)
        noise = float(np.clip(1.5 * np.median(rest[kept]), 1.0, ROUGH))
        kept = rest < max(4 * noise, 9)
    grid_y, grid_x = np.mgrid[:height, :width]
    gx, gy = (grid_x / width - 0.5).ravel(), (grid_y / height - 0.5).ravel()
    full = np.stack([np.ones_like(gx), gx, gy, gx * gx, gx * gy, gy * gy], axis=1)[:, :terms] @ fit
    away = np.abs(rgb - full.reshape(height, width, 3)).max(axis=2).astype(np.float32)
    share = float((away < max(4 * noise, 12))[ground].mean()) if ground.any() else 0.0
    return Sheet(away, noise, share)


def _mode(colours: NDArray[np.float64]) -> NDArray[np.float64]:
    cells = (colours // 16).astype(int)
    flat = cells[:, 0] * 256 + cells[:, 1] * 16 + cells[:, 2]
    values, counts = np.unique(flat, return_counts=True)
    return np.asarray(np.median(colours[flat == values[counts.argmax()]], axis=0))


def _enclosed(sheet: Sheet, likely: FloatArray) -> tuple[BoolArray, float]:
    """What lines or colours enclose, for the gap width whose result agrees best with the guess; and how well."""
    line = _lines(sheet)
    best, top = likely > 0.5, -1.0
    for gap in GAPS:
        found = _flooded(line, likely, gap)
        found = _half_way(found, sheet.away)
        score = agreement(found, likely)
        # Wider bridges round off corners: they must earn it.
        if score > top + (0.01 if gap else 0):
            best, top = found, score
    return best, top


def _lines(sheet: Sheet) -> BoolArray:
    return np.asarray(sheet.away > max(5 * sheet.noise, FAINT))


def _flooded(line: BoolArray, likely: FloatArray, gap: int) -> BoolArray:
    """The figure: all that is not ground, where ground reaches the rim through gaps wider than 2 `gap`."""
    barrier = grown(line, gap)
    free = ~np.pad(barrier, 1)
    # A figure cut off by the rim is no way in for the ground.
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
    """The figure without the paler half of its blurred rim: an edge is where a line has half of its strength."""
    soft = away < 0.5 * ndimage.maximum_filter(away, 2 * BLUR + 1)
    outside = ndimage.binary_dilation(~figure, iterations=BLUR, mask=soft | ~figure)
    return np.asarray(~outside)


def _without_others(figure: BoolArray, likely: FloatArray) -> BoolArray:
    """Without pieces that the network does not hold for the figure, and without what sticks out far from it."""
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
    """With holes where the ground is seen through the figure: enclosed, of the ground's colour, unlikely."""
    regions, count = ndimage.label(figure & ~line)
    if not count:
        return figure
    index = np.arange(1, count + 1)
    size, mean = ndimage.sum_labels(figure, regions, index), ndimage.mean(likely, regions, index)
    holes = index[(mean < 0.4) & (size > 3e-4 * figure.size)]
    return figure & ~np.isin(regions, holes) if len(holes) else figure


def agreement(mask: BoolArray, likely: FloatArray) -> float:
    """IoU of a mask with a guess, where pixels of which the guess is unsure count less."""
    sure = np.abs(2 * likely - 1)
    guess = likely > 0.5
    either = float((sure * (mask | guess)).sum())
    return float((sure * (mask & guess)).sum()) / either if either else 0.0
