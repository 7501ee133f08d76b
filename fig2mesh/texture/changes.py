"""How far from straight behind the drawing the colours of unseen points are found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

NEIGHBOURS: Final = 6
"""Points of the four sides whose changes are averaged."""


@dataclass(frozen=True)
class Changes:
    """How far from straight behind the drawing colours are found.

    points : (N, 3) float32, FIGURE, on the surface; change : (N, 2) float32, FIGURE x, y
    """

    points: NDArray[np.float32]
    change: NDArray[np.float32]

    def at(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """(M, 2) changes at points (M, 3) of the surface."""
        if not len(self.points):
            return np.zeros((len(points), 2))
        count = min(NEIGHBOURS, len(self.points))
        distance, index = cKDTree(self.points).query(np.asarray(points, np.float64), k=count)
        distance, index = distance.reshape(len(points), count), index.reshape(len(points), count)
        weight = 1.0 / (distance + 1e-3) ** 2
        return np.asarray(np.einsum("nk,nkd->nd", weight, self.change[index]) / weight.sum(axis=1)[:, None])


NO_CHANGES: Final = Changes(np.zeros((0, 3), np.float32), np.zeros((0, 2), np.float32))
