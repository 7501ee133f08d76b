"""Size of a part from its joints and the outline of its mask (paper §4.3: a perceptron of 20, 40, 20 neurons).

A mask has no depth, and a hidden part no mask; the joints between which a part lies give the rest. Inputs and outputs
are in units of the part's own bone, so that a figure twice as large has parts twice as large. Axes are those
of the view; right parts are mirrored to left ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from fig2mesh.nets.weights import WeightsFile
from fig2mesh.skeleton import ANCHORS, KINDS, MIRRORED, PART_KIND, anchor_joints, part_centre

NEURONS: Final = (20, 40, 20)
OUTPUTS: Final = 4
MIN_UNIT: Final = 1e-4
MAX_LOG: Final = 4.0
"""Limit at which logarithms of mask to bone are clamped: a bone that points at the viewer may have almost no length."""


@dataclass(frozen=True)
class SizeShape:
    """kind : kind of part, one of `KINDS`."""

    kind: str

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"kind: {self.kind!r}, expected one of {', '.join(KINDS)}")


class PartSizeNet(nn.Module):
    """Perceptron for one kind of part."""

    def __init__(self, shape: SizeShape) -> None:
        super().__init__()
        self.shape = shape
        layers: list[nn.Module] = []
        inputs = 3 * len(ANCHORS[shape.kind]) + 3
        for width in NEURONS:
            layers += [nn.Linear(inputs, width), nn.SiLU()]
            inputs = width
        self.layers = nn.Sequential(*layers, nn.Linear(inputs, OUTPUTS))

    def forward(self, anchors: Tensor, mask: Tensor) -> Tensor:
        """(N, 4) logarithms of width, height, depth and cube edge, in the unit of the input.

        anchors : (N, A, 3) relative to the part's centre, view axes, left side; mask : (N, 2) width and height of the
        part's mask, zeros where it is not visible
        """
        unit = bone_unit(anchors)
        visible = (mask > 0).all(dim=1, keepdim=True)
        outline = torch.where(visible, (mask.clamp_min(MIN_UNIT) / unit[:, None]).log().clamp(-MAX_LOG, MAX_LOG), 0.0)
        inputs = torch.cat([(anchors / unit[:, None, None]).flatten(1), outline, visible.to(anchors.dtype)], dim=1)
        sizes: Tensor = self.layers(inputs) + unit.log()[:, None]
        return sizes


def bone_unit(anchors: Tensor) -> Tensor:
    """(N,) root mean square distance of anchors (N, A, 3) from their mean."""
    spread = anchors - anchors.mean(dim=1, keepdim=True)
    return spread.square().sum(dim=2).mean(dim=1).sqrt().clamp_min(MIN_UNIT)


@torch.no_grad()
def part_size(
    net: PartSizeNet, part: int, joints: NDArray[np.floating], mask: tuple[float, float] | None = None
) -> tuple[NDArray[np.float32], float]:
    """(3,) width, height and depth of a part, and the edge of its PART cube, FIGURE units.

    joints : (21, 3), FIGURE or axes of another view; mask : width and height of the part as drawn, None if it is hidden
    """
    if PART_KIND[part] != net.shape.kind:
        raise ValueError(f"part {part} is not a {net.shape.kind}")
    anchors = np.asarray(joints, np.float64)[list(anchor_joints(part))] - part_centre(part, joints)
    if MIRRORED[part]:
        anchors = anchors * [-1.0, 1.0, 1.0]
    outline = torch.tensor([mask or (0.0, 0.0)], dtype=torch.float32)
    net.eval()
    sizes = net(torch.from_numpy(anchors[None].astype(np.float32)), outline).exp()[0].numpy()
    return np.asarray(sizes[:3], np.float32), float(sizes[3])


SIZE_WEIGHTS: Final = WeightsFile[SizeShape, PartSizeNet](
    network="size",
    title="size network",
    build=PartSizeNet,
    read_shape=lambda facts: SizeShape(**facts),
    file_name=lambda shape: f"size-{shape.kind}",
)
