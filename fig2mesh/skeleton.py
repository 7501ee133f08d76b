"""Joints, bones and parts of the figure, each table once; the PART frame (paper §3, §4.2).

Left and right are the figure's own. Tables of pairs give the left side before the right one, as `JOINT_NAMES` and
`PART_NAMES` do. The commands read names from here, so importing this module loads only the standard library.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

FIGURE_HEIGHT: Final = 1.79
"""Height of every figure, units (and metres by default); paper §4.1, "uniformly to 1.79m"."""

SIDES: Final = ("l", "r")

# fmt: off
JOINT_NAMES: Final = (
    "head", "eyes", "neck", "thorax", "pelvis",
    "l_shoulder", "r_shoulder", "l_elbow", "r_elbow", "l_wrist", "r_wrist", "l_hand", "r_hand",
    "l_hip", "r_hip", "l_knee", "r_knee", "l_ankle", "r_ankle", "l_foot", "r_foot",
)
# fmt: on
"""The 21 joints of paper §3."""

JOINT: Final = {name: index for index, name in enumerate(JOINT_NAMES)}

# fmt: off
PART_NAMES: Final = (
    "none", "torso", "head",
    "l_upper_arm", "r_upper_arm", "l_lower_arm", "r_lower_arm", "l_hand", "r_hand",
    "l_upper_leg", "r_upper_leg", "l_lower_leg", "r_lower_leg", "l_foot", "r_foot",
    "hair", "garment", "prop",
)
# fmt: on
"""Part labels: 0 nothing, 1-14 the body parts of paper §3, 15 and above extras."""

PART: Final = {name: index for index, name in enumerate(PART_NAMES)}
BODY_PARTS: Final = range(1, 15)


def without_side(name: str) -> str:
    """Name of a joint, part or bone without its side: "l_elbow" → "elbow"."""
    return name.removeprefix("l_").removeprefix("r_")


def other_side(name: str) -> str:
    """Name of the same joint, part or bone on the other side; that of one on the midline is its own."""
    return {"l_": "r_", "r_": "l_"}.get(name[:2], name[:2]) + name[2:]


JOINT_MIRROR: Final = tuple(JOINT[other_side(name)] for name in JOINT_NAMES)
"""Index of the same joint on the other side."""

PART_MIRROR: Final = tuple(PART[other_side(name)] for name in PART_NAMES)
"""Label of the same part on the other side."""

LIMBS: Final = ("l_arm", "r_arm", "l_leg", "r_leg")

LIMB_JOINTS: Final = {"arm": ("shoulder", "elbow", "wrist", "hand"), "leg": ("hip", "knee", "ankle", "foot")}
"""Kind of limb → its joints from the body outwards."""

LIMB_PARTS: Final = {"arm": ("upper_arm", "lower_arm", "hand"), "leg": ("upper_leg", "lower_leg", "foot")}
"""Kind of limb → its parts from the body outwards; each spans two joints of `LIMB_JOINTS`."""

LIMB_BONES: Final = {
    part: bone
    for limb, parts in LIMB_PARTS.items()
    for part, bone in zip(parts, pairwise(LIMB_JOINTS[limb]), strict=True)
}
"""Kind of a limb's part → the joints at its ends, the nearer one to the body first."""

_TRUNK: Final = (("head", "eyes"), ("head", "neck"), ("neck", "thorax"), ("thorax", "pelvis"))

BONES: Final = (
    *_TRUNK,
    *(
        (start if start in JOINT else f"{side}_{start}", f"{side}_{end}")
        for side in SIDES
        for root, limb in (("thorax", "arm"), ("pelvis", "leg"))
        for start, end in pairwise((root, *LIMB_JOINTS[limb]))
    ),
)
"""The 20 bones as pairs of joint names: the trunk from the head down, the left side's, the right side's."""

KINDS: Final = tuple(dict.fromkeys(without_side(PART_NAMES[part]) for part in BODY_PARTS))
"""The eight kinds of body part, from the torso to the foot."""

PART_KIND: Final = {part: without_side(PART_NAMES[part]) for part in BODY_PARTS}
"""Part label → kind."""

MIRRORED: Final = {part: PART_NAMES[part].startswith("r_") for part in BODY_PARTS}
"""Part label → whether its network gets it mirrored: networks are trained on the left side."""

PART_NEIGHBOURS: Final = frozenset(
    frozenset((PART[first], PART[second]))
    for chain in (
        ("torso", "head"),
        *(("torso", *(f"{side}_{part}" for part in parts)) for parts in LIMB_PARTS.values() for side in SIDES),
    )
    for first, second in pairwise(chain)
)
"""Pairs of labels of the body parts that meet at a joint."""

ANCHORS: Final = {
    "torso": ("l_shoulder", "r_shoulder", "l_hip", "r_hip"),
    "head": ("neck", "head"),
    **{part: (f"l_{start}", f"l_{end}") for part, (start, end) in LIMB_BONES.items()},
}
"""Kind → the joints that locate it, of the left side: two for each part, four for the torso (§4.2)."""

# fmt: off
STANDING: Final = {
    "head": (0.0, 0.07), "eyes": (0.0, 0.065), "neck": (0.0, 0.15), "thorax": (0.0, 0.21), "pelvis": (0.0, 0.5),
    "shoulder": (0.11, 0.19), "elbow": (0.16, 0.34), "wrist": (0.18, 0.48), "hand": (0.185, 0.52),
    "hip": (0.06, 0.52), "knee": (0.065, 0.73), "ankle": (0.07, 0.95), "foot": (0.085, 0.985),
}
# fmt: on
"""Joint without its side → its position in a standing person from the front, in heights: (from the midline towards
the joint's own side, down from the crown)."""

# fmt: off
LABEL_COLOURS: Final = (
    (0, 0, 0), (230, 159, 0), (240, 228, 66), (86, 180, 233), (0, 114, 178), (120, 200, 240), (60, 90, 200),
    (170, 220, 255), (110, 130, 230), (0, 158, 115), (204, 121, 167), (110, 200, 120), (230, 150, 190), (170, 230, 150),
    (250, 190, 215), (120, 80, 40), (213, 94, 0), (150, 150, 150),
)
# fmt: on
"""Colour of each label in flat label pictures and on the annotation page, sRGB: arms blue; left legs green, right ones
pink."""

# fmt: off
PART_COLOURS: Final = (
    (160, 160, 160), (203, 171, 96), (233, 150, 122),
    (76, 145, 203), (118, 190, 98), (44, 104, 168), (74, 150, 62), (144, 196, 232), (170, 224, 150),
    (132, 104, 188), (206, 104, 148), (98, 68, 156), (168, 62, 110), (180, 158, 222), (236, 164, 194),
    (120, 80, 50), (70, 160, 160), (96, 96, 104),
)
# fmt: on
"""Colour of each label on rendered surfaces, sRGB, to be shaded: one hue for each limb, darker downwards, light hands
and feet."""


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
    centre: NDArray[np.float64] = joints.astype("float64")[..., chosen, :].mean(axis=-2)
    return centre
