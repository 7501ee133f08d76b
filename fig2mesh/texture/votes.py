"""What networks tell of unseen sides, area by area.

Networks are right about what a side shows, a back without a face or an open coat, and uneven about where it ends. So
they do not paint: each area of one colour that a drawing has is kept on the unseen sides as it is, unless for most of
what lies behind it they name places of one other colour, which then is the area's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

MAJORITY: Final = 0.5
"""Share of votes that another colour needs."""

LEAST_VOTES: Final = 12
"""Fewer pixels of the sides tell nothing."""


@dataclass(frozen=True)
class Unseen:
    """Points of the unseen sides, and where in the drawing networks look for their colours.

    labels : (M,) uint8, part; points, found : (M, 2) float32, FIGURE x, y of the point itself and of that place
    """

    labels: NDArray[np.uint8]
    points: NDArray[np.float32]
    found: NDArray[np.float32]


def voted(kind: NDArray[np.int_], pixels: NDArray[np.intp], named: NDArray[np.intp]) -> NDArray[np.int_]:
    """A picture of plain areas with those recoloured that the votes are for.

    Parameters
    ----------
    kind : (h, w) colour of each pixel
    pixels : (M, 2) row and column that each vote is for
    named : (M, 2) row and column whose colour is voted for; where either is beyond the picture, it does not count
    """
    within = ((pixels >= 0) & (pixels < kind.shape) & (named >= 0) & (named < kind.shape)).all(axis=1)
    rows, votes = pixels[within], kind[named[within, 0], named[within, 1]]
    result = kind.copy()
    for colour in np.unique(kind[rows[:, 0], rows[:, 1]]):
        areas, count = ndimage.label(kind == colour)
        area = areas[rows[:, 0], rows[:, 1]]
        here = area > 0
        table = np.zeros((count + 1, int(max(kind.max(), votes.max(initial=0))) + 1))
        np.add.at(table, (area[here], votes[here]), 1.0)
        total, best = table.sum(axis=1), table.argmax(axis=1)
        most = table[np.arange(count + 1), best]
        change = (total >= LEAST_VOTES) & (most > MAJORITY * total) & (best != colour)
        change[0] = False
        result = np.where(change[areas], best[areas], result)
    return np.asarray(result)
