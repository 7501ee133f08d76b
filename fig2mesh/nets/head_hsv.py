"""Heads of sides that are not observed: the two-branch autoencoder of paper §4.4, figure 9.

A shallow branch cleans hue and saturation (a denoising autoencoder after Gondara 2016), a deep one with a bottleneck
makes the value; texture coordinates give both the direction in which the head faces. Hue and saturation are one point
of the colour disc, (s cos h, s sin h), so that red has no jump.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor, nn
from torch.nn import functional

from fig2mesh.nets.weights import WeightsFile

SIZE: Final = 64
"""Pixels per edge."""

CHANNELS: Final = 6
"""Colour disc (2), value, texture coordinates (2), mask of the head (1)."""


@dataclass(frozen=True)
class HeadShape:
    """filters : of the shallow branch, and of the first level of the deep one; code : numbers in the bottleneck."""

    filters: int = 24
    code: int = 128


class HeadHsv(nn.Module):
    """(N, 6, 64, 64) of `head_inputs` → (N, 3, 64, 64) colour disc and value."""

    def __init__(self, shape: HeadShape = HeadShape()) -> None:
        super().__init__()
        self.shape = shape
        f = shape.filters
        self.shallow = nn.Sequential(
            _conv(CHANNELS, f),
            _conv(f, f, 2),
            _conv(f, f),
            nn.Conv2d(f, 4 * f, 1),
            nn.PixelShuffle(2),
            nn.ReLU(),
            nn.Conv2d(f, 2, 3, 1, 1),
        )
        self.encode = nn.Sequential(
            _conv(CHANNELS, f, 2),
            _conv(f, 2 * f, 2),
            _conv(2 * f, 4 * f, 2),
            _conv(4 * f, 4 * f, 2),
            nn.Flatten(),
            nn.Linear(4 * f * 16, shape.code),
            nn.ReLU(),
        )
        self.spread = nn.Linear(shape.code, 4 * f * 16)
        self.decode = nn.Sequential(
            *(
                layer
                for inputs, outputs in ((4 * f, 4 * f), (4 * f, 2 * f), (2 * f, f), (f, f))
                for layer in (nn.Upsample(scale_factor=2), _conv(inputs, outputs))
            )
        )
        self.value = nn.Sequential(_conv(f + CHANNELS, f), nn.Conv2d(f, 1, 3, 1, 1))
        for layer in (self.shallow[-1], self.value[-1]):
            # Training starts from the identity.
            for parameter in layer.parameters():
                nn.init.zeros_(parameter)

    def forward(self, inputs: Tensor) -> Tensor:
        disc = inputs[:, :2] + self.shallow(inputs)
        code = self.spread(self.encode(inputs)).reshape(len(inputs), -1, 4, 4)
        value = inputs[:, 2:3] + self.value(torch.cat([self.decode(code), inputs], dim=1))
        return torch.cat([disc, value], dim=1)


def _conv(inputs: int, outputs: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)
    )


def disc_value(rgb: Tensor) -> Tensor:
    """(N, 3, ...) point of the colour disc and value of sRGB colours 0-1."""
    high, low = rgb.amax(dim=1), rgb.amin(dim=1)
    chroma = high - low
    red, green, blue = rgb.unbind(dim=1)
    safe = chroma.clamp_min(1e-8)
    sixth = torch.where(
        high == red,
        (green - blue) / safe,
        torch.where(high == green, 2 + (blue - red) / safe, 4 + (red - green) / safe),
    )
    hue = sixth * (math.pi / 3)
    saturation = chroma / high.clamp_min(1e-8)
    return torch.stack([saturation * hue.cos(), saturation * hue.sin(), high], dim=1)


def rgb_of(disc: Tensor) -> Tensor:
    """(N, 3, ...) sRGB 0-1 of points of the disc and values; points outside of it are clamped to its rim."""
    x, y, value = disc.unbind(dim=1)
    saturation = torch.hypot(x, y).clamp_max(1)
    sixth = torch.atan2(y, x) / (math.pi / 3)
    value = value.clamp(0, 1)
    channels = []
    for offset in (5.0, 3.0, 1.0):
        k = (offset + sixth) % 6
        channels.append(value - value * saturation * torch.minimum(k, 4 - k).clamp(0, 1))
    return torch.stack(channels, dim=1)


def head_inputs(rgb: Tensor, uv: Tensor, there: Tensor) -> Tensor:
    """(N, 6, H, W) input of the network.

    rgb : (N, 3, H, W) 0-1; uv : (N, 2, H, W); there : (N, H, W) bool
    """
    mask = there[:, None].float()
    return torch.cat([disc_value(rgb) * mask, (2 * uv - 1) * mask, mask], dim=1)


def enhance(net: HeadHsv, rgb: Tensor, uv: Tensor, head: Tensor) -> Tensor:
    """(N, 3, H, W) pictures with heads replaced by the network's.

    rgb, uv : pictures of sides; head : (N, H, W) bool, pixels of heads
    """
    result = rgb.clone()
    for row in range(len(rgb)):
        grid = head_window(head[row])
        if grid is None:
            continue
        pair = torch.cat([rgb[row], uv[row], head[row][None].float()])[None]
        crop = functional.grid_sample(pair, grid, mode="bilinear", padding_mode="zeros", align_corners=False)
        with torch.no_grad():
            made = rgb_of(net(head_inputs(crop[:, :3], crop[:, 3:5], crop[:, 5] > 0.5)))
        # Back into the picture: positions of its pixels in the crop.
        theta = _theta(head[row])
        assert theta is not None
        scale, centre = theta
        height, width = head[row].shape
        y, x = torch.meshgrid(_centres(height), _centres(width), indexing="ij")
        where = torch.stack([(x - centre[0]) / scale, (y - centre[1]) / scale], dim=-1)[None]
        back = functional.grid_sample(made, where, mode="bilinear", padding_mode="border", align_corners=False)[0]
        result[row] = torch.where(head[row][None], back, result[row])
    return result


def head_window(head: Tensor) -> Tensor | None:
    """(1, 64, 64, 2) grid of the square about a head in a picture (H, W) bool; None where there is none."""
    found = _theta(head)
    if found is None:
        return None
    scale, centre = found
    y, x = torch.meshgrid(_centres(SIZE), _centres(SIZE), indexing="ij")
    return torch.stack([x * scale + centre[0], y * scale + centre[1]], dim=-1)[None]


def _theta(head: Tensor) -> tuple[float, tuple[float, float]] | None:
    rows, columns = head.any(dim=1).nonzero()[:, 0], head.any(dim=0).nonzero()[:, 0]
    if not len(rows):
        return None
    size = head.shape[0]
    low, high = (float(columns[0]), float(rows[0])), (float(columns[-1]) + 1, float(rows[-1]) + 1)
    centre = ((low[0] + high[0]) / size - 1, (low[1] + high[1]) / size - 1)
    return 1.1 * max(high[0] - low[0], high[1] - low[1]) / size, centre


def _centres(count: int) -> Tensor:
    return (torch.arange(count) + 0.5) / count * 2 - 1


HEAD_WEIGHTS: Final = WeightsFile[HeadShape, HeadHsv](
    network="head-hsv",
    title="head network",
    build=HeadHsv,
    read_shape=lambda facts: HeadShape(**facts),
    file_name=lambda shape: "head-hsv",
)
