"""U-Net for pictures: convolutions of stride 1 and 2 down, sub-pixel convolutions up, additive skips (paper fig. 5).

The first convolution already halves the picture and the last one doubles it, which costs a quarter of what the full
picture would, and loses nothing where contours are among the inputs.
"""

from __future__ import annotations

from typing import Final, cast

import torch
from torch import Tensor, nn

FILTERS: Final = 32
LEVELS: Final = 4

MULTIPLE: Final = 2**LEVELS
"""Divisor of the edges of input pictures."""


class Hourglass(nn.Module):
    """(N, inputs, H, W) → (N, outputs, H, W); `filters` at half size, twice as many with each further level."""

    def __init__(self, inputs: int, outputs: int, filters: int = FILTERS) -> None:
        super().__init__()
        self.stem = nn.Sequential(_Conv(inputs, filters, 2), _Conv(filters, filters))
        self.levels = nn.ModuleList(_Level(filters << (k + 1), filters << k) for k in range(LEVELS - 1))
        self.last = _Conv(filters, filters)
        self.give = nn.Sequential(nn.Conv2d(filters, 4 * outputs, 1), nn.PixelShuffle(2))
        # A third faster on CPUs.
        self.to(memory_format=torch.channels_last)

    def forward(self, inputs: Tensor) -> Tensor:
        levels = cast("list[_Level]", list(self.levels))
        skips = [self.stem(inputs.contiguous(memory_format=torch.channels_last))]
        for level in levels:
            skips.append(level.down(skips[-1]))
        hidden = skips.pop()
        for level in reversed(levels):
            hidden = level.up(hidden) + skips.pop()
        hidden = self.last(hidden)
        # Half precision is enough for features, not for the output.
        with torch.autocast(inputs.device.type, enabled=False):
            result: Tensor = self.give(hidden.float())
        return result

    @torch.no_grad()
    def start_at_zero(self) -> None:
        """Initialise the output to 0 for any input, for networks that predict changes."""
        final = self.give[0]
        assert isinstance(final, nn.Conv2d)
        assert final.bias is not None
        final.weight.zero_()
        final.bias.zero_()


class _Level(nn.Module):
    """One level. Down: halve, convolve. Up: convolve, double."""

    def __init__(self, coarse: int, fine: int) -> None:
        super().__init__()
        self.down = nn.Sequential(_Conv(fine, coarse, 2), _Conv(coarse, coarse))
        self.up = nn.Sequential(_Conv(coarse, coarse), nn.Conv2d(coarse, 4 * fine, 1), nn.PixelShuffle(2))


class _Conv(nn.Sequential):
    def __init__(self, inputs: int, outputs: int, stride: int = 1) -> None:
        super().__init__(
            nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)
        )
