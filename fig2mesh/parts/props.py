"""Held things and bags: layers of their own, inflated from their own outline, as deep as what they touch.

They are identified by the label `prop` only; a silhouette alone does not distinguish a staff from an arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.canvas import Canvas
from fig2mesh.skeleton import PART

GRIP = 0.09
"""Half the largest distance between pieces of one thing that continues behind the hand between them, FIGURE units."""

MIN_PX = 12
"""Least number of pixels of a thing; smaller labels are slips of the brush."""

CROSSING = 0.05
"""A thing of which at least this share overlaps the body lies in front of it, else beside what it touches."""

REST = 0.35
"""Distance of a thing's middle from the surface that it lies on, share of its half thickness, as for limbs."""


class Prop(NamedTuple):
    """shown : (H, W) bool, visible pixels; region : (H, W) bool, including what is behind a hand."""

    shown: NDArray[np.bool_]
    region: NDArray[np.bool_]


def find_props(canvas: Canvas) -> list[Prop]:
    """Separate things among the pixels labelled `prop`."""
    given = canvas.inside & (canvas.labels == PART["prop"])
    if not given.any():
        return []
    reach = GRIP / canvas.pitch
    pieces, count = ndimage.label(ndimage.distance_transform_edt(~given) <= reach)
    result = []
    for piece in range(1, count + 1):
        shown = given & (pieces == piece)
        if shown.sum() >= MIN_PX:
            around = ndimage.distance_transform_edt(pieces == piece) > reach
            result.append(Prop(shown, shown | (around & canvas.inside)))
    return result


def prop_depth(
    half: NDArray[np.float64],
    shown: NDArray[np.bool_],
    others: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> float:
    """FIGURE z of a thing's middle: things are assumed stiff and parallel to the picture.

    half : (H, W) its half thickness, 0 outside it
    others : (front, back) FIGURE z of each other layer, (H, W), NaN outside it
    """
    front = np.fmax.reduce([front for front, _ in others])
    before = shown & np.isfinite(front)
    if before.sum() > CROSSING * shown.sum():
        # Where it dips below the body the body's other parts would show, and the drawing does not have them.
        return float(np.quantile(front[before] + REST * half[before], 0.8))
    around = ndimage.binary_dilation(half > 0, np.ones((3, 3)), iterations=2)
    middles = np.stack([np.where(around, (front + back) / 2, np.nan) for front, back in others])
    touching = middles[np.isfinite(middles)]
    return float(np.median(touching)) if len(touching) else 0.0
