"""Views of a body from four sides: front, left, back, right (paper §4.3, appendix B)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.body import Body
from fig2mesh.field.camera import VIEW_YAW_DEG, axes, images, orthographic
from fig2mesh.field.trace import trace
from fig2mesh.records import Pose3D
from fig2mesh.skeleton import JOINT, PART

SIZE: Final = 256
FILLED: Final = 0.9
"""Share of the picture's edge that the longer side of the body's box takes, as in the training pictures."""


@dataclass(frozen=True)
class SideViews:
    """Labels, depths and points of a body in views from its four sides.

    labels : (4, H, W) uint8, body parts (extras as the part that they cover), 0 where nothing is visible
    shown : (4, H, W) uint8, parts as they are, extras too
    depth : (4, H, W) float32, VIEW z, FIGURE units, -inf where nothing is visible
    points : (4, H, W, 3) float32, FIGURE; zeros where nothing is visible
    centre : (2,) FIGURE x, y in the middle of the front picture
    pitch : FIGURE units per pixel of the front picture
    """

    labels: NDArray[np.uint8]
    shown: NDArray[np.uint8]
    depth: NDArray[np.float32]
    points: NDArray[np.float32]
    centre: tuple[float, float]
    pitch: float

    @property
    def half(self) -> float:
        """Half the edge of the front picture, FIGURE units; the unit of `places`."""
        return float(self.pitch * self.labels.shape[1] / 2)

    def places(self) -> NDArray[np.float32]:
        """(4, H, W, 2) x, y of each point in the front picture, edges at -1 and 1, y down."""
        return np.asarray((self.points[..., :2] - np.array(self.centre)) / self.half * [1.0, -1.0], np.float32)


def trace_sides(body: Body, pose: Pose3D, size: int = SIZE) -> SideViews:
    """Trace the four sides of a body, each as large as fits."""
    bounds = body.bounds().astype(np.float64)
    centre = bounds.mean(axis=0)
    labels, shown, depths, points, pitches = [], [], [], [], []
    for yaw in VIEW_YAW_DEG.values():
        turn = axes(yaw)
        extent = np.abs(turn) @ (bounds[1] - bounds[0])
        pitch = side_pitch(bounds, yaw, size)
        hits = trace(
            body,
            orthographic(yaw, size=(size, size), height=pitch * size, centre=centre, distance=float(extent[2])),
            with_normals=False,
        )
        part_index = images(hits, (size, size)).part_index
        there = part_index >= 0
        place = np.where(there[..., None], hits.points.reshape(size, size, 3), np.float32(0))
        part = np.where(there, body.labels[np.maximum(part_index, 0)], np.uint8(0))
        labels.append(body_labels(part, place, pose))
        shown.append(part)
        depths.append(np.where(there, place @ turn[2].astype(np.float32), -np.inf).astype(np.float32))
        points.append(place)
        pitches.append(pitch)
    middle = (float(centre[0]), float(centre[1]))
    return SideViews(np.stack(labels), np.stack(shown), np.stack(depths), np.stack(points), middle, pitches[0])


def side_pitch(bounds: NDArray[np.float64], yaw: float, size: int) -> float:
    """Edge of a pixel in the picture of a side, FIGURE units; bounds : (2, 3) of the body."""
    extent = np.abs(axes(yaw)) @ (bounds[1] - bounds[0])
    return float(extent[:2].max()) / (FILLED * size)


def body_labels(labels: NDArray[np.uint8], points: NDArray[np.floating], pose: Pose3D) -> NDArray[np.uint8]:
    """Replace the labels of extras by body parts: networks were trained on bodies in clothes, not on clothes.

    Hair and hats count as head; cloth as what it covers: the trunk, or below the hips the leg of its side; what is
    carried as nothing.
    """
    joints = pose.joints
    result = np.where(labels == PART["hair"], np.uint8(PART["head"]), labels)
    cloth = labels == PART["garment"]
    if cloth.any():
        hips = joints[[JOINT["l_hip"], JOINT["r_hip"]], :2].mean(axis=0)
        knees = joints[[JOINT["l_knee"], JOINT["r_knee"]], 1].mean()
        # The figure's left is to the right from the viewer's side, unless its back is drawn.
        mirrored = joints[JOINT["l_hip"], 0] < joints[JOINT["r_hip"], 0]
        left = (points[..., 0] > hips[0]) != mirrored
        leg = [np.where(left, PART[f"l_{kind}_leg"], PART[f"r_{kind}_leg"]) for kind in ("upper", "lower")]
        covered = np.where(points[..., 1] > hips[1], PART["torso"], np.where(points[..., 1] > knees, *leg))
        result = np.where(cloth, covered, result)
    return np.where(labels == PART["prop"], np.uint8(0), result).astype(np.uint8)
