"""Flat ends: the hem of a gown, the soles of feet that stand.

An inflated outline is round at its rim. Where the rim is the end of a tube of cloth, or where a foot meets the ground,
that would make a wedge of it. There the outline is inflated as if it continued downwards, and cut off flat.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.canvas import Canvas, raster_distance

DOWN = 0.65
"""Threshold, cosine of a rim's normal with the downward direction, above which the rim is an end; others are sides."""

SCALLOP = 0.03
"""Half width of gaps in an end that are bridged, as hems wave, FIGURE units."""

HEM_BLUR = 0.012
"""Smoothing of ends inside the silhouette: the stairs of pixels would become teeth, FIGURE units."""

MIN_WIDTH = 0.03
"""Least width of an end, FIGURE units; narrower ends are points."""

FURTHER = 0.6
"""Length of the continuation below an end, in widths of the end; at most the height of what is above it."""


@dataclass(frozen=True)
class Ends:
    """Continuation of an outline below its flat ends.

    beyond : (H + extra, W) bool, the continuation; rows below the canvas are `extra`
    source : (W,) int, in each column the row whose label is continued, -1 where there is no end
    extra : rows
    """

    beyond: NDArray[np.bool_]
    source: NDArray[np.int64]
    extra: int


def flat_ends(canvas: Canvas, region: NDArray[np.bool_], chosen: NDArray[np.bool_]) -> Ends | None:
    """Flat ends of a layer; None where it has none.

    region : (H, W) bool, the layer; chosen : (H, W) bool, the pixels of it that may end flat
    """
    around = ndimage.distance_transform_edt(~region) - ndimage.distance_transform_edt(region)
    around = ndimage.gaussian_filter(around, max(2.0, 0.4 * SCALLOP / canvas.pitch))
    down, across = np.gradient(around)
    facing = down / np.maximum(np.hypot(down, across), 1e-9)
    below = np.zeros_like(region)
    below[:-1] = region[1:]
    rim = region & ~below & chosen & (facing > DOWN)
    near = ndimage.distance_transform_edt(~rim) <= max(2.0, SCALLOP / canvas.pitch) if rim.any() else rim
    pieces, _ = ndimage.label(near)
    height, width = region.shape
    source = np.full(width, -1)
    length = np.zeros(width)
    for piece, window in enumerate(ndimage.find_objects(pieces), start=1):
        here, left = rim[window] & (pieces[window] == piece), window[1].start
        columns = np.flatnonzero(here.any(axis=0))
        if not len(columns) or np.ptp(columns) * canvas.pitch < MIN_WIDTH:
            continue
        # The lowest rim pixel of each column; gaps between columns are bridged by their neighbours.
        lowest = window[0].start + here.shape[0] - 1 - np.argmax(here[::-1][:, columns], axis=0)
        span = np.arange(columns[0], columns[-1] + 1)
        rows = np.round(np.interp(span, columns, lowest)).astype(np.int64)
        there = rows > source[left + span]
        source[left + span[there]] = rows[there]
        run = np.median([_run(region[: row + 1, column]) for row, column in zip(lowest, columns + left, strict=True)])
        length[left + span[there]] = min(FURTHER * len(span), float(run))
    ending = source >= 0
    if not ending.any():
        return None
    extra = int(np.ceil(length.max())) + 2
    rows = np.arange(height + extra)[:, None]
    beyond = ending & (rows > source) & (rows <= source + length)
    beyond[:height] &= ~region
    return Ends(beyond, source, extra)


def _run(column: NDArray[np.bool_]) -> int:
    """Number of pixels set without a gap at the end of a column."""
    gaps = np.flatnonzero(~column)
    return len(column) - 1 - (int(gaps[-1]) if len(gaps) else -1)


def clip_distance(canvas: Canvas, region: NDArray[np.bool_], ends: Ends) -> NDArray[np.float64]:
    """(H, W) signed distance to the ends, FIGURE units: positive beyond them, far below zero away from them."""
    height = canvas.sdf.shape[0]
    beyond = ends.beyond
    own = ndimage.gaussian_filter(raster_distance(~beyond), HEM_BLUR / canvas.pitch)[:height] * canvas.pitch
    # What lies below the continuation is beyond the end as well.
    under = (np.arange(height)[:, None] > ends.source) & (ends.source >= 0) & ~region
    own = np.where(under, np.abs(own), own)
    # The drawn contour is exact, but away from the layer it is another layer's.
    drawn = (ndimage.distance_transform_edt(~region) < 3.0) & (np.abs(own - canvas.sdf) < 1.5 * canvas.pitch)
    return np.asarray(np.where(drawn, canvas.sdf, own))
