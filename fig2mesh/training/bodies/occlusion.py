"""Occlusion of joints by a body of capsules."""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor

from fig2mesh.skeleton import JOINT, JOINT_NAMES

AVERTED: Final = 0.3
"""A head whose eyes lie further behind its middle than this share of their distance is seen from behind."""


def occluded(joints: Tensor, stoutness: Tensor) -> Tensor:
    """(N, 21) bool: joints occluded by a body of capsules, and the eyes of averted heads.

    joints : (N, 21, 3), z to the viewer; stoutness : (N,) factor of the capsules' usual radii
    """
    start, end = joints[:, list(_STARTS)], joints[:, list(_ENDS)]
    radius = joints.new_tensor(_RADII) * stoutness[:, None]
    along = end - start
    flat = along[..., :2]
    offset = joints[:, :, None, :2] - start[:, None, :, :2]
    t = (offset * flat[:, None]).sum(dim=3) / flat.square().sum(dim=2).clamp_min(1e-6)[:, None]
    t = t.clamp(0, 1)
    away2 = (offset - t[..., None] * flat[:, None]).square().sum(dim=3)
    rise2 = radius.square()[:, None] - away2
    front = start[:, None, :, 2] + t * along[:, None, :, 2] + rise2.clamp_min(0).sqrt()
    own = joints[..., 2] + joints.new_tensor(_JOINT_RADII) * stoutness[:, None]
    other = ~torch.tensor(_OWN, device=joints.device)
    hidden = ((rise2 > 0) & other & (front > own[..., None])).any(dim=2)
    face = joints[:, JOINT["eyes"]] - joints[:, JOINT["head"]]
    hidden[:, JOINT["eyes"]] |= face[:, 2] < -AVERTED * face.norm(dim=1)
    return hidden


_TRUNK_JOINTS: Final = ("thorax", "pelvis", "neck", "l_shoulder", "r_shoulder", "l_hip", "r_hip")


# fmt: off
_CAPSULES: Final = (  # two joints and the usual radius, FIGURE units
    ("thorax", "pelvis", 0.11), ("l_shoulder", "r_shoulder", 0.07), ("l_hip", "r_hip", 0.09),
    ("l_shoulder", "l_hip", 0.07), ("r_shoulder", "r_hip", 0.07), ("neck", "head", 0.09),
    *((f"{side}_{first}", f"{side}_{second}", radius) for side in "lr" for first, second, radius in (
        ("shoulder", "elbow", 0.05), ("elbow", "wrist", 0.04), ("wrist", "hand", 0.04), ("hip", "knee", 0.075),
        ("knee", "ankle", 0.055), ("ankle", "foot", 0.045),
    )),
)
# fmt: on


_STARTS: Final = tuple(JOINT[first] for first, _, _ in _CAPSULES)


_ENDS: Final = tuple(JOINT[second] for _, second, _ in _CAPSULES)


_RADII: Final = tuple(radius for _, _, radius in _CAPSULES)


# fmt: off
_JOINT_RADII: Final = tuple(
    min(radius for first, second, radius in _CAPSULES if name in (first, second))
    if any(name in capsule for capsule in _CAPSULES) else 0.09
    for name in JOINT_NAMES
)
# fmt: on


_OWN: Final = tuple(
    tuple(
        name in (first, second)
        or (name in _TRUNK_JOINTS and first in _TRUNK_JOINTS and second in (*_TRUNK_JOINTS, "head"))
        or (name == "eyes" and second == "head")
        for first, second, _ in _CAPSULES
    )
    for name in JOINT_NAMES
)
"""(21, capsules) True where a capsule belongs to a joint and so cannot occlude it."""
