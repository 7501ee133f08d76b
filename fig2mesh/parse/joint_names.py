"""Names of the 21 joints in annotation tools, pose estimators and rigs, and joints derived from others."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import JOINT_NAMES

Point = NDArray[np.float64]

# fmt: off
WORDS: Final[dict[str, tuple[str, ...]]] = {
    "head": ("head", "headcenter", "headcentre", "skull"),
    "eyes": ("eyes", "mideyes", "eyecenter", "eyecentre"),
    "neck": ("neck", "upperneck", "neckbase", "neck1", "neck01"),
    "thorax": (
        "thorax", "chest", "upperchest", "midshoulder", "shouldercenter", "spineshoulder", "spinechest", "spine3",
        "spine03", "spine2", "spine02", "sternum", "spine1", "spine01", "spine",
    ),
    "pelvis": (
        "pelvis", "hips", "midhip", "hip", "root", "hipcenter", "hipcentre", "centerhip", "spinebase", "crotch",
    ),
    "shoulder": ("upperarm", "arm", "shoulder"),
    "elbow": ("elbow", "forearm", "lowerarm"),
    "wrist": ("wrist",),
    "hand": ("hand", "palm", "middlefinger", "fingers", "finger", "index", "handtip", "handmiddle1"),
    "hip": ("upleg", "upperleg", "thigh", "hip", "hips"),
    "knee": ("knee", "lowerleg", "calf", "shin", "leg"),
    "ankle": ("ankle",),
    "foot": ("foot", "bigtoe", "footindex", "toe", "toes", "toebase", "ball"),
    "nose": ("nose", "necknose"),
    "eye": ("eye",),
    "ear": ("ear",),
    "head_top": ("headtop", "headtopend", "topofhead", "tophead"),
}
# fmt: on
"""Point → its names without side and separators, the preferred one first.

Names of bones come before those of joints: a rig that has an upper arm calls the collar bone "shoulder"."""

ONLY_WITH: Final = {
    "arm": ("forearm",),
    "leg": ("upleg", "upperleg", "thigh"),
}
"""Names that mean a joint only in a rig, which has one of these as well; elsewhere they are whole limbs."""

PAIRED: Final = ("shoulder", "elbow", "wrist", "hand", "hip", "knee", "ankle", "foot", "eye", "ear")

NAMESPACE: Final = re.compile(r"^(mixamorig\d*|bip\d*|jbip|ccbase|def|org|jnt|joint|kp|person|body|c)$")
"""Prefixes of rigs and tools; Mixamo, 3ds Max, VRoid, Character Creator, Rigify."""

TIPS: Final = {"wrist": "hand", "ankle": "foot"}
"""Joint → the point whose name stands for it where the joint itself is absent: hands and feet of rigs and of Human3.6M
begin at the wrist and the ankle."""

KNOWN: Final = frozenset(JOINT_NAMES) | {"nose", "l_eye", "r_eye", "l_ear", "r_ear", "head_top"}
"""Known names: the joints, and the points from which head and eyes are derived."""

HAND_LENGTH = 0.35
"""Distance from the wrist to the middle of the hand, share of the lower arm's length (mean of the training poses)."""

FOOT_LENGTH = 0.3
"""Distance from ankle to toes, share of the lower leg's length; along the leg where the foot's direction is unknown."""

HEAD_SHARE = 0.53
"""Height of the middle of the head above the neck, share of that of the crown (as in `STANDING`)."""

_ALL_WORDS: Final = frozenset(word for words in WORDS.values() for word in words)


def split(name: str) -> tuple[str, str]:
    """Side ("l_", "r_" or "") and bare name of a point: "mixamorig:LeftArm" → ("l_", "arm")."""
    words = re.split(r"[:|/]", name.strip())[-1]
    words = re.sub(r"(^|[^A-Za-z])([LR])([A-Z][a-z])", r"\1\2_\3", words)
    words = re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", words)
    parts = [word for word in re.split(r"[^a-z0-9]+", words.lower()) if word]
    if len(parts) > 2 and parts[0] == "j" and parts[1] == "bip":
        parts = parts[2:]
    if len(parts) > 2 and parts[:2] == ["cc", "base"]:
        parts = parts[2:]
    while len(parts) > 1 and NAMESPACE.match(parts[0]):
        parts = parts[1:]
    side = ""
    for word in ("left", "right", "l", "r"):
        if word in parts and len(parts) > 1:
            parts.remove(word)
            side = word[0] + "_"
            break
    bare = "".join(parts)
    if not side and bare not in _ALL_WORDS:
        for prefix in ("left", "right", "l", "r"):  # lshoulder, RKNEE
            if bare.startswith(prefix) and bare[len(prefix) :] in _ALL_WORDS:
                return prefix[0] + "_", bare[len(prefix) :]
    if not side and not parts:
        return "", name.strip().lower()
    return side, bare if side or bare in _ALL_WORDS else "_".join(parts)


def ranked(name: str) -> tuple[str, int]:
    """Canonical name of a point, and its rank among the names of that point: 0 is preferred; unknown ones have 0."""
    side, bare = split(name)
    for point, words in WORDS.items():
        if bare in words and (point in PAIRED) == bool(side):
            return side + point, words.index(bare)
    return side + bare, 0


def canonical(name: str) -> str:
    """Canonical name of a point: "Left Shoulder", "LShoulder", "mixamorig:LeftArm" → "l_shoulder"."""
    return ranked(name)[0]


class Repeated(ValueError):
    """Two points of one name."""


def meanings(names: Sequence[str], others: Sequence[str] = ()) -> tuple[dict[str, int], tuple[str, ...]]:
    """Points that the names of one figure stand for.

    others : names of the same skeleton whose points have not been annotated
    returns : known point → index of the name that is preferred for it; names that stand for no point

    Raises Repeated where one name stands twice.
    """
    bare = [split(name)[1] for name in (*names, *others)]
    absent = {canonical(name) for name in others}
    found: dict[str, tuple[int, int]] = {}
    unknown: list[str] = []
    for index, name in enumerate(names):
        point, rank = ranked(name)
        needs = ONLY_WITH.get(bare[index])
        if point not in KNOWN or (needs and not any(word in bare for word in needs)):
            unknown.append(name)
        elif point not in found or rank < found[point][0]:
            found[point] = rank, index
        elif rank == found[point][0]:
            raise Repeated(point)
    chosen = {point: index for point, (_, index) in found.items()}
    for side in ("l_", "r_"):
        for joint, tip in TIPS.items():
            # Only a point named hand or foot is where the limb's last part begins; toes and fingers are where it ends.
            at = chosen.get(side + tip)
            if side + joint in chosen or side + joint in absent or at is None or bare[at] != tip:
                continue
            chosen[side + joint] = at
            ends = [
                (rank, index)
                for index, name in enumerate(names)
                for point, rank in [ranked(name)]
                if point == side + tip and index != at
            ]
            chosen.pop(side + tip)
            if ends:
                chosen[side + tip] = min(ends)[1]
    return chosen, tuple(unknown)


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
    if "head_top" in known and "neck" in known:
        put("head", known["neck"] + HEAD_SHARE * (known["head_top"] - known["neck"]))
    put("eyes", known.get("head"))
    if shoulders is not None and "head" in known:
        put("neck", shoulders + 0.3 * (known["head"] - shoulders))
    for side in ("l_", "r_"):
        put(side + "hand", beyond(side + "elbow", side + "wrist", HAND_LENGTH))
        put(side + "foot", beyond(side + "knee", side + "ankle", FOOT_LENGTH))
    return {name: value for name, value in new.items() if name in JOINT_NAMES}
