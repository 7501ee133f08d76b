"""Majority vote of networks on the colours of sides that are not observed, area by area.

Networks are right about the content of a side, a back without a face or an open coat, and inexact about its borders. So
they do not paint: each area of one colour of the drawing stays as it is on the other sides, unless for most of the
points behind it they choose locations of one other colour, which then becomes the area's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

MAJORITY: Final = 0.5
"""Threshold of the share of votes for another colour."""

MIN_VOTES: Final = 12
"""Least number of votes, pixels of the sides."""


@dataclass(frozen=True)
class UnobservedPoints:
    """Points of the sides that are not observed, and the locations of their colours in the drawing by the networks.

    labels : (M,) uint8, part; points, found : (M, 2) float32, FIGURE x, y of the point itself and of that location
    """

    labels: NDArray[np.uint8]
    points: NDArray[np.float32]
    found: NDArray[np.float32]


def recoloured_by_majority(
    kind: NDArray[np.int_], pixels: NDArray[np.intp], named: NDArray[np.intp]
) -> NDArray[np.int_]:
    """Recolour the areas of a plain picture by majority vote.

    Parameters
    ----------
    kind : (h, w) colour of each pixel
    pixels : (M, 2) row and column that each vote is for
    named : (M, 2) row and column of the colour voted for; votes with either pixel beyond the picture do not count
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
        change = (total >= MIN_VOTES) & (most > MAJORITY * total) & (best != colour)
        change[0] = False
        result = np.where(change[areas], best[areas], result)
    return np.asarray(result)
