"""Network from a picture of one figure to its silhouette, part labels and joints.

The encoder has the layers of BlazePose "full" (MobileNetV2's inverted residuals, no normalisation), so that its
weights can initialise the training; the decoder is a U-Net's. One crop of 192 × 192 takes some 30 ms on one core.

Sources: Sandler et al. 2018, "MobileNetV2"; Bazarevsky et al. 2020, "BlazePose"; Ronneberger et al. 2015, "U-Net".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from fig2mesh.nets.weights import WeightsFile
from fig2mesh.skeleton import JOINT_NAMES, PART_NAMES

INPUT: Final = 192
"""Pixels per side of the input picture; other multiples of 32 work, at other sizes of figures than trained on."""

HEAT: Final = INPUT // 4
"""Cells per side of a joint's heat map."""

MASK: Final = INPUT // 2
"""Pixels per side of silhouette and labels."""

JOINTS, LABELS = len(JOINT_NAMES), len(PART_NAMES)


class Parsed(NamedTuple):
    """Output of the network for N crops.

    silhouette : (N, 96, 96) logits; labels : (N, 18, 96, 96) logits of `PART_NAMES`
    heat : (N, 21, 48, 48) logits, a softmax over the cells of each joint's map; visible : (N, 21) logits
    """

    silhouette: Tensor
    labels: Tensor
    heat: Tensor
    visible: Tensor


@dataclass(frozen=True)
class FigureParserShape:
    """width : channels of the decoder at 1/16, 1/8, 1/4 and 1/2 of the picture's size."""

    width: tuple[int, int, int, int] = (128, 96, 64, 24)


SHIPPED: Final = FigureParserShape()


class Depthwise(nn.Conv2d):
    """Depthwise convolution, in single precision: in bfloat16 it is slow on CPUs."""

    def __init__(self, channels: int, size: int, stride: int = 1) -> None:
        super().__init__(channels, channels, size, stride, size // 2, groups=channels)

    def forward(self, values: Tensor) -> Tensor:
        with torch.autocast(values.device.type, enabled=False):
            return functional.relu6(super().forward(values.float()))


class Widened(nn.Module):
    """Inverted residual: widened by a 1 × 1 convolution, filtered by channel, narrowed; added where shapes agree."""

    def __init__(self, inputs: int, wide: int, outputs: int, size: int, stride: int = 1) -> None:
        super().__init__()
        self.widen = nn.Conv2d(inputs, wide, 1)
        self.filter = Depthwise(wide, size, stride)
        self.narrow = nn.Conv2d(wide, outputs, 1)
        self.added = stride == 1 and inputs == outputs

    def forward(self, values: Tensor) -> Tensor:
        out: Tensor = self.narrow(self.filter(functional.relu6(self.widen(values))))
        return values + out if self.added else out


class Side(nn.Module):
    """Lateral connection from a stage of the encoder to the pyramid: depthwise, then 1 × 1 convolution."""

    def __init__(self, inputs: int, outputs: int = 48) -> None:
        super().__init__()
        self.filter = Depthwise(inputs, 3)
        self.mix = nn.Conv2d(inputs, outputs, 1)

    def forward(self, values: Tensor) -> Tensor:
        return functional.relu6(self.mix(self.filter(values)))


class Encoder(nn.Module):
    """(N, 3, H, W) RGB 0-1 → features at 1/2 (16 channels), 1/4 (24), 1/8 (32), 1/16 (88), 1/32 (864) of its size, and
    a pyramid at 1/4 (48)."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Conv2d(3, 24, 3, 2, 1)
        self.stem_filter = Depthwise(24, 3)
        self.stem_narrow = nn.Conv2d(24, 16, 1)
        self.stage64 = nn.Sequential(Widened(16, 64, 24, 3, 2), Widened(24, 144, 24, 3))
        self.stage32 = nn.Sequential(Widened(24, 144, 32, 5, 2), Widened(32, 192, 32, 5))
        self.stage16 = nn.Sequential(
            Widened(32, 192, 64, 3, 2),
            Widened(64, 384, 64, 3),
            Widened(64, 384, 64, 3),
            Widened(64, 384, 88, 5),
            Widened(88, 528, 88, 5),
            Widened(88, 528, 88, 5),
        )
        self.stage8 = nn.Sequential(Widened(88, 528, 144, 5, 2), *(Widened(144, 864, 144, 5) for _ in range(3)))
        self.last = nn.Conv2d(144, 864, 1)
        self.last_filter = Depthwise(864, 3)
        self.side8, self.side16, self.side32, self.side64 = Side(864), Side(88), Side(32), Side(24)

    def forward(self, picture: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor, Tensor]:
        half = self.stem_narrow(self.stem_filter(functional.relu6(self.stem(picture))))
        at64 = self.stage64(half)
        at32 = self.stage32(at64)
        at16 = self.stage16(at32)
        at8 = self.last_filter(functional.relu6(self.last(self.stage8(at16))))
        pyramid = self.side8(at8)
        for side, values in ((self.side16, at16), (self.side32, at32), (self.side64, at64)):
            pyramid = _twice(pyramid) + side(values)
        return half, at64, at32, at16, at8, pyramid


class FigureParser(nn.Module):
    """(N, 3, 192, 192) RGB 0-1 → `Parsed`."""

    def __init__(self, shape: FigureParserShape = SHIPPED) -> None:
        super().__init__()
        self.shape = shape
        at16, at8, at4, at2 = shape.width
        self.encoder = Encoder()
        self.narrow = nn.ModuleList(
            [nn.Conv2d(864, at16, 1), nn.Conv2d(at16, at16 // 2, 1), nn.Conv2d(at8, at8 // 2, 1), nn.Conv2d(at4, 16, 1)]
        )
        self.up16 = _pair(at16 + 88, at16)
        self.up8 = _pair(at16 // 2 + 32, at8)
        self.up4 = _pair(at8 // 2 + 24 + 48, at4)
        self.up2 = _pair(16 + 16 + 12, at2)
        self.heat = nn.Conv2d(at4, JOINTS, 1)
        self.direct = nn.Conv2d(48, JOINTS, 1)
        self.visible = nn.Conv1d(JOINTS * at4, JOINTS, 1, groups=JOINTS)
        self.masks = nn.Conv2d(at2, 1 + LABELS, 1)
        for name, module in self.named_modules():
            if isinstance(module, nn.Conv2d) and not name.startswith("encoder"):
                nn.init.kaiming_normal_(module.weight, nonlinearity="relu" if name.startswith("up") else "linear")
                nn.init.zeros_(module.bias)  # type: ignore[arg-type]
        # Training starts with the output of the encoder's pyramid alone.
        for head in (self.heat, self.visible, self.masks):
            nn.init.zeros_(head.weight)
            nn.init.zeros_(head.bias)  # type: ignore[arg-type]

    def forward(self, picture: Tensor) -> Parsed:
        half, quarter, eighth, sixteenth, deepest, pyramid = self.encoder(picture)
        deep, *narrow = self.narrow
        values = self.up16(torch.cat([_twice(functional.relu(deep(deepest))), sixteenth], 1))
        values = self.up8(torch.cat([_twice(narrow[0](values)), eighth], 1))
        values = self.up4(torch.cat([_twice(narrow[1](values)), quarter, pyramid], 1))
        heat = self.heat(values).float() + self.direct(pyramid).float()
        share = heat.flatten(2).softmax(dim=2)
        there = torch.einsum("njc,nfc->njf", share.to(values.dtype), values.flatten(2))
        visible = self.visible(there.flatten(1)[..., None])[..., 0]
        fine = functional.pixel_unshuffle(picture, 2)
        masks = self.masks(self.up2(torch.cat([_twice(narrow[2](values)), half, fine], 1))).float()
        return Parsed(masks[:, 0], masks[:, 1:], heat, visible.float())


def _pair(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, padding=1), nn.ReLU(), nn.Conv2d(outputs, outputs, 3, padding=1), nn.ReLU()
    )


def _twice(values: Tensor) -> Tensor:
    return functional.interpolate(values, scale_factor=2, mode="bilinear", align_corners=False)


PARSER_WEIGHTS: Final = WeightsFile[FigureParserShape, FigureParser](
    network="figure parser",
    title="figure parser",
    build=FigureParser,
    read_shape=lambda facts: FigureParserShape(tuple(facts["width"])),
    file_name=lambda shape: "figure-parser",
)
