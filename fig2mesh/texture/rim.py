"""LayerRim of a layer: its contour in order, and the material inside of the drawn line at each point of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

REACH: Final = 0.045
"""Depth inside the drawn line over which materials are counted, FIGURE units."""

STEP: Final = 0.5
"""Distance of the samples, pixels of the raster."""

DECAY: Final = 2.0
"""Weight of the innermost sample relative to the outermost, as a power of 1/e."""

NEAR: Final = 0.018
"""The same for narrow stripes, which a deeper look would leave."""

FINE, SMOOTH, SMOOTHER = 0.004, 0.011, 0.04
"""Standard deviations of the averages along the rim, FIGURE units: of the near votes, and of all; the wider ones where
the narrower are undecided."""

SURE: Final = (0.5, 0.7)
"""Shares of the votes for the commonest material between which the wider average gives way to the narrow one."""

MIN_POINTS: Final = 8
"""Least number of points of a contour."""


@dataclass(frozen=True)
class LayerRim:
    """Points along the contours of a region.

    points : (N, 2) row and column, pixels of the raster; inwards : (N, 2) unit vectors
    contour : (N,) number of the contour of each point; they are closed
    """

    points: NDArray[np.float64]
    inwards: NDArray[np.float64]
    contour: NDArray[np.int_]

    def smoothed(self, values: NDArray[np.float64], width: float) -> NDArray[np.float64]:
        """Average values (N, C) along the contours with a standard deviation in points."""
        result = values.copy()
        for number in np.unique(self.contour):
            own = self.contour == number
            result[own] = ndimage.gaussian_filter1d(values[own], width, axis=0, mode="wrap")
        return result


def find_rim(region: NDArray[np.bool_]) -> LayerRim:
    """Contours of a region, a point about every pixel."""
    from skimage.measure import find_contours

    padded = np.pad(region, 2)
    soft = ndimage.gaussian_filter(padded.astype(np.float64), 0.7)
    distance = ndimage.gaussian_filter(
        ndimage.distance_transform_edt(padded) - ndimage.distance_transform_edt(~padded), 1.5
    )
    slope = np.stack(np.gradient(distance), axis=-1)
    points: list[NDArray[np.float64]] = []
    contour: list[NDArray[np.int_]] = []
    for found in find_contours(soft, 0.5):
        if len(found) >= MIN_POINTS:
            points.append(found[:-1])
            contour.append(np.full(len(found) - 1, len(contour)))
    if not points:
        rows, columns = np.nonzero(region)
        middle = np.stack([rows, columns], axis=1).astype(np.float64)
        return LayerRim(middle, np.zeros_like(middle), np.zeros(len(middle), int))
    places = np.concatenate(points)
    inwards = np.stack(
        [ndimage.map_coordinates(slope[..., axis], places.T, order=1, mode="nearest") for axis in (0, 1)], axis=1
    )
    inwards /= np.maximum(np.linalg.norm(inwards, axis=1, keepdims=True), 1e-9)
    return LayerRim(places - 2, inwards, np.concatenate(contour))


def samples(rim: LayerRim, depth: float) -> NDArray[np.float64]:
    """(N, S, 2) row and column of samples from each point inwards to a depth in pixels."""
    steps = STEP * np.arange(int(depth / STEP) + 2)
    return np.asarray(rim.points[:, None] + steps[:, None] * rim.inwards[:, None])


def count_votes(found: NDArray[np.int_], valid: NDArray[np.bool_], number: int, reach: int) -> NDArray[np.float64]:
    """(N, number) votes of the samples from the first valid one inwards; sums are 1, or 0 where nothing is valid.

    Parameters
    ----------
    found : (N, S) material of each sample; valid : (N, S) bool; number : of materials; reach : samples that count
    """
    first = np.where(valid.any(axis=1), valid.argmax(axis=1), found.shape[1])
    behind = np.arange(found.shape[1]) - first[:, None]
    weight = np.where(valid & (behind >= 0) & (behind < reach), np.exp(-DECAY * np.maximum(behind, 0) / reach), 0.0)
    votes = np.zeros((len(found), number))
    rows = np.broadcast_to(np.arange(len(found))[:, None], found.shape)
    np.add.at(votes, (rows[weight > 0], found[weight > 0]), weight[weight > 0])
    return _shares(votes)


def decided(
    rim: LayerRim, near: NDArray[np.float64], votes: NDArray[np.float64], pitch: float
) -> tuple[NDArray[np.int_], NDArray[np.float64]]:
    """Material of each point, -1 where there is none near; and the share of the votes for it.

    near, votes : (N, K) votes close to the rim and further in; pitch : FIGURE units per point
    """
    fine, narrow, wide = (
        rim.smoothed(counted, width / pitch) for counted, width in ((near, FINE), (votes, SMOOTH), (votes, SMOOTHER))
    )
    mixed, total = _shares(wide), wide.sum(axis=1)
    for level in (narrow, fine):
        share = _shares(level)
        sure = np.clip((share.max(axis=1) - SURE[0]) / (SURE[1] - SURE[0]), 0.0, 1.0)[:, None]
        mixed = share * sure + mixed * (1.0 - sure)
    material = np.where(total > 1e-3, mixed.argmax(axis=1), -1)
    return material, np.asarray(_shares(narrow).max(axis=1))


def _shares(votes: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(votes / np.maximum(votes.sum(axis=1, keepdims=True), 1e-9))
