"""Contour of a drawing: where along the rim a line is drawn, how wide, and with which pen.

From every point of the rim the picture is read inwards, at right angles to it. A line begins at the rim, is darker than
what follows, and about as wide at most places; clothes that are dark up to the rim have no end there, and flat drawings
no line at all. Several pens may be used: blue ink for one garment, red for another.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.image_frame import ImageFrame

Floats = NDArray[np.float64]

LUMINANCE: Final = np.array([0.2126, 0.7152, 0.0722])
"""Weights of red, green and blue in luminance."""

MIN_WHITE: Final = 205.0
"""Least luminance, 0-255, of light ink; less is light at the rim."""

MAX_WIDTH: Final = 0.06
"""Largest width of a line, FIGURE units: that of a felt-tip pen on a child's drawing."""

MAX_USUAL: Final = 0.035
"""Largest usual width of a pen's lines, FIGURE units; broader ones are areas, and the surface stays where it is."""

WIDER, SOFT_PX = 1.1, 0.75
"""Width of a line with its soft edge relative to that without, and what is added besides, pixels."""

STEP_PX: Final = 0.25
"""Distance between the samples of a profile, pixels."""

ONSET_PX, ONSET = 2.5, 0.006
"""Largest distance between rim and line, pixels and FIGURE units, whichever is larger: silhouettes are that exact."""

SOFT_SHARE: Final = 0.35
"""Share of a soft line's width after which it must be inked."""

VALLEY: Final = 30.0
"""Rise of luminance, 0-255, that ends the search for a line's darkest point."""

EDGE: Final = 50.0
"""Least difference of colours, RGB 0-255, between a line and what lies beside it."""

DARKER: Final = 35.0
"""Least difference of luminance, 0-255, between a pen and what lies beside its line."""

ALIKE: Final = 75.0
"""Colour tolerance, RGB 0-255, of one pen's lines: thin ones are mixed with what is beside them."""

MIXED: Final = 0.75
"""Largest share of the colour beside it in the darkest colour of a thin line."""

CLUSTER: Final = 45.0
"""The same within the core of a pen's lines."""

MAX_LUMINANCE: Final = 0.45
"""Largest relative luminance of a pen."""

MIN_SHARE: Final = 0.08
"""Least share of the rim drawn with a pen."""

MIN_DRAWN: Final = 0.25
"""Least share of the rim with a line, of all pens, for a drawing with a contour; less is shading, or a scan's edge."""

MIN_LIGHT_PX: Final = 2.0
"""Least usual width of light lines, pixels."""

THICK_PX: Final = 2.5
"""Width of lines, pixels, from which their darkest point has the pen's pure colour."""

SPREAD: Final = 2.0
"""Largest ratio between the widths of a pen's lines and their most frequent width, either way ..."""

MIN_ALIKE: Final = 0.55
"""... for this share of them."""


@dataclass(frozen=True)
class DrawnLine:
    """Line along the rim.

    width : (N,) at points of the rim, FIGURE units; 0 where none is drawn, NaN where that cannot be seen
    color : (N, 3) sRGB 0-255 of the pen; meaningless where the width is 0 or NaN
    pens : (P, 3) sRGB 0-255, the pens found; empty where the drawing has no contour
    """

    width: Floats
    color: Floats
    pens: Floats


def with_soft_edge(width: Floats, px: float) -> Floats:
    """(N,) widths of lines with their soft edges; 0 and NaN stay; px : FIGURE units per pixel."""
    return np.where(width > 0, WIDER * width + SOFT_PX * px, width)


@dataclass(frozen=True)
class _Profiles:
    """Reading of the picture at N rim points: darkest colour and the one beside it (N, 3), width to the half-way
    colour, NaN where the line has no end, and rise of luminance behind it (N,)."""

    ink: Floats
    beside: Floats
    width: Floats
    rise: Floats


def drawn_line(
    picture: NDArray[np.float32],
    frame: ImageFrame,
    points: Floats,
    outwards: Floats,
    shown: NDArray[np.bool_],
    paper: Floats | None = None,
) -> DrawnLine:
    """Line along the rim of a figure.

    Parameters
    ----------
    picture : (H, W, 3) sRGB 0-255, its colours continued beyond the silhouette
    points : (N, 2 or 3) of the rim, FIGURE; outwards : (N, 2) unit normals in the picture's plane
    shown : (N,) bool; False where something in front hides the rim
    paper : (3,) sRGB 0-255 beside the figure, of which a silhouette may have a strip; None for cut-out figures
    """
    line = _dark_line(picture, frame, points[:, :2], outwards, shown)
    if len(line.pens):
        return line
    # White ink on dark fills: the same in the negative. Cut-out figures have a light fringe of a pixel.
    light = _dark_line(255 - picture, frame, points[:, :2], outwards, shown, MIN_LIGHT_PX * frame.units_per_px)
    pens = 255 - light.pens
    if (pens @ LUMINANCE < MIN_WHITE).any():
        return line
    if paper is not None and len(pens) and (np.linalg.norm(pens - paper, axis=1) < ALIKE).any():
        return line
    return DrawnLine(light.width, 255 - light.color, pens)


def paper_beside(rgba: NDArray[np.uint8], mask: NDArray[np.bool_]) -> Floats | None:
    """(3,) median sRGB 0-255 of the opaque pixels beside a silhouette (H, W); None where there are none."""
    beside = ndimage.binary_dilation(mask, iterations=8) & ~ndimage.binary_dilation(mask, iterations=2)
    beside &= rgba[..., 3] >= 250
    return np.asarray(np.median(rgba[beside][:, :3], axis=0), np.float64) if beside.any() else None


def _dark_line(
    picture: NDArray[np.float32],
    frame: ImageFrame,
    points: Floats,
    outwards: Floats,
    shown: NDArray[np.bool_],
    min_usual: float = 0.0,
) -> DrawnLine:
    """Line that is darker than what lies beside it; min_usual : least usual width of a pen, FIGURE units."""
    profiles = _read(picture, frame, points, outwards)
    pens = _pens(profiles, shown, frame.units_per_px)
    pens = pens[pens[:, 3] >= min_usual]
    width = np.zeros(len(points))
    color = np.zeros((len(points), 3))
    if not len(pens):
        return DrawnLine(width, color, pens[:, :3])
    apart = np.linalg.norm(profiles.ink[:, None] - pens[:, :3], axis=-1)
    nearest = apart.argmin(axis=1)
    color = pens[nearest, :3]
    pure = apart[np.arange(len(points)), nearest] <= ALIKE
    thin = profiles.width <= THICK_PX * frame.units_per_px
    inked = pure | (thin & _mixed(profiles, color))
    ends = inked & (profiles.width <= 1.5 * SPREAD * pens[nearest, 3]) & (profiles.rise >= DARKER)
    width = np.where(ends, profiles.width, np.where(inked, np.nan, 0.0))
    width[~shown] = np.nan
    if (pure & (width > 0)).sum() < MIN_DRAWN * max(int(shown.sum()), 1):
        return DrawnLine(np.zeros(len(points)), color, pens[:0, :3])
    return DrawnLine(width, color, pens[:, :3])


def _read(picture: NDArray[np.float32], frame: ImageFrame, points: Floats, outwards: Floats) -> _Profiles:
    px = frame.units_per_px
    along = np.arange(0.0, MAX_WIDTH + 2 * ONSET_PX * px, STEP_PX * px)
    places = points[:, None] - along[:, None] * outwards[:, None]
    where = frame.image_from_figure(places)
    at = [where[..., 1] - 0.5, where[..., 0] - 0.5]
    colours = np.stack(
        [ndimage.map_coordinates(picture[..., c], at, order=1, mode="nearest") for c in range(3)], axis=-1
    ).astype(np.float64)
    rows = np.arange(len(points))
    luminance = colours @ LUMINANCE
    # The first valley is the line, whatever is darker further in.
    passed = np.maximum.accumulate(luminance - np.minimum.accumulate(luminance, axis=1), axis=1) > VALLEY
    core = np.where(passed, np.inf, luminance).argmin(axis=1)
    ink = colours[rows, core]
    apart = np.linalg.norm(colours - ink[:, None], axis=-1)
    beyond = np.arange(len(along)) > core[:, None]
    far = beyond & (apart >= EDGE)
    far[:, :-1] &= far[:, 1:]
    has_end = far.any(axis=1)
    first = far.argmax(axis=1)
    # The colour beside the line is reached within the width of a soft edge.
    window = first[:, None] + np.arange(round(1.5 / STEP_PX) + 1)
    window = np.minimum(window, len(along) - 1)
    levels = np.take_along_axis(apart, window, axis=1)
    plateau = levels.max(axis=1)
    beside = window[rows, levels.argmax(axis=1)]
    half = (beyond & (apart >= plateau[:, None] / 2)).argmax(axis=1)
    before = np.maximum(half - 1, 0)
    low, high = apart[rows, before], apart[rows, half]
    share = np.clip((plateau / 2 - low) / np.maximum(high - low, 1e-9), 0.0, 1.0)
    width = np.where(has_end, along[before] + share * (along[half] - along[before]), np.nan)
    onset = along[(apart <= EDGE).argmax(axis=1)]
    late = onset > np.fmax(max(ONSET, ONSET_PX * px), SOFT_SHARE * np.nan_to_num(width))
    ink = np.where(late[:, None], colours[:, 0], ink)
    width[late] = np.nan
    rise = np.where(has_end, luminance[rows, beside] - luminance[rows, core], 0.0)
    return _Profiles(ink, colours[rows, beside], width, rise)


def _mixed(profiles: _Profiles, pen: Floats) -> NDArray[np.bool_]:
    """(N,) bool: colours that are mixed of a pen's (N, 3) and what is beside the line, as those of thin lines are."""
    away = profiles.beside - pen
    share = np.einsum("nd,nd->n", profiles.ink - pen, away) / np.maximum(np.einsum("nd,nd->n", away, away), 1e-9)
    off = np.linalg.norm(profiles.ink - pen - share[:, None] * away, axis=1)
    return np.asarray((share <= MIXED) & (off <= ALIKE / 2))


def _pens(profiles: _Profiles, shown: NDArray[np.bool_], px: float) -> Floats:
    """(P, 4) colour and usual width of the pens, the most used one first."""
    width, rise = profiles.width, profiles.rise
    luminance = profiles.ink @ LUMINANCE / 255.0
    left = shown & np.isfinite(width) & (width <= MAX_WIDTH) & (rise >= DARKER) & (luminance < MAX_LUMINANCE)
    least = MIN_SHARE * max(int(shown.sum()), 1)
    pens = []
    while left.sum() >= least:
        colours = profiles.ink[left]
        near = np.linalg.norm(colours[:, None] - colours, axis=-1) < CLUSTER
        centre = colours[near.sum(axis=1).argmax()]
        members = left & (np.linalg.norm(profiles.ink - centre, axis=-1) < ALIKE)
        left &= ~members
        widths = width[members]
        # The most frequent width: the middle of the narrowest half of them.
        ordered = np.sort(np.log(np.maximum(widths, 0.25 * px)))
        half = len(ordered) // 2
        start = int((ordered[half:] - ordered[: len(ordered) - half]).argmin())
        usual = float(np.exp(ordered[start : start + half + 1].mean()))
        alike = (widths <= SPREAD * usual) & (widths >= usual / SPREAD)
        if members.sum() < least or alike.mean() < MIN_ALIKE or usual > MAX_USUAL:
            continue
        thick = members & (width >= THICK_PX * px)
        if thick.sum() < 0.2 * members.sum():
            thick = members & (luminance <= np.quantile(luminance[members], 0.2))
        pens.append(np.append(np.median(profiles.ink[thick], axis=0), usual))
    return np.array(pens).reshape(-1, 4)
