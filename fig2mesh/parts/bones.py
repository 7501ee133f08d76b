"""Bones that a layer's middle surface follows: points of the drawing, their depths and their slopes in depth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.limbs import Limb
from fig2mesh.parts.split import Split, head_radius
from fig2mesh.skeleton import JOINT

MAX_SLOPE = 1.4
"""Largest slope in depth of a bone (54 degrees); a steeper one makes its layer no thicker."""

MAX_CLOTH_SLOPE = 0.12
"""Largest slope in depth of cloth that hangs down."""

SPINE_STEP = 0.05
"""Rows of a garment between two points of its middle, FIGURE units."""

SHRUG = 0.5
"""Share of the depth between shoulder joint and thorax by which shoulders are moved towards the thorax."""

AT_HEM = 0.35
"""A leg leaves its garment within this share of half its width from the middle."""


@dataclass(frozen=True)
class Bones:
    """Points that define the depth of a layer.

    points : (N, 2) float64, FIGURE x, y
    depth : (N,) float64, FIGURE z
    slope2 : (N,) float64, squared change of depth along the bone for each unit of its drawn length
    """

    points: NDArray[np.float64]
    depth: NDArray[np.float64]
    slope2: NDArray[np.float64]

    @staticmethod
    def of(limb: Limb) -> Bones:
        return Bones(limb.points, limb.depth, slopes2(limb.points, limb.depth))

    def __add__(self, other: Bones) -> Bones:
        return Bones(
            np.concatenate([self.points, other.points]),
            np.concatenate([self.depth, other.depth]),
            np.concatenate([self.slope2, other.slope2]),
        )


def slopes2(points: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) squared slope in depth along a chain, at most `MAX_SLOPE` squared."""
    if len(points) < 2:
        return np.zeros(len(points))
    length = np.linalg.norm(np.gradient(points, axis=0), axis=1)
    return np.asarray(np.minimum((np.gradient(depth) / np.maximum(length, 1e-6)) ** 2, MAX_SLOPE**2))


def core_bones(canvas: Canvas, divided: Split, joints: NDArray[np.float64]) -> Bones:
    """Bones of the trunk, the head, the limbs that lie free of them, and the middle of a garment round the legs."""
    in_core = [limb for limb in divided.limbs if all(limb is not layer.limb for layer in divided.layers)]
    # Under cloth that hangs about both legs nothing shows which hip is in front.
    hips = () if divided.garment.any() else ("l_hip", "r_hip")
    corners = joints[[JOINT[n] for n in ("neck", "l_shoulder", "r_shoulder", *hips)]]
    # The chest is less turned than the line through the shoulders, which arms take along.
    corners[1:3, 2] += SHRUG * (joints[JOINT["thorax"], 2] - corners[1:3, 2])
    spine = np.linspace(joints[JOINT["thorax"]], joints[JOINT["pelvis"]], 7)
    trunk = np.concatenate([corners, spine])
    lean = slopes2(spine[:, :2], spine[:, 2])
    bones = Bones(trunk[:, :2], trunk[:, 2], np.concatenate([np.zeros(len(corners)), lean]))
    bones += _head(canvas, joints)
    for limb in in_core:
        bones += Bones.of(limb)
    if divided.garment.any():
        bones += _garment(canvas, divided, joints)
    return bones


def _head(canvas: Canvas, joints: NDArray[np.float64]) -> Bones:
    """Bones of the head, a ball: all of it lies as deep as its middle, however the neck leans."""
    middle = joints[JOINT["head"]]
    radius = 0.7 * head_radius(canvas, joints)
    angle = np.arange(8) * (np.pi / 4)
    ring = middle[:2] + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.concatenate([middle[None, :2], ring])
    return Bones(points, np.full(len(points), middle[2]), np.zeros(len(points)))


def hem_depth(divided: Split, joints: NDArray[np.float64], waist: float, drop: float) -> float:
    """FIGURE z of the middle of a garment's hem: over the legs that come out of it, but cloth hangs nearly plumb.

    waist : FIGURE z of its top; drop : its height, FIGURE units
    """
    below = [limb.depth[0] for limb in divided.limbs if limb.cloth]
    if not below:
        return waist
    return float(np.clip(np.mean(below), waist - MAX_CLOTH_SLOPE * drop, waist + MAX_CLOTH_SLOPE * drop))


def _garment(canvas: Canvas, divided: Split, joints: NDArray[np.float64]) -> Bones:
    rows = np.flatnonzero(divided.garment.any(axis=1))
    step = max(1, round(SPINE_STEP / canvas.pitch))
    points = canvas.points()
    high, low = points[rows[0], 0, 1], points[rows[-1], 0, 1]
    waist = float(np.mean([joints[JOINT["l_hip"], 2], joints[JOINT["r_hip"], 2]]))
    hem = hem_depth(divided, joints, waist, high - low)
    places, depths = [], []
    for row in rows[step // 2 :: step]:
        columns = np.flatnonzero(divided.garment[row])
        chosen = columns[[len(columns) // 6, len(columns) // 2, len(columns) * 5 // 6]]
        places.append(points[row, chosen])
        down = (high - points[row, 0, 1]) / max(high - low, 1e-9)
        depths.append(np.full(3, waist + down * (hem - waist)))
    if not places:
        return Bones(np.zeros((0, 2)), np.zeros(0), np.zeros(0))
    return Bones(np.concatenate(places), np.concatenate(depths), np.zeros(3 * len(places)))


def out_of_cloth(limb: Limb, canvas: Canvas, divided: Split, joints: NDArray[np.float64]) -> Limb:
    """Move a leg that comes out of a garment in depth to where it can hang out of it."""
    rows = np.flatnonzero(divided.garment.any(axis=1))
    if not limb.cloth or not len(rows):
        return limb
    points = canvas.points()
    drop = float(points[rows[0], 0, 1] - points[rows[-1], 0, 1])
    waist = float(np.mean([joints[JOINT["l_hip"], 2], joints[JOINT["r_hip"], 2]]))
    hem = hem_depth(divided, joints, waist, drop)
    width = canvas.pitch * float(np.median(divided.garment[rows[-len(rows) // 4 :]].sum(axis=1)))
    room = AT_HEM * width / 2
    there = float(np.clip(limb.depth[0], hem - room, hem + room))
    return replace(limb, depth=limb.depth + there - limb.depth[0])
