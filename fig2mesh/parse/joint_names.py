"""Names of the 21 joints in annotation tools and data sets, and joints derived from others."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import JOINT_NAMES

Point = NDArray[np.float64]

# fmt: off
SYNONYMS: dict[str, str] = {
    "mid_eyes": "eyes", "eye_center": "eyes", "eye_centre": "eyes",
    "head_center": "head", "head_centre": "head",
    "chest": "thorax", "upper_chest": "thorax", "spine": "thorax", "upper_neck": "neck",
    "hip": "pelvis", "hips": "pelvis", "mid_hip": "pelvis", "root": "pelvis",
    "palm": "hand", "fingers": "hand", "finger": "hand", "middle_finger": "hand", "index": "hand",
    "toe": "foot", "toes": "foot", "big_toe": "foot", "foot_index": "foot",
}
# fmt: on
"""Synonyms of joint names, without their side. A hip with a side is the hip, one without the pelvis."""

KNOWN = frozenset(JOINT_NAMES) | {"nose", "l_eye", "r_eye", "l_ear", "r_ear"}
"""Known names: the joints, and the points from which head and eyes are derived."""

HAND_LENGTH = 0.35
"""Distance from the wrist to the middle of the hand, share of the lower arm's length (mean of the training poses)."""

FOOT_LENGTH = 0.3
"""Distance from ankle to toes, share of the lower leg's length; along the leg where the foot's direction is unknown."""


def canonical(name: str) -> str:
    """Canonical name of a joint: "Left Shoulder", "leftShoulder", "shoulder_l" → "l_shoulder"."""
    words = re.sub(r"([a-z])([A-Z])", r"\1_\2", name.strip())
    parts = [word for word in re.split(r"[^a-z0-9]+", words.lower()) if word]
    side = ""
    for word in ("left", "right", "l", "r"):
        if word in parts and len(parts) > 1:
            parts.remove(word)
            side = word[0] + "_"
            break
    bare = "_".join(parts)
    if side == "" and bare in JOINT_NAMES:
        return bare
    if side and bare in ("hip", "hips"):
        return side + "hip"
    return side + SYNONYMS.get(bare, bare)


def completed(points: Mapping[str, Point]) -> dict[str, Point]:
    """Derive joints from others: COCO has no neck, no hands and no feet, but their positions follow from the rest.

    points : known names (`KNOWN`) → (2,) IMAGE
    returns : only missing joints that could be derived
    """
    known = dict(points)
    new: dict[str, Point] = {}

    def put(name: str, value: Point | None) -> None:
        if value is not None and name not in known:
            known[name] = new[name] = value

    def middle(*names: str) -> Point | None:
        there = [known[name] for name in names if name in known]
        return np.mean(there, axis=0) if len(there) == len(names) else None

    def beyond(start: str, end: str, share: float) -> Point | None:
        if start not in known or end not in known:
            return None
        return known[end] + share * (known[end] - known[start])

    put("pelvis", middle("l_hip", "r_hip"))
    shoulders = middle("l_shoulder", "r_shoulder")
    put("eyes", middle("l_eye", "r_eye"))
    put("eyes", known.get("nose"))
    put("head", middle("l_ear", "r_ear"))
    put("head", known.get("eyes"))
    if shoulders is not None and "pelvis" in known:
        put("thorax", shoulders + 0.15 * (known["pelvis"] - shoulders))
    put("eyes", known.get("head"))
    if shoulders is not None and "head" in known:
        put("neck", shoulders + 0.3 * (known["head"] - shoulders))
    for side in ("l_", "r_"):
        put(side + "hand", beyond(side + "elbow", side + "wrist", HAND_LENGTH))
        put(side + "foot", beyond(side + "knee", side + "ankle", FOOT_LENGTH))
    return {name: value for name, value in new.items() if name in JOINT_NAMES}
