"""Unfolded bodies as batches of tensors, for the networks that paint unseen sides."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from fig2mesh.nets.texture_fill import fill_inputs, sample
from fig2mesh.training.samples.unfold import Unfolded


class Texels(NamedTuple):
    """A batch: inputs (N, 8, S, S), place (N, 2, S, S), truth (N, 3, S, S) 0-1, weight (N, S, S), observed (N, S, S),
    front (N, 3, H, W) 0-1, inside (N, 1, H, W)."""

    inputs: Tensor
    place: Tensor
    truth: Tensor
    weight: Tensor
    observed: Tensor
    front: Tensor
    inside: Tensor


def gather(bodies: Unfolded, rows: np.ndarray) -> Texels:
    """Gather bodies `rows` as tensors."""
    place = torch.from_numpy(bodies.place[rows].astype(np.float32)).movedim(3, 1)
    front = torch.from_numpy(bodies.front[rows].astype(np.float32) / 255).movedim(3, 1)
    there, observed, same = (torch.from_numpy(array[rows]) for array in (bodies.there, bodies.observed, bodies.same))
    truth = torch.from_numpy(bodies.truth[rows].astype(np.float32) / 255).movedim(3, 1)
    weight = torch.from_numpy(bodies.weight[rows].astype(np.float32))
    inside = torch.from_numpy(bodies.inside[rows].astype(np.float32))[:, None]
    inputs = fill_inputs(place, there, observed, same, sample(front, place))
    return Texels(inputs, place, truth, weight, observed, front, inside)
