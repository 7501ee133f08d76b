"""Joints from the heat maps of the figure parser: positions, sides and confidences."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parse.labelled_points import listed
from fig2mesh.records import BoolArray, FloatArray
from fig2mesh.skeleton import JOINT, JOINT_NAMES, LIMB_BONES, LIMB_JOINTS

PEAK_RADIUS: Final = 2
"""Radius, cells, round a peak that counts for its position and its likelihood."""

MIN_SEPARATION: Final = 0.06
"""Least distance, share of the figure's height, between two joints of a pair; nearer ones may be one location twice."""

CONFIDENCE_THRESHOLD: Final = 0.3
"""Confidence threshold below which a joint is reported."""

MEASURED: Final = ("upper_arm", "lower_arm", "upper_leg", "lower_leg")
"""Parts whose bones are compared, left with right; hands and feet are drawn too freely."""

MAX_LENGTH_RATIO: Final = 3.0
"""Largest ratio of the drawn lengths of left and right bones; larger ones are reported where neither is short."""


def decode(heat: FloatArray, tall: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Joints and their likelihoods.

    heat : (21, n, n) likelihood of each cell, summing to 1 per joint; tall : height of the figure, share of the picture
    → (21, 2) x, y as shares of the picture; (21,) likelihood within `PEAK_RADIUS` cells
    """
    places, sure = np.empty((len(heat), 2)), np.empty(len(heat))
    for joint, share in enumerate(heat):
        places[joint], sure[joint] = peak(share)
    for chain in LIMB_JOINTS.values():
        _sides(heat, places, sure, chain, tall)
    return places, sure


def peak(share: FloatArray) -> tuple[NDArray[np.float64], float]:
    """x, y (shares of the picture) of the likeliest location, and its likelihood."""
    size = share.shape[0]
    near = ndimage.uniform_filter(share.astype(np.float64), 2 * PEAK_RADIUS + 1, mode="constant")
    row, column = np.unravel_index(int(near.argmax()), share.shape)
    return around(share, np.array([column + 0.5, row + 0.5]) / size)


def around(share: FloatArray, place: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Centroid and sum of the likelihood near a location."""
    size = share.shape[0]
    column, row = (np.clip(place * size, 0, size - 1)).astype(int)
    top, left = max(row - PEAK_RADIUS, 0), max(column - PEAK_RADIUS, 0)
    window = share[top : row + PEAK_RADIUS + 1, left : column + PEAK_RADIUS + 1].astype(np.float64)
    total = max(float(window.sum()), 1e-12)
    y, x = np.mgrid[: window.shape[0], : window.shape[1]] + 0.5
    return np.array([left + (window * x).sum() / total, top + (window * y).sum() / total]) / size, total


def _sides(
    heat: FloatArray, places: NDArray[np.float64], sure: NDArray[np.float64], chain: tuple[str, ...], tall: float
) -> None:
    """Give each of a pair of limbs locations of its own, and one side from root to tip; in place.

    Each joint's two locations are the likeliest of either map; where both maps have the same one, the next of the two.
    A limb's joints take them straight or crossed, whichever is likeliest along the whole limb (Viterbi).
    """
    pairs = []
    for name in chain:
        left, right = JOINT[f"l_{name}"], JOINT[f"r_{name}"]
        first, second = places[left].copy(), places[right].copy()
        if np.linalg.norm(first - second) < MIN_SEPARATION * tall and name not in ("shoulder", "hip"):
            first, second = _two_places(heat[left], heat[right], first, second, tall)
        pairs.append((left, right, first, second))
    cost = np.zeros((len(pairs), 2))
    for step, (left, right, first, second) in enumerate(pairs):
        logs = [[np.log(around(heat[joint], place)[1] + 1e-4) for place in (first, second)] for joint in (left, right)]
        cost[step] = -(logs[0][0] + logs[1][1]), -(logs[0][1] + logs[1][0])
    total, back = cost[0].copy(), []
    for step in range(1, len(pairs)):
        bend = np.array([[_stretch(pairs[step - 1], pairs[step], a, b) for a in (0, 1)] for b in (0, 1)])
        choice = total[None, :] + bend
        back.append(choice.argmin(axis=1))
        total = choice.min(axis=1) + cost[step]
    state = int(total.argmin())
    states = [state]
    for best in reversed(back):
        states.append(int(best[states[-1]]))
    for (left, right, first, second), crossed in zip(pairs, reversed(states), strict=True):
        places[left], places[right] = (second, first) if crossed else (first, second)
        for joint in (left, right):
            sure[joint] = around(heat[joint], places[joint])[1]


def _stretch(
    upper: tuple[int, int, NDArray[np.float64], NDArray[np.float64]],
    lower: tuple[int, int, NDArray[np.float64], NDArray[np.float64]],
    a: int,
    b: int,
) -> float:
    """Excess length of the two bones over the other choice, in units of the shorter."""
    straight = sum(float(np.linalg.norm(upper[2 + s] - lower[2 + s])) for s in (0, 1))
    crossed = sum(float(np.linalg.norm(upper[2 + s] - lower[3 - s])) for s in (0, 1))
    own, other = (straight, crossed) if a == b else (crossed, straight)
    return max(own - other, 0.0) / max(min(straight, crossed), 0.02)


def _two_places(
    left: FloatArray, right: FloatArray, first: NDArray[np.float64], second: NDArray[np.float64], tall: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Likeliest location of both maps together, and the next one apart from it, if it is likely enough."""
    size = left.shape[0]
    both = ((left + right) / 2).astype(np.float32)
    best, _ = peak(both)
    y, x = (np.mgrid[:size, :size] + 0.5) / size
    apart = np.hypot(x - best[0], y - best[1]) >= 1.5 * MIN_SEPARATION * tall
    rest = (both * apart).astype(np.float32)
    other, likely = peak(rest)
    return (best, other) if likely > 0.12 else (first, second)


def visible_inside(joints: NDArray[np.floating], mask: BoolArray, tall_px: float) -> NDArray[np.float64]:
    """(21, 2) joints, pixels, IMAGE; those just outside the silhouette are moved onto it."""
    out = np.asarray(joints, np.float64).copy()
    away, nearest = ndimage.distance_transform_edt(~mask, return_indices=True)
    height, width = mask.shape
    for index, (x, y) in enumerate(out):
        row, column = int(np.clip(y, 0, height - 1)), int(np.clip(x, 0, width - 1))
        if 0 < away[row, column] < 0.06 * tall_px:
            out[index] = nearest[1, row, column] + 0.5, nearest[0, row, column] + 0.5
    return out


def doubts(joints: NDArray[np.floating], sure: NDArray[np.floating], visible: BoolArray, mask: BoolArray) -> list[str]:
    """Unlikely findings about a skeleton, as text; empty if there are none.

    joints : (21, 2) pixels, IMAGE; sure : (21,) likelihoods; mask : (H, W)
    """
    found = []
    weak = [JOINT_NAMES[i] for i in np.argsort(sure) if visible[i] and sure[i] < CONFIDENCE_THRESHOLD]
    if weak:
        found.append(f"unsure of {listed(weak, 5)}")
    rows = np.flatnonzero(mask.any(axis=1))
    tall = max(int(rows[-1] - rows[0] + 1), 1) if len(rows) else 1
    away = ndimage.distance_transform_edt(~mask)
    height, width = mask.shape
    column = np.clip(joints[:, 0].astype(int), 0, width - 1)
    row = np.clip(joints[:, 1].astype(int), 0, height - 1)
    outside = [JOINT_NAMES[i] for i in np.flatnonzero(visible & (away[row, column] > 0.03 * tall))]
    if outside:
        found.append(f"{listed(outside, 5)} outside the silhouette")
    for part in MEASURED:
        start, end = LIMB_BONES[part]
        lengths = [float(np.linalg.norm(joints[JOINT[f"{s}_{start}"]] - joints[JOINT[f"{s}_{end}"]])) for s in "lr"]
        if min(lengths) > 0.04 * tall and max(lengths) > MAX_LENGTH_RATIO * min(lengths):
            found.append(f"{part.replace('_', ' ')}s of very different lengths")
    return found
