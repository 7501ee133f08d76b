"""Depth of the joints by the network of paper §4.1; x and y stay as drawn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fig2mesh.counters import count
from fig2mesh.image_frame import ImageFrame
from fig2mesh.records import Figure, Pose3D
from fig2mesh.skeleton import JOINT, LIMB_JOINTS

STRAIGHT = 0.8
"""Threshold, share of a leg's length by which it reaches down if the figure stands on it; a seated figure does not."""

MAX_LEAN = 0.35
"""Largest lean that is removed, depth per height: 19 degrees."""

WEIGHTS = {"head": 0.1, "thorax": 0.45, "pelvis": 0.45}
"""Joint → approximate share of the body's weight about it."""


def lift_by_network(figure: Figure, frame: ImageFrame) -> Pose3D:
    """Joints in FIGURE: x and y exactly as drawn, z from the shipped network, 0 at the pelvis."""
    from fig2mesh.nets.pose_lift import POSE_WEIGHTS, SHIPPED, lift_joints

    count("pose network")
    drawn = np.asarray(frame.figure_from_image(figure.joints_px), np.float32)
    joints = lift_joints(POSE_WEIGHTS.shipped(SHIPPED), drawn, figure.visible if SHIPPED.visibility else None)
    return Pose3D(upright(joints))


def upright(joints: NDArray[np.float32]) -> NDArray[np.float32]:
    """(21, 3) joints of a standing figure without its lean towards or away from the viewer, FIGURE; others unchanged.

    From the front, a figure that leans by some degrees looks like one that does not, so the network cannot infer it,
    but nobody draws people falling over. The weight is brought over the foot on which the figure stands, by a shear, so
    that x and y stay.
    """
    legs = [[joints[JOINT[f"{side}_{name}"]] for name in LIMB_JOINTS["leg"]] for side in "lr"]
    hip, knee, ankle, foot = min(legs, key=lambda leg: float(leg[2][1]))
    length = float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))
    if hip[1] - ankle[1] < STRAIGHT * length or length < 1e-6:
        return joints
    both = abs(legs[0][2][1] - legs[1][2][1]) < 0.15 * length
    support = np.mean([(leg[2] + leg[3]) / 2 for leg in legs], axis=0) if both else (ankle + foot) / 2
    weight = np.sum([share * joints[JOINT[name]] for name, share in WEIGHTS.items()], axis=0)
    lean = float((weight[2] - support[2]) / max(float(weight[1] - support[1]), 1e-6))
    lean = float(np.clip(lean, -MAX_LEAN, MAX_LEAN))
    result = joints.copy()
    result[:, 2] -= lean * (joints[:, 1] - joints[JOINT["pelvis"], 1])
    return result
