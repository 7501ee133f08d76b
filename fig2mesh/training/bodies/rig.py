"""Skinned bodies and poses that fit all of them.

Frame BODY: metres, x to the figure's left, y up, z to its front; axes and handedness are those of FIGURE for a figure
that faces the viewer. A pose holds one rotation per key (`KEYS`), global, from the canonical T-pose: arms along ±x,
legs down, face and feet to +z. A rig adds the smallest rotation from its own rest limb to the canonical one, so that
one pose fits bodies with any rest stance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fig2mesh.records import _Checked
from fig2mesh.skeleton import JOINT_NAMES, other_side

# fmt: off
KEYS: tuple[str, ...] = (
    "hips", "spine1", "spine2", "spine3", "neck", "head",
    "l_clavicle", "r_clavicle", "l_upper_arm", "r_upper_arm", "l_lower_arm", "r_lower_arm", "l_hand", "r_hand",
    "l_upper_leg", "r_upper_leg", "l_lower_leg", "r_lower_leg", "l_foot", "r_foot",
)
# fmt: on
"""Segments that a pose turns; every rig maps each to one of its bones."""

KEY: dict[str, int] = {name: index for index, name in enumerate(KEYS)}

KEY_MIRROR: tuple[int, ...] = tuple(KEY[other_side(name)] for name in KEYS)
"""Index of the same key on the other side."""

# fmt: off
KEY_PARENT: dict[str, str] = {
    "spine1": "hips", "spine2": "spine1", "spine3": "spine2", "neck": "spine3", "head": "neck",
    **{f"{s}_{child}": f"{s}_{parent}" for s in "lr" for child, parent in (
        ("upper_arm", "clavicle"), ("lower_arm", "upper_arm"), ("hand", "lower_arm"),
        ("lower_leg", "upper_leg"), ("foot", "lower_leg"))},
    "l_clavicle": "spine3", "r_clavicle": "spine3", "l_upper_leg": "hips", "r_upper_leg": "hips",
}
# fmt: on
"""Key → its parent key; "hips" has none."""

# fmt: off
T_POSE: NDArray[np.float64] = np.array([
    [-1.0 if name.startswith("r_") else 1.0, 0, 0] if name.endswith(("arm", "hand")) else
    [0, -1.0, 0] if name.endswith("leg") else [0.0, 0, 0] for name in KEYS
])
# fmt: on
"""(20, 3) direction of each limb in the canonical T-pose, BODY; zero for keys whose direction is not a limb's."""


@dataclass(frozen=True)
class PoseSet(_Checked):
    """Poses, one per row.

    clip : (N,) str, "source/clip" that the pose comes from; recombined poses name both, "a+b"
    rotations : (N, 20, 3, 3) float32, BODY: a limb of key k points along rotations[k] @ T_POSE[k]
    curl : (N, 2) float32 radians, bend of each finger joint of the left and the right hand
    """

    clip: NDArray[np.str_]
    rotations: NDArray[np.float32]
    curl: NDArray[np.float32]

    def __post_init__(self) -> None:
        object.__setattr__(self, "clip", np.asarray(self.clip, str))
        count = len(self.clip)
        self._put("rotations", np.float32, (count, len(KEYS), 3, 3))
        self._put("curl", np.float32, (count, 2))


@dataclass(frozen=True)
class Rig(_Checked):
    """One closed, skinned body at rest.

    name : identifier
    vertices : (V, 3) float32, BODY, at rest
    faces : (F, 3) int32, counter-clockwise from outside; a closed manifold
    face_part : (F,) uint8, `PART_NAMES` 1-14
    face_material : (F,) uint8, index into `materials`
    materials : names of materials: "skin", "hair", "hat", "shoe", "eye" or "cloth.<piece>"
    bone_index : (V, 4) int32; bone_weight : (V, 4) float32, rows sum to 1
    parents : (B,) int32, parents come before their children, -1 for a root
    heads : (B, 3) float32, BODY, start of each bone at rest
    key_bone : (20,) int32, bone of each of `KEYS`
    rest_direction : (20, 3) float32, BODY, unit direction of each limb at rest, zero where `T_POSE` is zero
    finger_axis : (B, 3) float32, unit axis about which a finger bone curls (right-handed, positive closes the hand);
        zero for bones that are no fingers
    joint_bone : (21,) int32, the bone on which each of `JOINT_NAMES` sits
    joint_rest : (21, 3) float32, BODY, its position at rest
    """

    name: str
    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    face_part: NDArray[np.uint8]
    face_material: NDArray[np.uint8]
    materials: tuple[str, ...]
    bone_index: NDArray[np.int32]
    bone_weight: NDArray[np.float32]
    parents: NDArray[np.int32]
    heads: NDArray[np.float32]
    key_bone: NDArray[np.int32]
    rest_direction: NDArray[np.float32]
    finger_axis: NDArray[np.float32]
    joint_bone: NDArray[np.int32]
    joint_rest: NDArray[np.float32]

    def __post_init__(self) -> None:
        self._put("vertices", np.float32, (None, 3))
        self._put("faces", np.int32, (None, 3))
        self._put("face_part", np.uint8, (len(self.faces),))
        self._put("face_material", np.uint8, (len(self.faces),))
        self._put("bone_index", np.int32, (len(self.vertices), 4))
        self._put("bone_weight", np.float32, (len(self.vertices), 4))
        self._put("parents", np.int32, (None,))
        bones = len(self.parents)
        self._put("heads", np.float32, (bones, 3))
        self._put("key_bone", np.int32, (len(KEYS),))
        self._put("rest_direction", np.float32, (len(KEYS), 3))
        self._put("finger_axis", np.float32, (bones, 3))
        self._put("joint_bone", np.int32, (len(JOINT_NAMES),))
        self._put("joint_rest", np.float32, (len(JOINT_NAMES), 3))
        if (self.parents >= np.arange(bones)).any():
            raise ValueError(f"{self.name}: a bone comes before its parent")


def axis_angle(axis: NDArray[np.floating], angle: float) -> NDArray[np.float64]:
    """(3, 3) rotation by `angle` radians about `axis`; identity for a zero axis."""
    length = float(np.linalg.norm(axis))
    if length < 1e-12:
        return np.eye(3)
    x, y, z = np.asarray(axis, np.float64) / length
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def swing(source: NDArray[np.floating], target: NDArray[np.floating]) -> NDArray[np.float64]:
    """(3, 3) smallest rotation that takes the direction `source` to the direction `target`."""
    a = np.asarray(source, np.float64) / np.linalg.norm(source)
    b = np.asarray(target, np.float64) / np.linalg.norm(target)
    axis = np.cross(a, b)
    if np.linalg.norm(axis) < 1e-9:
        if a @ b > 0:
            return np.eye(3)
        axis = np.cross(a, np.eye(3)[int(np.abs(a).argmin())])
    return axis_angle(axis, float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def bone_rotations(rig: Rig, rotations: NDArray[np.floating], curl: NDArray[np.floating]) -> NDArray[np.float64]:
    """(B, 3, 3) global rotation of each bone from rest; bones without a key follow their parent, fingers curl."""
    keyed = {int(bone): key for key, bone in enumerate(rig.key_bone)}
    left = {int(rig.key_bone[KEY["l_hand"]])}
    result = np.empty((len(rig.parents), 3, 3))
    for bone, parent in enumerate(rig.parents):
        if parent in left:
            left.add(bone)
        if bone in keyed:
            key = keyed[bone]
            rest = rig.rest_direction[key]
            turn = swing(rest, T_POSE[key]) if T_POSE[key].any() else np.eye(3)
            result[bone] = rotations[key] @ turn
        else:
            result[bone] = result[parent] if parent >= 0 else np.eye(3)
            if rig.finger_axis[bone].any():
                result[bone] = result[bone] @ axis_angle(rig.finger_axis[bone], float(curl[0 if bone in left else 1]))
    return result


@dataclass(frozen=True)
class BoneTransforms:
    """Rigid or linear transform of each bone: x → rotations[b] @ x + shifts[b], BODY."""

    rotations: NDArray[np.float64]
    shifts: NDArray[np.float64]

    def skin(
        self, points: NDArray[np.floating], index: NDArray[np.integer], weight: NDArray[np.floating]
    ) -> NDArray[np.float64]:
        """(N, 3) points of the rest pose deformed by linear blend skinning; index, weight : (N, 4)."""
        flat = np.concatenate([self.rotations.reshape(-1, 9), self.shifts], axis=1)
        blend = np.einsum("vk,vkc->vc", weight, flat[index])
        return np.asarray(np.einsum("vij,vj->vi", blend[:, :9].reshape(-1, 3, 3), points) + blend[:, 9:])


def bone_transforms(rig: Rig, rotations: NDArray[np.floating], curl: NDArray[np.floating]) -> BoneTransforms:
    """Transforms of the bones of a rig in a pose, rotations (20, 3, 3) and curl (2,) of a `PoseSet` row; hips stay."""
    turned = bone_rotations(rig, rotations, curl)
    heads = rig.heads.astype(np.float64)
    moved = heads.copy()
    for bone, parent in enumerate(rig.parents):
        if parent >= 0:
            moved[bone] = moved[parent] + turned[parent] @ (heads[bone] - heads[parent])
    return BoneTransforms(turned, moved - np.einsum("bij,bj->bi", turned, heads))


def pose(
    rig: Rig, rotations: NDArray[np.floating], curl: NDArray[np.floating]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(V, 3) posed vertices and (21, 3) posed joints, BODY."""
    bones = bone_transforms(rig, rotations, curl)
    vertices = bones.skin(rig.vertices, rig.bone_index, rig.bone_weight)
    joints = np.einsum("jik,jk->ji", bones.rotations[rig.joint_bone], rig.joint_rest)
    return vertices, joints + bones.shifts[rig.joint_bone]
