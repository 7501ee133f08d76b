"""Shapes of things in a picture, from the joints of the body that wears them."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import JOINT

Points = NDArray[np.float64]


class Thing(NamedTuple):
    """mask : (H, W) bool; label : part label; material : its name; front : it covers the body behind it;
    spared : labels that stay in front of it"""

    mask: NDArray[np.bool_]
    label: int
    material: str
    front: bool
    spared: tuple[int, ...] = ()


def polygon(shape: tuple[int, ...], points: Points) -> NDArray[np.bool_]:
    out = np.zeros(shape[:2], np.uint8)
    cv2.fillPoly(out, [np.rint(points).astype(np.int32)], 1)
    return out > 0


def smooth(points: Points, closed: bool = True, steps: int = 6) -> Points:
    """Round a line through points by Chaikin's corner cutting."""
    for _ in range(steps // 2):
        after = np.roll(points, -1, axis=0) if closed else points[1:]
        before = points if closed else points[:-1]
        points = np.stack([0.75 * before + 0.25 * after, 0.25 * before + 0.75 * after], axis=1).reshape(-1, 2)
    return points


def line(shape: tuple[int, ...], points: Points, width: float) -> NDArray[np.bool_]:
    out = np.zeros(shape[:2], np.uint8)
    cv2.polylines(out, [np.rint(points).astype(np.int32)], False, 1, max(round(width), 1))
    return out > 0


def ellipse(shape: tuple[int, ...], centre: Points, radii: tuple[float, float], angle: float) -> NDArray[np.bool_]:
    out = np.zeros(shape[:2], np.uint8)
    axes = (max(int(radii[0]), 1), max(int(radii[1]), 1))
    cv2.ellipse(out, (int(centre[0]), int(centre[1])), axes, np.degrees(angle), 0, 360, 1, -1)
    return out > 0


def at(joints: Points, *names: str) -> list[Points]:
    return [joints[JOINT[name], :2] for name in names]


def body_length(joints: Points) -> float:
    """Length of the body along its bones, pixels."""
    head, pelvis, knee, ankle = at(joints, "head", "pelvis", "l_knee", "l_ankle")
    return float(np.linalg.norm(head - pelvis) * 1.3 + np.linalg.norm(pelvis - knee) + np.linalg.norm(knee - ankle))
