"""Depth order of limbs as given by the user: it is ambiguous in a single view, but not to a person."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fig2mesh.records import DepthOrder, Pose3D
from fig2mesh.skeleton import JOINT, LIMB_JOINTS

MIN_DEPTH = {"elbow": 0.10, "wrist": 0.20, "hand": 0.22, "knee": 0.08, "ankle": 0.10, "foot": 0.10}
"""Least distance in depth of a joint from the root of its limb, FIGURE units. Half a chest is 0.12 deep."""


def ordered(pose: Pose3D, order: Mapping[str, DepthOrder]) -> Pose3D:
    """Move the limbs of `order` in front of or behind the body.

    order : limb (`fig2mesh.skeleton.LIMBS`) → "front" or "behind"

    From the front a bone that leans towards the viewer looks like one that leans away by as much; each bone of the
    limb gets the requested sign, and where it hardly leans, enough depth to be clear of the body. x and y stay.
    """
    if not order:
        return pose
    joints = pose.joints.copy()
    for limb, where in order.items():
        side, kind = limb.split("_")
        sign = 1.0 if where == "front" else -1.0
        chain = [JOINT[f"{side}_{name}"] for name in LIMB_JOINTS[kind]]
        root = pose.joints[chain[0], 2]
        leans = np.abs(np.diff(pose.joints[chain, 2]))
        for joint, name, lean in zip(chain[1:], LIMB_JOINTS[kind][1:], np.cumsum(leans), strict=True):
            joints[joint, 2] = root + sign * max(float(lean), MIN_DEPTH[name])
    return Pose3D(joints)
