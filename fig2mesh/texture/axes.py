"""Directions of the bones over a raster: colours go round a limb across its bone."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.skeleton import BODY_PARTS, JOINT, LIMB_BONES, PART, PART_NAMES, without_side

BLUR: Final = 0.03
"""Standard deviation over which directions blend at joints, FIGURE units."""

SHORT: Final = 0.05
"""Length of a bone, FIGURE units, below which its direction counts less."""

ELONGATED: Final = 1.5
"""Ratio of the principal axes of a thing from which it has a direction."""


def bone_axes(
    labels: NDArray[np.uint8], joints: NDArray[np.float64], points: NDArray[np.float64], pitch: float
) -> NDArray[np.float64]:
    """(H, W, 2) row and column of the direction of the bones, shorter than 1 where they are mixed or foreshortened.

    Parameters
    ----------
    labels : (H, W) part of each pixel, 0 outside; joints : (21, 2) FIGURE x, y; points : (H, W, 2) FIGURE x, y
    pitch : FIGURE units per pixel
    """
    tensor = np.zeros((*labels.shape, 3))
    for label in np.unique(labels[labels > 0]):
        own = labels == label
        x, y = _direction(int(label), own, joints, points)
        # Rows run against y.
        tensor[own] = (y * y, -x * y, x * x)
    inside = (labels > 0).astype(float)
    weight = np.maximum(ndimage.gaussian_filter(inside, BLUR / pitch), 1e-9)
    rr, rc, cc = (ndimage.gaussian_filter(tensor[..., i], BLUR / pitch) / weight for i in range(3))
    # The principal direction, as long as the tensor is one-sided.
    half, difference = (rr + cc) / 2, (rr - cc) / 2
    spread = np.hypot(difference, rc)
    angle = 0.5 * np.arctan2(rc, difference)
    length = np.sqrt(np.clip(2.0 * spread, 0.0, 1.0) * np.clip(half + spread, 0.0, 1.0))
    return np.stack([length * np.cos(angle), length * np.sin(angle)], axis=-1)


def _direction(
    label: int, own: NDArray[np.bool_], joints: NDArray[np.float64], points: NDArray[np.float64]
) -> tuple[float, float]:
    """x, y of the bone of a part; no longer than 1."""
    name = PART_NAMES[label]
    if label in (PART["head"], PART["hair"]):
        start, end = joints[JOINT["neck"]], joints[JOINT["head"]]
    elif label in (PART["torso"], PART["garment"]):
        start, end = joints[JOINT["pelvis"]], joints[JOINT["neck"]]
    elif label in BODY_PARTS:
        first, last = LIMB_BONES[without_side(name)]
        start, end = joints[JOINT[name[:2] + first]], joints[JOINT[name[:2] + last]]
    else:
        return _principal(points[own])
    along = end - start
    length = float(np.linalg.norm(along))
    x, y = along / max(length, 1e-9) * min(length / SHORT, 1.0)
    return float(x), float(y)


def _principal(points: NDArray[np.float64]) -> tuple[float, float]:
    """Direction in which points are spread most; zero where they are spread alike."""
    if len(points) < 3:
        return 0.0, 0.0
    variance, axes = np.linalg.eigh(np.cov(points.T))
    if variance[1] < ELONGATED**2 * max(float(variance[0]), 1e-12):
        return 0.0, 0.0
    return float(axes[0, 1]), float(axes[1, 1])
