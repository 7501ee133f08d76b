"""The second network of Grigorev et al. 2019 (paper §4.4): details of a side painted with colours from elsewhere.

Its inputs are the painted side, texture coordinates and depths, its output are changes of colours. Before training
it changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from fig2mesh.nets.hourglass import Hourglass
from fig2mesh.nets.uv_unet import uv_inputs
from fig2mesh.nets.weights import WeightsFile

CHANNELS: Final = 7
"""Painted colours (3), texture coordinates (2), depth (1), mask of the body (1)."""


@dataclass(frozen=True)
class RefineShape:
    """filters : of the first level."""

    filters: int = 32


class ViewRefine(Hourglass):
    """(N, 7, H, W) of `refine_inputs` → (N, 3, H, W) change of colours, which are 0-1."""

    def __init__(self, shape: RefineShape = RefineShape()) -> None:
        super().__init__(CHANNELS, 3, shape.filters)
        self.shape = shape
        self.start_at_zero()


def refine_inputs(painted: Tensor, uv: Tensor, depth: Tensor, labels: Tensor) -> Tensor:
    """(N, 7, H, W) input of the network.

    painted : (N, 3, H, W) 0-1; uv : (N, 2, H, W); depth, labels : (N, H, W), as `uv_inputs` takes them
    """
    there = (labels > 0)[:, None].float()
    near = uv_inputs(depth, labels, masks=False)
    return torch.cat([(2 * painted - 1) * there, (2 * uv - 1) * there, near, there], dim=1)


def refine(net: ViewRefine, painted: Tensor, uv: Tensor, depth: Tensor, labels: Tensor) -> Tensor:
    """(N, 3, H, W) 0-1: sides with the network's changes applied."""
    with torch.no_grad():
        changed: Tensor = painted + net(refine_inputs(painted, uv, depth, labels))
    return changed.clamp(0, 1)


REFINE_WEIGHTS: Final = WeightsFile[RefineShape, ViewRefine](
    network="view-refine",
    title="refining network",
    build=ViewRefine,
    read_shape=lambda facts: RefineShape(**facts),
    file_name=lambda shape: "view-refine",
)
