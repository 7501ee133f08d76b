"""Parts of a drawing that its model does not have: thin things get lost without a trace."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy import ndimage

from exporters.asset import TexturedMesh
from fig2mesh.measure.model import front_overlap
from fig2mesh.parse.checks.missed import RIM_SHARE, boxes, extent_of, in_picture, named
from fig2mesh.records import Figure

MAX_COMPARED_PX: Final = 768
"""Larger figures are compared at every second, third ... pixel: each conversion takes the time."""

MIN_LOST: Final = 0.03
"""Extent of a part that is missed in the model, share of the figure's."""

MIN_SPECK: Final = 0.008
"""The same of a detached piece that was too small to model."""


def lost_in_model(
    mesh: TexturedMesh, figure: Figure, *, metres_per_pixel: float, origin_px: tuple[float, float]
) -> tuple[str, ...]:
    """Doubt about parts of the silhouette that the model's front does not cover; arguments as of `silhouette_iou`."""
    overlap = front_overlap(
        mesh, figure.mask, metres_per_pixel=metres_per_pixel, origin_px=origin_px, max_side_px=MAX_COMPARED_PX
    )
    extent = extent_of(overlap.drawn)
    covered = ndimage.binary_dilation(overlap.modelled, iterations=max(2, round(RIM_SHARE * extent)))
    found = in_picture(boxes(overlap.drawn & ~covered, MIN_LOST * extent), overlap.corner, overlap.step)
    return named(in_picture(found, figure.origin_px, figure.step_px), "not in the model")


def lost_specks(figure: Figure, cleaned: Figure) -> tuple[str, ...]:
    """Doubt about detached pieces that were too small to model; cleaned : the figure without them"""
    step = round(cleaned.step_px / figure.step_px)
    x, y = (round((c - o) / figure.step_px) for c, o in zip(cleaned.origin_px, figure.origin_px, strict=True))
    # Whole pieces are dropped: those that have a pixel left are kept.
    regions, count = ndimage.label(figure.mask, np.ones((3, 3)))
    rows, columns = (np.flatnonzero(cleaned.mask.any(axis=axis)) for axis in (1, 0))
    kept = np.zeros(count + 1, np.bool_)
    if len(rows) and len(columns):
        inside = np.repeat(np.repeat(cleaned.mask, step, 0), step, 1)
        window = regions[y : y + inside.shape[0], x : x + inside.shape[1]]
        kept[np.unique(window[inside[: window.shape[0], : window.shape[1]]])] = True
    kept[0] = True
    found = boxes(~kept[regions], MIN_SPECK * extent_of(figure.mask))
    return named(in_picture(found, figure.origin_px, figure.step_px), "detached, and too small to model")
