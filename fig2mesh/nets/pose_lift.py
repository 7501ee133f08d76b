"""Lifting of drawn joints to 3D: the network of Martinez et al. 2017 as adapted in paper §4.1.

Linear 1024, then two residual blocks of two linear layers with batch normalisation, ReLU and dropout. For an
orthographic drawing x and y are kept and only depths are predicted; for a perspective one all three coordinates are.
The pelvis is the origin. The standing height of a drawn figure is not known, so the input is divided by a scale
estimated from its own bones, and the output multiplied by it; `metric` networks trust the units, as the paper does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from fig2mesh.nets.weights import WeightsFile
from fig2mesh.skeleton import BONES, JOINT, JOINT_MIRROR, JOINT_NAMES, LIMB_BONES, SIDES, without_side

WIDTH: Final = 1024
BLOCKS: Final = 2
DROPOUT: Final = 0.5
"""Of Martinez et al.; training on endless skeletons does better with less."""

ADDED: Final = ("eyes", "l_hand", "r_hand", "l_foot", "r_foot")
"""The five joints that the paper adds to the sixteen of Martinez et al."""

SCALE_BONES: Final = tuple(
    (JOINT[start], JOINT[end])
    for start, end in (
        *(
            tuple(f"{side}_{joint}" for joint in LIMB_BONES[part])
            for part in ("upper_arm", "lower_arm", "upper_leg", "lower_leg")
            for side in SIDES
        ),
        ("pelvis", "thorax"),
        ("pelvis", "l_shoulder"),
        ("pelvis", "r_shoulder"),
    )
)
"""Pairs of joints whose drawn distances give the scale; joints that both networks have. Weights keep this order."""

DEPTH_BONES: Final = tuple(
    (JOINT[start], JOINT[end])
    for start, end in (
        ("pelvis", "thorax"),
        ("thorax", "neck"),
        ("neck", "head"),
        ("head", "eyes"),
        *sorted((bone for bone in BONES if bone[1][:2] in ("l_", "r_")), key=lambda bone: JOINT[bone[1]]),
    )
)
"""`BONES` from the pelvis outwards: a drawn bone is foreshortened by its depth. Weights keep this order."""

MAX_LENGTH: Final = 2.0
"""Clamp of drawn lengths, in usual lengths."""

QUANTILE: Final = 0.8
"""Quantile of drawn to usual lengths that is the scale: most bones are foreshortened, and some are drawn too long."""

MIN_SCALE: Final = 1e-6

USUAL_LENGTHS: Final = tuple(
    {"elbow": 0.27, "wrist": 0.25, "knee": 0.41, "ankle": 0.41, "thorax": 0.42, "shoulder": 0.47}[
        without_side(JOINT_NAMES[second])
    ]
    for _, second in SCALE_BONES
)
"""Lengths of `SCALE_BONES` of a figure of 1.79 units, until training measures them."""


@dataclass(frozen=True)
class PoseLiftShape:
    """Inputs and outputs of a network.

    joints : 21, or the 16 of Martinez et al.
    perspective : the drawing is in perspective, so x and y are predicted too
    visibility : the visibility of joints is an input
    limbs : the foreshortening of each limb is an input too: its length l in usual lengths, and √(1 − l²), which is
        the depth between its ends but for the sign
    metric : drawn joints are in FIGURE units of a figure that stands 1.79 tall, instead of any unit
    width : of the layers
    """

    joints: int = 21
    perspective: bool = False
    visibility: bool = False
    limbs: bool = False
    metric: bool = False
    width: int = WIDTH

    def __post_init__(self) -> None:
        if self.joints not in (16, 21):
            raise ValueError(f"joints: {self.joints}, expected 16 or 21")

    @property
    def indices(self) -> tuple[int, ...]:
        """Indices into `JOINT_NAMES` of the network's joints, in its order."""
        dropped = ADDED if self.joints == 16 else ()
        return tuple(JOINT[name] for name in JOINT_NAMES if name not in dropped)

    @property
    def bones(self) -> tuple[tuple[int, int], ...]:
        """Pairs of `DEPTH_BONES` between joints of the network."""
        known = self.indices
        return tuple(pair for pair in DEPTH_BONES if pair[0] in known and pair[1] in known)

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return self.joints * (3 if self.visibility else 2) + (2 * len(self.bones) if self.limbs else 0)


SHIPPED: Final = PoseLiftShape(visibility=True, limbs=True)
"""Shape of the network for drawn figures."""


class _Block(nn.Module):
    def __init__(self, width: int, dropout: float) -> None:
        super().__init__()
        self.layers = nn.Sequential(*_layer(width, width, dropout), *_layer(width, width, dropout))

    def forward(self, hidden: Tensor) -> Tensor:
        added: Tensor = self.layers(hidden)
        return hidden + added


def _layer(inputs: int, outputs: int, dropout: float) -> tuple[nn.Module, ...]:
    linear = nn.Linear(inputs, outputs)
    nn.init.kaiming_normal_(linear.weight)
    return linear, nn.BatchNorm1d(outputs), nn.ReLU(), nn.Dropout(dropout)


class PoseLift(nn.Module):
    """Network of a shape; `bone_length` (len(SCALE_BONES),) and `limb_length` hold usual lengths, FIGURE units."""

    def __init__(self, shape: PoseLiftShape, dropout: float = DROPOUT) -> None:
        super().__init__()
        self.shape = shape
        count, width = shape.joints, shape.width
        self.first = nn.Sequential(*_layer(shape.inputs, width, dropout))
        self.blocks = nn.Sequential(*(_Block(width, dropout) for _ in range(BLOCKS)))
        self.last = nn.Linear(width, count * (3 if shape.perspective else 1))
        self.register_buffer("bone_length", torch.tensor(USUAL_LENGTHS))
        self.bone_length: Tensor
        self.register_buffer("limb_length", torch.ones(len(shape.bones) if shape.limbs else 0))
        self.limb_length: Tensor

    def forward(self, drawn: Tensor, visible: Tensor | None = None) -> Tensor:
        """(N, J, 3) joints about the pelvis in the unit of `drawn`.

        drawn : (N, J, 2), y up, any origin; visible : (N, J) bool, all where missing
        """
        shape = self.shape
        pelvis = shape.indices.index(JOINT["pelvis"])
        flat = drawn - drawn[:, pelvis : pelvis + 1]
        scale = flat.new_ones(len(flat)) if shape.metric else self.scale(flat)
        drawn = flat / scale[:, None, None]
        inputs = drawn.flatten(1)
        if shape.limbs:
            inputs = torch.cat([inputs, self.foreshortened(drawn)], dim=1)
        if shape.visibility:
            hidden = torch.zeros_like(flat[..., 0]) if visible is None else 1 - visible.to(flat.dtype)
            inputs = torch.cat([inputs, hidden], dim=1)
        raw = self.last(self.blocks(self.first(inputs))).float()
        result = raw.reshape(len(flat), shape.joints, -1) * scale[:, None, None]
        result = result - result[:, pelvis : pelvis + 1]
        return result if shape.perspective else torch.cat([flat, result], dim=2)

    def foreshortened(self, drawn: Tensor) -> Tensor:
        """(N, 2 len(bones)) drawn length of each limb of joints (N, J, 2) in usual lengths, and the remaining depth."""
        indices = self.shape.indices
        first = [indices.index(a) for a, _ in self.shape.bones]
        second = [indices.index(b) for _, b in self.shape.bones]
        length = ((drawn[:, first] - drawn[:, second]).norm(dim=2) / self.limb_length).clamp_max(MAX_LENGTH)
        return torch.cat([length, (1 - length.square()).clamp_min(0).sqrt()], dim=1)

    def scale(self, drawn: Tensor) -> Tensor:
        """(N,) unit of drawn joints (N, J, 2) in FIGURE units of a figure of usual limbs."""
        indices = self.shape.indices
        first = [indices.index(a) for a, _ in SCALE_BONES]
        second = [indices.index(b) for _, b in SCALE_BONES]
        ratios = (drawn[:, first] - drawn[:, second]).norm(dim=2) / self.bone_length
        return torch.quantile(ratios.float(), QUANTILE, dim=1).clamp_min(MIN_SCALE)


def bone_lengths(joints: Tensor, bones: Sequence[tuple[int, int]] = SCALE_BONES) -> Tensor:
    """(len(bones),) mean lengths of bones over joints (N, 21, 3)."""
    return torch.stack([(joints[:, a] - joints[:, b]).norm(dim=1).mean() for a, b in bones])


@torch.no_grad()
def lift(net: PoseLift, drawn: Tensor, visible: Tensor | None = None) -> Tensor:
    """(N, J, 3) prediction averaged with that of the mirror image, mirrored back."""
    indices = net.shape.indices
    twin = [indices.index(JOINT_MIRROR[index]) for index in indices]
    flip = drawn.new_tensor([-1.0, 1.0, 1.0])
    net.eval()
    plain = net(drawn, visible)
    twin_visible = None if visible is None else visible[:, twin]
    mirrored = net(drawn[:, twin] * flip[:2], twin_visible)[:, twin] * flip
    both: Tensor = (plain + mirrored) / 2
    return both


def lift_joints(
    net: PoseLift, joints_2d: NDArray[np.floating], visible: NDArray[np.bool_] | None = None
) -> NDArray[np.float32]:
    """(21, 3) float32, FIGURE: the drawn joints, x and y exactly, with depths; the pelvis has depth 0.

    joints_2d : (21, 2), FIGURE; visible : (21,) bool
    """
    if net.shape.joints != len(JOINT_NAMES) or net.shape.perspective:
        raise ValueError("drawn figures need the orthographic network of 21 joints")
    drawn = torch.from_numpy(np.array(joints_2d, np.float32)[None])
    flags = None if visible is None else torch.from_numpy(np.array(visible, np.bool_)[None])
    depth = lift(net, drawn, flags)[0, :, 2].numpy()
    return np.column_stack([np.asarray(joints_2d, np.float32), depth]).astype(np.float32)


def _file_name(shape: PoseLiftShape) -> str:
    marks = [name for name in ("perspective", "visibility", "limbs", "metric") if getattr(shape, name)]
    return "-".join(["pose", str(shape.joints), *marks])


POSE_WEIGHTS: Final = WeightsFile[PoseLiftShape, PoseLift](
    network="pose",
    title="pose network",
    build=PoseLift,
    read_shape=lambda facts: PoseLiftShape(**facts),
    file_name=_file_name,
)
"""Half precision moves depths by less than 0.2 % of the deepest, batch normalisation included (tested)."""
