"""Network from a view of a body to texture coordinates (paper §4.3, figure 5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from fig2mesh.nets.hourglass import FILTERS, Hourglass
from fig2mesh.nets.weights import WeightsFile
from fig2mesh.skeleton import BODY_PARTS

PARTS: Final = len(BODY_PARTS)

SPAN: Final = 2.0
"""Range of depths about the middle one that is encoded without clamping, FIGURE units."""


@dataclass(frozen=True)
class UvUnetShape:
    """masks : the input is depth times the masks of the 14 parts, not depth alone; filters : of the first level."""

    masks: bool = True
    filters: int = FILTERS

    @property
    def inputs(self) -> int:
        return PARTS if self.masks else 1


SHIPPED: Final = UvUnetShape()


class UvUnet(Hourglass):
    """(N, C, H, W) inputs → (N, 3, H, W): u, v, and the logit of the mask; H and W multiples of 16."""

    def __init__(self, shape: UvUnetShape = SHIPPED) -> None:
        super().__init__(shape.inputs, 3, shape.filters)
        self.shape = shape


def uv_inputs(depth: Tensor, labels: Tensor, masks: bool = True) -> Tensor:
    """(N, 14 or 1, H, W) input of the network.

    depth : (N, H, W) VIEW z, FIGURE units, any value where nothing is visible
    labels : (N, H, W) part labels; extras have no channel of their own and count in the depth alone
    """
    visible = labels > 0
    values = torch.where(visible, depth, torch.nan)
    middle = values.flatten(1).nanmedian(dim=1).values.nan_to_num()[:, None, None]
    # 0 means nothing, so visible pixels are never 0.
    near = torch.where(visible, (0.55 + (depth - middle) / SPAN).clamp(0.1, 1.0), 0.0)
    if not masks:
        return near[:, None]
    parts = torch.arange(1, PARTS + 1, device=labels.device)[None, :, None, None]
    return near[:, None] * (labels[:, None] == parts)


def infer_uv(net: UvUnet, depth: Tensor, labels: Tensor) -> Tensor:
    """(N, 2, H, W) texture coordinates in [0, 1] of visible pixels; see `uv_inputs`."""
    with torch.no_grad():
        found: Tensor = net(uv_inputs(depth, labels, net.shape.masks))[:, :2]
    return found.clamp(0.0, 1.0)


UV_WEIGHTS: Final = WeightsFile[UvUnetShape, UvUnet](
    network="uv",
    title="UV network",
    build=UvUnet,
    read_shape=lambda facts: UvUnetShape(**facts),
    file_name=lambda shape: f"uv-{'masks' if shape.masks else 'depth'}",
)
