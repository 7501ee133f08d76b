"""Bodies with the proportions of drawn people: other heads, hands, feet, limbs and waists."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fig2mesh.training.bodies.anny_body import rest_directions
from fig2mesh.training.bodies.rig import KEY, KEYS, BoneTransforms, Rig


@dataclass(frozen=True)
class Proportions:
    """Factors on a body's own measures; lengths along limbs, girths across them."""

    head: float = 1.0
    hand: float = 1.0
    foot: float = 1.0
    arm_length: float = 1.0
    leg_length: float = 1.0
    arm_girth: float = 1.0
    leg_girth: float = 1.0
    torso_width: float = 1.0
    torso_height: float = 1.0
    torso_depth: float = 1.0


def draw_proportions(rng: np.random.Generator, share: float = 0.55) -> Proportions:
    """Sample proportions as drawings have them; a share of 1 - `share` of bodies is left as it is."""

    def spread(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    if rng.random() > share:
        return Proportions()
    return Proportions(
        head=spread(0.8, 2.0),
        hand=spread(0.7, 1.7),
        foot=spread(0.7, 1.7),
        arm_length=spread(0.75, 1.3),
        leg_length=spread(0.6, 1.3),
        arm_girth=spread(0.6, 1.6),
        leg_girth=spread(0.65, 1.6),
        torso_width=spread(0.8, 1.4),
        torso_height=spread(0.75, 1.25),
        torso_depth=spread(0.8, 1.4),
    )


def caricature(rig: Rig, change: Proportions) -> tuple[Rig, BoneTransforms]:
    """Return the rig with other proportions, and the transforms applied, for a skirt that hangs on the body."""
    if change == Proportions():
        return rig, BoneTransforms(np.tile(np.eye(3), (len(rig.parents), 1, 1)), np.zeros((len(rig.parents), 3)))
    stretch = _bone_matrices(rig, change)
    heads = rig.heads.astype(np.float64)
    moved = heads.copy()
    for bone, parent in enumerate(rig.parents):
        if parent >= 0:
            moved[bone] = moved[parent] + stretch[parent] @ (heads[bone] - heads[parent])
    bones = BoneTransforms(stretch, moved - np.einsum("bij,bj->bi", stretch, heads))
    joints = np.einsum("jik,jk->ji", stretch[rig.joint_bone], rig.joint_rest) + bones.shifts[rig.joint_bone]
    changed = replace(
        rig,
        vertices=bones.skin(rig.vertices, rig.bone_index, rig.bone_weight).astype(np.float32),
        heads=moved.astype(np.float32),
        joint_rest=joints,
        rest_direction=rest_directions(moved, rig.key_bone),
    )
    return changed, bones


def _bone_matrices(rig: Rig, change: Proportions) -> NDArray[np.float64]:
    """(B, 3, 3) linear transform of the vertices of each bone; bones without a key share their parent's."""
    keyed = {int(bone): KEYS[key] for key, bone in enumerate(rig.key_bone)}
    matrices = np.tile(np.eye(3), (len(rig.parents), 1, 1))
    for bone, parent in enumerate(rig.parents):
        key = keyed.get(bone)
        if key is None:
            matrices[bone] = matrices[parent] if parent >= 0 else np.eye(3)
        elif key == "head" or key.endswith(("hand", "foot")):
            matrices[bone] = np.eye(3) * getattr(change, key.split("_")[-1])
        elif key.endswith(("arm", "leg")):
            limb = "arm" if key.endswith("arm") else "leg"
            way = rig.rest_direction[KEY[key]].astype(np.float64)
            along = np.outer(way, way)
            matrices[bone] = getattr(change, f"{limb}_girth") * (np.eye(3) - along)
            matrices[bone] += getattr(change, f"{limb}_length") * along
        elif key == "neck":
            matrices[bone] = np.diag([min(change.head, 1.4), 1.0, min(change.head, 1.4)])
        else:
            matrices[bone] = np.diag([change.torso_width, change.torso_height, change.torso_depth])
    return matrices
