"""Depth of the joints without a network: foreshortened limbs lean the way limbs usually do.

A limb drawn shorter than its twin leans towards the viewer or away; the amount follows from its length, the direction
from anatomy: knees and forearms come forward, shins go back. Joints that the drawing hides go behind the body.
"""

from __future__ import annotations

import math

import numpy as np

from fig2mesh.image_frame import ImageFrame
from fig2mesh.records import Figure, Pose3D
from fig2mesh.skeleton import JOINT, LIMB_BONES

FORESHORTENED = 0.8
"""Threshold, share of the twin's length, below which a limb leans; larger ratios are the draughtsman's liberty."""

DAMPING = 0.7
"""Share of the geometric depth that is used: drawn proportions are not exact."""

MAX_DEPTH_STEP = 0.30
"""Largest depth difference along one bone, FIGURE units."""

EYES_FORWARD = 0.08
FOOT_FORWARD = 0.05


LEANS = {"upper_arm": 1.0, "lower_arm": 1.0, "upper_leg": 1.0, "lower_leg": -1.0}
"""Part → the direction in which its bone leans when foreshortened (+1: to the viewer)."""


def lift(figure: Figure, frame: ImageFrame) -> Pose3D:
    """Joints in FIGURE with a plausible depth.

    x and y are the drawn joints exactly; z is 0 for the torso and follows the rule above along the limbs.
    """
    joints = np.zeros((len(figure.joints_px), 3))
    joints[:, :2] = frame.figure_from_image(figure.joints_px)
    joints[JOINT["eyes"], 2] = EYES_FORWARD
    for side, twin in ("lr", "rl"):
        for part, direction in LEANS.items():
            first, second = LIMB_BONES[part]
            start, end = JOINT[f"{side}_{first}"], JOINT[f"{side}_{second}"]
            own = _length(joints, start, end)
            expected = _length(joints, JOINT[f"{twin}_{first}"], JOINT[f"{twin}_{second}"])
            lean = 0.0
            if own < FORESHORTENED * expected:
                lean = min(DAMPING * math.sqrt(expected**2 - own**2), MAX_DEPTH_STEP) * direction
                if not figure.visible[end] and first == "shoulder":
                    lean = -lean
            joints[end, 2] = joints[start, 2] + lean
        joints[JOINT[f"{side}_hand"], 2] = joints[JOINT[f"{side}_wrist"], 2]
        joints[JOINT[f"{side}_foot"], 2] = joints[JOINT[f"{side}_ankle"], 2] + FOOT_FORWARD
    return Pose3D(joints.astype(np.float32))


def _length(joints: np.ndarray, start: int, end: int) -> float:
    return float(np.linalg.norm(joints[end, :2] - joints[start, :2]))
