"""The second network of Grigorev et al. 2019 (paper §4.4): details of a side painted with colours from elsewhere.

It sees the painted side, where its points are on the body and how near they are, and changes colours. Before training
it changes nothing.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import torch
from torch import Tensor

from fig2mesh.nets import weights
from fig2mesh.nets.hourglass import Hourglass
from fig2mesh.nets.uv_unet import uv_inputs

CHANNELS: Final = 7
"""Painted colours (3), texture coordinates (2), depth (1), whether there is anything (1)."""


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
    """(N, 7, H, W) what the network takes.

    painted : (N, 3, H, W) 0-1; uv : (N, 2, H, W); depth, labels : (N, H, W), as `uv_inputs` takes them
    """
    there = (labels > 0)[:, None].float()
    near = uv_inputs(depth, labels, masks=False)
    return torch.cat([(2 * painted - 1) * there, (2 * uv - 1) * there, near, there], dim=1)


def refine(net: ViewRefine, painted: Tensor, uv: Tensor, depth: Tensor, labels: Tensor) -> Tensor:
    """(N, 3, H, W) 0-1: the sides with the network's changes."""
    with torch.no_grad():
        changed: Tensor = painted + net(refine_inputs(painted, uv, depth, labels))
    return changed.clamp(0, 1)


def refine_path(folder: Path = weights.FOLDER) -> Path:
    """Where the weights are."""
    return folder / "view-refine.safetensors"


def save_refine(path: Path, net: ViewRefine, facts: Mapping[str, Any]) -> None:
    """Write a network; its shape is put among the facts."""
    weights.save(path, net.state_dict(), {**facts, "network": "view-refine", "shape": asdict(net.shape)})


def read_refine(path: Path) -> tuple[ViewRefine, dict[str, Any]]:
    """A network, ready for inference, and its facts."""
    return weights.read_module(path, lambda shape: ViewRefine(RefineShape(**shape)), "refining network")


@functools.cache
def load() -> ViewRefine:
    """The shipped network, read once a process."""
    return read_refine(refine_path())[0]
