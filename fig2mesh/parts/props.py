"""Held things and bags: layers of their own, inflated from their own outline, as deep as what they touch.

They are known by the label `prop` alone; without it a silhouette does not tell a staff from an arm.
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
"""Pieces up to twice as far apart belong to one thing that goes on behind the hand between them, FIGURE units."""

LEAST_PX = 12
"""Smaller labels are slips of the brush."""

CROSSING = 0.05
"""A thing with this share of it before the body lies in front of that, else beside what it touches."""

REST = 0.35
"""A thing's middle keeps this share of its half thickness clear of the surface that it lies on, as limbs do."""


class Prop(NamedTuple):
    """shown : (H, W) bool, where the drawing shows it; region : (H, W) bool, with what is behind a hand."""

    shown: NDArray[np.bool_]
    region: NDArray[np.bool_]


def find_props(canvas: Canvas) -> list[Prop]:
    """The separate things among the pixels labelled as such."""
    given = canvas.inside & (canvas.labels == PART["prop"])
    if not given.any():
        return []
    reach = GRIP / canvas.pitch
    pieces, count = ndimage.label(ndimage.distance_transform_edt(~given) <= reach)
    result = []
    for piece in range(1, count + 1):
        shown = given & (pieces == piece)
        if shown.sum() >= LEAST_PX:
            around = ndimage.distance_transform_edt(pieces == piece) > reach
            result.append(Prop(shown, shown | (around & canvas.inside)))
    return result


def prop_depth(
    half: NDArray[np.float64],
    shown: NDArray[np.bool_],
    others: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> float:
    """FIGURE z of a thing's middle: things are stiff, and drawn parallel to the picture for all that one can see.

    half : (H, W) its half thickness, 0 where it is not
    others : (front, back) FIGURE z of each other layer, (H, W), NaN where that is not
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
