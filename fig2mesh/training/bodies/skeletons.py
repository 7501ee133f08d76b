"""Batches of posed skeletons: joints of any pose on any body, in space and as a drawing has them.

A joint is a sum over the keys between it and the hips: `base + sum_k rotations[k] @ reach[k]`, so that one batched
product gives the joints of all samples, and a longer limb is a longer `reach`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from fig2mesh.records import _Checked
from fig2mesh.skeleton import FIGURE_HEIGHT, JOINT, JOINT_MIRROR, JOINT_NAMES
from fig2mesh.training.bodies.occlusion import occluded
from fig2mesh.training.bodies.rig import KEY, KEYS, T_POSE, PoseSet, Rig, swing

PELVIS, EYES = JOINT["pelvis"], JOINT["eyes"]


FACELESS: Final = 0.4
"""Share of heads turned to the viewer that are drawn without eyes: pictograms, blobs."""

LIMBS: Final = tuple(key for key in KEYS if key.endswith(("arm", "leg", "hand", "foot")))


@dataclass(frozen=True)
class ViewSampling:
    """Distribution of the views and of the errors of drawing that samples have.

    front_share : share of samples seen within 60 degrees of the front, the others from all around
    sides : only the four sides of the paper
    tilt_deg : largest pitch and roll
    disproportion : share of samples with other limbs, head and torso than the body has
    jitter : a sample's joints are off by up to this share of the height (one sigma)
    hidden : share of joints that something (cloth, a bag) hides, in addition to those behind other parts of the body
    guess : sigma of the position of hidden joints, share of the height
    perspective : a camera 3 to 8 m away at the height of the pelvis, instead of an orthographic one
    """

    front_share: float = 0.0
    sides: bool = False
    tilt_deg: float = 0.0
    disproportion: float = 0.0
    jitter: float = 0.0
    hidden: float = 0.0
    guess: float = 0.03
    perspective: bool = False


AROUND: Final = ViewSampling()
SIDES: Final = ViewSampling(sides=True)
DRAWN: Final = ViewSampling(front_share=0.7, tilt_deg=15.0, disproportion=0.85, jitter=0.02, hidden=0.06)


class Sample(NamedTuple):
    """Joints of N figures.

    joints : (N, 21, 3) float32, FIGURE units, view axes, origin at the pelvis joint
    drawn : (N, 21, 2) float32, FIGURE units: positions in the drawing
    visible : (N, 21) bool
    """

    joints: Tensor
    drawn: Tensor
    visible: Tensor


@dataclass(frozen=True)
class Skeletons(_Checked):
    """Poses and bodies; every pose fits every body.

    rotations : (P, 20, 3, 3) float32, BODY, as in `PoseSet`
    base : (K, 21, 3) float32, BODY metres: the offset that no key turns
    reach : (K, 21, 20, 3) float32, metres, in the axes of the canonical T-pose
    height : (K,) float32, metres from sole to crown at rest
    """

    rotations: NDArray[np.float32]
    base: NDArray[np.float32]
    reach: NDArray[np.float32]
    height: NDArray[np.float32]

    def __post_init__(self) -> None:
        self._put("rotations", np.float32, (None, len(KEYS), 3, 3))
        bodies = len(self.base)
        self._put("base", np.float32, (bodies, len(JOINT_NAMES), 3))
        self._put("reach", np.float32, (bodies, len(JOINT_NAMES), len(KEYS), 3))
        self._put("height", np.float32, (bodies,))

    @classmethod
    def from_rigs(cls, rigs: Sequence[Rig], poses: PoseSet) -> Skeletons:
        """Return the skeletons of rigs; joints are those of `rig.pose` with straight fingers."""
        parts = [_reach(rig) for rig in rigs]
        return cls(
            rotations=poses.rotations,
            base=np.stack([base for base, _ in parts]).astype(np.float32),
            reach=np.stack([reach for _, reach in parts]).astype(np.float32),
            height=np.array([np.ptp(rig.vertices[:, 1]) for rig in rigs], np.float32),
        )

    def joints(self, pose: NDArray[np.integer], body: NDArray[np.integer]) -> NDArray[np.float32]:
        """(N, 21, 3) joints in BODY, metres, of pose[n] on body[n]."""
        turned = torch.from_numpy(self.rotations[pose])
        moved = _forward(turned, torch.from_numpy(self.reach[body])) + torch.from_numpy(self.base[body])
        return np.asarray(moved.numpy(), np.float32)


class Sampler:
    """Generator of random samples of skeletons on a device."""

    def __init__(self, skeletons: Skeletons, device: torch.device | str = "cpu") -> None:
        self.device = torch.device(device)
        self.rotations = torch.tensor(skeletons.rotations, device=self.device)
        scale = FIGURE_HEIGHT / skeletons.height
        reach = skeletons.reach * scale[:, None, None, None]
        self.base = torch.tensor(skeletons.base * scale[:, None, None], device=self.device)
        self.reach = torch.tensor(reach, device=self.device)

    def draw(self, count: int, view: ViewSampling, generator: torch.Generator) -> Sample:
        """Draw `count` samples; standing height 1.79 FIGURE units, whatever the proportions."""

        def uniform(*shape: int) -> Tensor:
            return torch.rand(shape, generator=generator).to(self.device)

        def normal(*shape: int) -> Tensor:
            return torch.randn(shape, generator=generator).to(self.device)

        pose = torch.randint(len(self.rotations), (count,), generator=generator).to(self.device)
        body = torch.randint(len(self.reach), (count,), generator=generator).to(self.device)
        reach, base = self.reach[body], self.base[body]
        if view.disproportion:
            reach, base = _disproportioned(reach, base, view.disproportion, uniform, normal)
        turned = _turns(view, count, uniform).unsqueeze(1) @ self.rotations[pose].reshape(count, -1, 3, 3)
        joints = _forward(turned, reach)
        joints = joints - joints[:, PELVIS : PELVIS + 1]
        flip = torch.tensor([-1.0, 1.0, 1.0], device=self.device)
        mirrored = (uniform(count) < 0.5)[:, None, None]
        joints = torch.where(mirrored, joints[:, list(JOINT_MIRROR)] * flip, joints)
        drawn = joints[..., :2]
        if view.perspective:
            distance = (3 + 5 * uniform(count))[:, None, None]
            drawn = drawn * distance / (distance - joints[..., 2:])
        visible = torch.ones(count, len(JOINT_NAMES), dtype=torch.bool, device=self.device)
        if view.hidden:
            stoutness = torch.exp(0.5 * (uniform(count) - 0.3))
            visible = ~occluded(joints, stoutness) & (uniform(count, len(JOINT_NAMES)) >= view.hidden)
            # Many drawn heads have no face, although they are turned to the viewer.
            visible[:, EYES] &= uniform(count) >= FACELESS
            for side in "lr":
                # An arm behind the back hides as a whole.
                arm = [JOINT[f"{side}_{name}"] for name in ("elbow", "wrist", "hand")]
                visible[:, arm] &= (uniform(count) >= view.hidden)[:, None]
        if view.jitter or view.hidden:
            sigma = view.jitter * uniform(count, 1).expand(visible.shape)
            sigma = torch.where(visible, sigma, max(view.guess, view.jitter)) * FIGURE_HEIGHT
            drawn = drawn + normal(*drawn.shape) * sigma[..., None]
        return Sample(joints, drawn, visible)


def _reach(rig: Rig) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(21, 3) base and (21, 20, 3) reach of a rig: the offsets between bone heads, gathered by key."""
    keyed = {int(bone): key for key, bone in enumerate(rig.key_bone)}
    heads = rig.heads.astype(np.float64)
    key = np.full(len(heads), -1)
    base = np.zeros((len(heads), 3))
    reach = np.zeros((len(heads), len(KEYS), 3))
    turns = np.stack(
        [swing(rig.rest_direction[k], T_POSE[k]) if T_POSE[k].any() else np.eye(3) for k in range(len(KEYS))]
    )

    def add(base: NDArray[np.float64], reach: NDArray[np.float64], by: int, offset: NDArray[np.float64]) -> None:
        if by < 0:
            base += offset
        else:
            reach[by] += turns[by] @ offset

    for bone, parent in enumerate(rig.parents):
        key[bone] = keyed.get(bone, key[parent] if parent >= 0 else -1)
        if parent < 0:
            base[bone] = heads[bone]
        else:
            base[bone], reach[bone] = base[parent], reach[parent]
            add(base[bone], reach[bone], int(key[parent]), heads[bone] - heads[parent])
    bones = rig.joint_bone
    joint_base, joint_reach = base[bones], reach[bones]
    for joint, bone in enumerate(bones):
        offset = rig.joint_rest[joint] - heads[bone]
        add(joint_base[joint], joint_reach[joint], int(key[bone]), offset)
    return joint_base, joint_reach


def _forward(rotations: Tensor, reach: Tensor) -> Tensor:
    """(N, 21, 3) from rotations (N, 20, 3, 3) and reach (N, 21, 20, 3)."""
    count = len(rotations)
    flat = rotations.permute(0, 1, 3, 2).reshape(count, -1, 3)
    return reach.reshape(count, len(JOINT_NAMES), -1) @ flat


def _turns(view: ViewSampling, count: int, uniform) -> Tensor:  # type: ignore[no-untyped-def]
    """(N, 3, 3) view from body: yaw, then pitch, then roll."""
    amount = uniform(count, 4)
    if view.sides:
        yaw = torch.floor(amount[:, 0] * 4) * (math.pi / 2)
    else:
        near = (2 * amount[:, 0] - 1) * math.radians(60)
        yaw = torch.where(amount[:, 1] < view.front_share, near, (2 * amount[:, 0] - 1) * math.pi)
    tilt = (2 * amount[:, 2:] - 1) * math.radians(view.tilt_deg)
    return _about(2, tilt[:, 1]) @ _about(0, tilt[:, 0]) @ _about(1, yaw)


def _about(axis: int, angle: Tensor) -> Tensor:
    """(N, 3, 3) rotations about a coordinate axis."""
    result = torch.zeros(len(angle), 3, 3, device=angle.device)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    result[:, axis, axis] = 1
    result[:, first, first] = result[:, second, second] = torch.cos(angle)
    result[:, second, first] = torch.sin(angle)
    result[:, first, second] = -torch.sin(angle)
    return result


_ONE_SIDE: Final = tuple(KEY["l_" + key[2:]] if key.startswith("r_") else KEY[key] for key in KEYS)
# fmt: off
_CHANGE: Final = {  # name ending → least and largest factor
    **dict.fromkeys(LIMBS, (0.6, 1.6)), "neck": (0.6, 1.6), "head": (0.7, 2.2),
}
# fmt: on
_TORSO: Final = tuple(KEY[key] for key in KEYS if key not in _CHANGE)


def _disproportioned(reach: Tensor, base: Tensor, share: float, uniform, normal):  # type: ignore[no-untyped-def]
    """Return reach and base with other lengths, both sides nearly alike, scaled so that the standing height stays."""
    count, device = len(reach), reach.device
    low = torch.tensor([math.log(_CHANGE.get(key, (1.0, 1.0))[0]) for key in KEYS], device=device)
    high = torch.tensor([math.log(_CHANGE.get(key, (1.0, 1.0))[1]) for key in KEYS], device=device)
    factor = (low + (high - low) * uniform(count, len(KEYS)))[:, list(_ONE_SIDE)]
    factor = factor + 0.05 * normal(count, len(KEYS)) * (high > low)
    factor = factor.unsqueeze(2).repeat(1, 1, 3)
    torso = math.log(0.7) + math.log(2.0) * uniform(count, 2)
    factor[:, list(_TORSO)] = torso[:, None, [0, 1, 0]]  # width and depth, height
    factor = torch.exp(factor * (uniform(count) < share)[:, None, None])
    changed = reach * factor.unsqueeze(1)
    scale = (_standing(reach) / _standing(changed))[:, None, None]
    return changed * scale.unsqueeze(3), base * scale


def _standing(reach: Tensor) -> Tensor:
    """(N,) height from the lower foot to the head joint in the canonical T-pose."""
    level = reach[..., 1].sum(dim=2)
    return level[:, JOINT["head"]] - level.min(dim=1).values
