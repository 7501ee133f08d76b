"""The eight kinds of body part, their anchor joints and the PART frame (paper §4.2)."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fig2mesh.records import BODY_PARTS, JOINT, JOINT_NAMES, PART_NAMES

KINDS: Final = ("torso", "head", "upper_arm", "lower_arm", "hand", "upper_leg", "lower_leg", "foot")

PART_KIND: Final = {part: PART_NAMES[part].removeprefix("l_").removeprefix("r_") for part in BODY_PARTS}
"""Part label → kind."""

MIRRORED: Final = {part: PART_NAMES[part].startswith("r_") for part in BODY_PARTS}
"""Part label → whether its network sees it in the mirror: the left side is the one they learn."""

ANCHORS: Final = {
    "torso": ("l_shoulder", "r_shoulder", "l_hip", "r_hip"),
    "head": ("neck", "head"),
    "upper_arm": ("l_shoulder", "l_elbow"),
    "lower_arm": ("l_elbow", "l_wrist"),
    "hand": ("l_wrist", "l_hand"),
    "upper_leg": ("l_hip", "l_knee"),
    "lower_leg": ("l_knee", "l_ankle"),
    "foot": ("l_ankle", "l_foot"),
}
"""Kind → the joints that tell where it is, of the left side: two a part, four for the torso (§4.2)."""

JOINT_MIRROR: Final = tuple(JOINT_NAMES.index({"l_": "r_", "r_": "l_"}.get(n[:2], n[:2]) + n[2:]) for n in JOINT_NAMES)
"""Index of the same joint on the other side."""


def anchor_joints(part: int) -> tuple[int, ...]:
    """Joint indices of a part's anchors, in the order in which its network takes them.

    A right part's are those of the left part's mirror image.
    """
    joints = tuple(JOINT[name] for name in ANCHORS[PART_KIND[part]])
    return tuple(JOINT_MIRROR[joint] for joint in joints) if MIRRORED[part] else joints


def part_centre(part: int, joints: NDArray[np.floating]) -> NDArray[np.float64]:
    """(..., 3) centre of the PART frame: the mean of the anchors, for the head the head joint.

    joints : (..., 21, 3), any frame with the axes of FIGURE
    """
    chosen = [JOINT["head"]] if PART_KIND[part] == "head" else list(anchor_joints(part))
    return np.asarray(np.asarray(joints, np.float64)[..., chosen, :].mean(axis=-2))
