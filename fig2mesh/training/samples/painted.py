"""Unseen sides of training bodies painted from their fronts: input of the refining networks."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from fig2mesh.nets.texture_fill import TextureFill, sample
from fig2mesh.training.samples.texels import gather
from fig2mesh.training.samples.texture_data import Drawings, load_drawings
from fig2mesh.training.samples.unfold import places, unfold


class PaintedSides(NamedTuple):
    """N sides: painted, truth (N, 3, H, W) 0-1; uv (N, 2, H, W); depth, labels (N, H, W); known (N, H, W) bool."""

    painted: Tensor
    truth: Tensor
    uv: Tensor
    depth: Tensor
    labels: Tensor
    known: Tensor


class Painter:
    """Bodies of `Drawings`, with the offsets that a trained network adds to the positions of their colours."""

    def __init__(self, drawings: Drawings, net: TextureFill) -> None:
        self.drawings = drawings
        unfolded = unfold(drawings)
        self.front = unfolded.front
        self.places = np.stack(
            [
                places(labels, depth).astype(np.float16)
                for labels, depth in zip(drawings.labels, drawings.depth, strict=True)
            ]
        )
        changes: list[NDArray[np.float16]] = []
        with torch.no_grad():
            for first in range(0, len(drawings), 16):
                rows = np.arange(first, min(first + 16, len(drawings)))
                changes.append(net(gather(unfolded, rows).inputs).half().numpy())
        self.changes = np.concatenate(changes)

    def __len__(self) -> int:
        return len(self.drawings)

    def sides(self, rows: NDArray[np.integer], views: NDArray[np.integer]) -> PaintedSides:
        """Paint bodies `rows` from sides `views`."""
        drawings = self.drawings
        uv = torch.from_numpy(drawings.uv[rows, views].astype(np.float32)).movedim(3, 1)
        change = sample(torch.from_numpy(self.changes[rows].astype(np.float32)), 2 * uv - 1)
        place = torch.from_numpy(self.places[rows, views].astype(np.float32)).movedim(3, 1) + change
        front = torch.from_numpy(self.front[rows].astype(np.float32) / 255).movedim(3, 1)
        return PaintedSides(
            sample(front, place),
            torch.from_numpy(drawings.picture[rows, views].astype(np.float32) / 255).movedim(3, 1),
            uv,
            torch.from_numpy(drawings.depth[rows, views].astype(np.float32)),
            torch.from_numpy(drawings.labels[rows, views]),
            torch.from_numpy(drawings.known(rows, views)),
        )


def painters(data: Path, net: TextureFill, splits: tuple[str, ...], limit: int | None = None) -> Painter:
    """Load the bodies of some splits."""
    return Painter(load_drawings(data, splits, pictures=True, limit=limit), net)
