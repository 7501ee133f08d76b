"""Coordinate completion of paper §4.4: the location in the drawing from which a hidden point takes its colour.

After Grigorev et al. 2019, *Coordinate-based texture inpainting for pose-guided image generation*: the network works in
body texture space on places in the drawing, not on colours, so that its result is as sharp as the drawing. Ours gets
for every texel the location of its point behind the drawing (visible or not), and changes that place: without a change
the figure would be the same from behind as from the front, which is the initial state of training.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor, nn
from torch.nn import functional

from fig2mesh.nets.hourglass import Hourglass
from fig2mesh.nets.weights import WeightsFile

CHANNELS: Final = 8
"""place (2), there, visible, same (1 each), colour (3)."""

LEARNED: Final = 8
"""Channels of constants that the network learns for every texel: an embedding of positions on a body."""

REACH: Final = 0.5
"""Largest change of place along each axis, pictures (an edge is 2 long)."""


@dataclass(frozen=True)
class FillShape:
    """size : texels per edge; filters : of the first level."""

    size: int = 128
    filters: int = 32


class TextureFill(nn.Module):
    """(N, 8, S, S) of `fill_inputs` → (N, 2, S, S) change of place in the drawing, edges at -1 and 1."""

    def __init__(self, shape: FillShape = FillShape()) -> None:
        super().__init__()
        self.shape = shape
        self.constants = nn.Parameter(0.1 * torch.randn(1, LEARNED, shape.size, shape.size))
        self.net = Hourglass(CHANNELS + LEARNED, 2, shape.filters)
        self.net.start_at_zero()

    def forward(self, inputs: Tensor) -> Tensor:
        known = self.constants.expand(len(inputs), -1, -1, -1)
        return REACH * torch.tanh(self.net(torch.cat([inputs, known], dim=1)))


def fill_inputs(place: Tensor, there: Tensor, visible: Tensor, same: Tensor, colour: Tensor) -> Tensor:
    """(N, 8, S, S) input of the network.

    Parameters
    ----------
    place : (N, 2, S, S) x, y of each texel's point in the drawing, edges at -1 and 1, y down
    there : (N, S, S) bool, the texel is known to be on the body
    visible : (N, S, S) bool, the drawing shows it
    same : (N, S, S) bool, the drawing shows the texel's own part at that place
    colour : (N, 3, S, S) colour of the drawing at that place, 0-1
    """
    flags = torch.stack([there.float(), visible.float(), same.float()], dim=1)
    return torch.cat([place, flags, 2 * colour - 1], dim=1) * there[:, None].float()


def sample(picture: Tensor, place: Tensor) -> Tensor:
    """(N, C, ...) bilinear values of pictures (N, C, H, W) at places (N, 2, ...), edges at -1 and 1, extrapolated."""
    return functional.grid_sample(
        picture, place.movedim(1, 3), mode="bilinear", padding_mode="border", align_corners=False
    )


FILL_WEIGHTS: Final = WeightsFile[FillShape, TextureFill](
    network="texture-fill",
    title="texture network",
    build=TextureFill,
    read_shape=lambda facts: FillShape(**facts),
    file_name=lambda shape: "texture-fill",
)
