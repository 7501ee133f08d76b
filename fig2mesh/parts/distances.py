"""Distances of points in a figure to its skeleton, and closing of masks by distances."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from fig2mesh.parts.limbs import Limb
from fig2mesh.skeleton import JOINT


def thorax_distance(points: NDArray[np.float64], joints: NDArray[np.float64]) -> NDArray[np.float64]:
    """(…) distance of points (…, 2) to the trunk as wide as shoulders and hips, negative inside; FIGURE."""
    spine = segment_distance(points, joints[JOINT["neck"], :2], joints[JOINT["pelvis"], :2])
    shoulders = joints[[JOINT["l_shoulder"], JOINT["r_shoulder"]], :2]
    hips = joints[[JOINT["l_hip"], JOINT["r_hip"]], :2]
    half = 0.25 * (np.linalg.norm(shoulders[1] - shoulders[0]) + np.linalg.norm(hips[1] - hips[0]))
    return spine - max(float(half), 0.04)


def chain_distance(limb: Limb, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(…) distance of points (…, 2) to the circles' centres of a limb, FIGURE units."""
    distance, _ = cKDTree(limb.points).query(points.reshape(-1, 2))
    return np.asarray(distance).reshape(points.shape[:-1])


def nearest_circle(limb: Limb, points: NDArray[np.float64]) -> NDArray[np.intp]:
    """(…) index of the circle of a limb whose centre is nearest to each of points (…, 2)."""
    _, index = cKDTree(limb.points).query(points.reshape(-1, 2))
    return np.asarray(index).reshape(points.shape[:-1])


def segment_distance(
    points: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(…) distance of points (…, 2) to a segment."""
    along = end - start
    t = np.clip(((points - start) @ along) / max(float(along @ along), 1e-12), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - t[..., None] * along, axis=-1))


def polygon_distance(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed distance to a simple or self-crossing quadrilateral's even-odd interior."""
    distance = np.full(points.shape[:-1], np.inf)
    within = np.zeros(points.shape[:-1], bool)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        distance = np.minimum(distance, segment_distance(points, start, end))
        straddles = (start[1] > points[..., 1]) != (end[1] > points[..., 1])
        rise = end[1] - start[1]
        if rise:
            cross = start[0] + (points[..., 1] - start[1]) / rise * (end[0] - start[0])
            within ^= straddles & (points[..., 0] < cross)
    return np.where(within, -distance, distance)


def closing(image: NDArray[np.bool_], radius: float) -> NDArray[np.bool_]:
    """Morphological closing by a disc, using distances: its cost does not grow with the radius (pixels)."""
    pad = int(radius) + 2
    grown = ndimage.distance_transform_edt(~np.pad(image, pad)) <= radius
    return np.asarray((ndimage.distance_transform_edt(grown) > radius)[pad:-pad, pad:-pad])
