"""DISN: the signed distance field of a body part from its 64 x 64 mask and anchor joints (paper §4.2, appendix A).

Of the first decoder layer's inputs the global and pose features are the same for all points of a part, and the local
ones are bilinear in five small maps. The layer is linear, so `query` multiplies each of them where it is smallest:
constants once per part, the three coarse maps once per map pixel, encoded points and two fine maps once per point.
`query_plain` concatenates everything as appendix A draws it; both are the same function of the same parameters.

What did not work: one decoder, half as wide, with points in the bone's frame and distances from a capsule. It was
trained on 250 samples per second instead of 170, and yet after 5.5 minutes on one core, against 4 of two streams with
pose points, its hands were 6.5 points of IoU worse: 37.6 % against 44.1 %, held out.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from fig2mesh.nets.weights import WeightsFile
from fig2mesh.skeleton import ANCHORS

MASK: Final = 64
"""Pixels of a mask's edge; §4.2, "64x64px masks"."""
FILTERS: Final = (8, 16, 32, 64, 128)
"""Filters of the encoder's levels; appendix A."""
GLOBAL: Final = 256
"""Size of the global feature; appendix A."""
POINT: Final = (16, 64, 128)
"""Filters of the encoders of query and pose points; appendix A."""
DECODER: Final = (512, 256)
"""Filters of the decoder before the last, 1; appendix A."""
FINE: Final = 2
"""Levels whose maps are sampled; the others have fewer pixels than filters, and are multiplied before sampling."""

VARIANTS: Final = {
    "one-stream": (1, False),
    "one-stream-pose": (1, True),
    "two-stream": (2, False),
    "two-stream-pose": (2, True),
}
"""Name → (streams, pose points); table 2."""


@dataclass(frozen=True)
class DisnShape:
    """Kind of part and variant (of `VARIANTS`) of a network."""

    kind: str
    streams: int = 2
    pose_points: bool = True

    def __post_init__(self) -> None:
        if self.kind not in ANCHORS:
            raise ValueError(f"kind: {self.kind!r}, expected one of {', '.join(ANCHORS)}")
        if (self.streams, self.pose_points) not in VARIANTS.values():
            raise ValueError(f"{self}: no such variant")

    @classmethod
    def of(cls, kind: str, variant: str) -> DisnShape:
        """Shape by the name of its variant."""
        if variant not in VARIANTS:
            raise ValueError(f"variant: {variant!r}, expected one of {', '.join(VARIANTS)}")
        return cls(kind, *VARIANTS[variant])

    @property
    def variant(self) -> str:
        """Name in `VARIANTS`."""
        return next(name for name, value in VARIANTS.items() if value == (self.streams, self.pose_points))

    @property
    def anchors(self) -> int:
        """Number of pose points."""
        return len(ANCHORS[self.kind])


class Features(NamedTuple):
    """Features of B parts, computed before any point is queried.

    maps : five (B, C, h, w), C = `FILTERS`; overall : (B, 256); pose : (B, A * 128), A = 0 without pose points
    constants : one per stream (B, 512): the first decoder layer's share of what is the same for all points, with bias
    """

    maps: tuple[Tensor, ...]
    overall: Tensor
    pose: Tensor
    constants: tuple[Tensor, ...]


class Stream(nn.Module):
    """One decoder: [encoded point, global?, local?, pose?] → distance."""

    def __init__(self, inputs: dict[str, int]) -> None:
        """inputs : name → size, in the order of the first layer's columns."""
        super().__init__()
        ends = list(itertools.accumulate(inputs.values()))
        self.slices = {name: slice(end - inputs[name], end) for name, end in zip(inputs, ends, strict=True)}
        self.first = nn.Linear(ends[-1], DECODER[0])
        self.second = nn.Linear(*DECODER)
        self.third = nn.Linear(DECODER[1], 1)

    def share(self, name: str) -> Tensor:
        """(512, C) columns of the first layer that belong to one input."""
        return self.first.weight[:, self.slices[name]]

    def constant(self, overall: Tensor, pose: Tensor) -> Tensor:
        """(B, 512) share of the inputs that are the same for all points, and the bias."""
        known = {name: value for name, value in (("global", overall), ("pose", pose)) if name in self.slices}
        if not known:
            return self.first.bias.expand(len(overall), -1)
        weight = torch.cat([self.share(name) for name in known], 1)
        return F.linear(torch.cat(list(known.values()), 1), weight, self.first.bias)

    def rest(self, hidden: Tensor) -> Tensor:
        """(B, N) distances from the first layer's sums (B, N, 512), which are overwritten."""
        hidden = F.relu(self.second(F.relu(hidden, inplace=True)), inplace=True)
        # The bias is added in single precision: bfloat16 would cost small distances their digits.
        return F.linear(hidden, self.third.weight)[..., 0].float() + self.third.bias


class Disn(nn.Module):
    """The network; masks come from `as_input`, coordinates are PART (mask row 0 at y = +1, column 0 at x = -1)."""

    def __init__(self, shape: DisnShape) -> None:
        super().__init__()
        self.shape = shape
        self.levels = nn.ModuleList(
            nn.Sequential(
                nn.Conv2d(c_in, c_out, 3, stride=2, padding=1),
                nn.ReLU(),
                nn.Conv2d(c_out, c_out, 3, padding=1),
                nn.ReLU(),
            )
            for c_in, c_out in itertools.pairwise((1, *FILTERS))
        )
        self.overall = nn.Linear(FILTERS[-1] * (MASK >> len(FILTERS)) ** 2, GLOBAL)
        self.point = _pointwise()
        pose = {}
        if shape.pose_points:
            self.pose = _pointwise()
            pose = {"pose": shape.anchors * POINT[-1]}
        point, overall, local = {"point": POINT[-1]}, {"global": GLOBAL}, {"local": sum(FILTERS)}
        split = [overall | local] if shape.streams == 1 else [overall, local]
        self.streams = nn.ModuleList(Stream(point | own | pose) for own in split)
        self.apply(_start)
        for stream in self._streams():
            nn.init.normal_(stream.third.weight, std=0.02)

    def encode(self, mask: Tensor, anchors: Tensor) -> Features:
        """Features of B parts; mask : (B, 1, 64, 64), anchors : (B, A, 3) PART."""
        maps: list[Tensor] = []
        for level in self.levels:
            maps.append(level(maps[-1] if maps else mask))
        overall = self.overall(maps[-1].flatten(1))
        pose = self.pose(anchors).flatten(1) if self.shape.pose_points else anchors.new_zeros(len(anchors), 0)
        constants = tuple(stream.constant(overall, pose) for stream in self._streams())
        return Features(tuple(maps), overall, pose, constants)

    def forward(self, mask: Tensor, anchors: Tensor, points: Tensor) -> Tensor:
        """(B, N) signed distances at points (B, N, 3), PART units."""
        return self.query(self.encode(mask, anchors), points)

    def query(self, features: Features, points: Tensor, local: Tensor | None = None) -> Tensor:
        """(B, N) signed distances at points (B, N, 3), cheaply.

        local : (B, N, 512) the first layer's share of local features, cached by the caller from `local_share`
        """
        encoded = self.point(points)
        distances = []
        for stream, constant in zip(self._streams(), features.constants, strict=True):
            columns, table = encoded, stream.share("point").t().expand(len(points), -1, -1)
            if "local" in stream.slices and local is None:
                columns = torch.cat([encoded, _sampled(features, points).to(encoded.dtype)], -1)
                below = _local_table(stream, features)
                table = torch.cat([table.to(below.dtype), below], 1)
            hidden = torch.baddbmm(constant[:, None], columns, table)
            if "local" in stream.slices and local is not None:
                hidden = hidden.add_(local)
            distances.append(stream.rest(hidden))
        return torch.stack(distances).sum(0)

    def query_plain(self, features: Features, points: Tensor) -> Tensor:
        """(B, N) the same as `query`, by concatenation."""
        count = points.shape[1]
        inputs = {
            "point": self.point(points),
            "global": features.overall[:, None].expand(-1, count, -1),
            "local": torch.cat([_bilinear(level.float(), points) for level in features.maps], -1),
            "pose": features.pose[:, None].expand(-1, count, -1),
        }
        distances = [
            stream.rest(stream.first(torch.cat([inputs[name] for name in stream.slices], -1)))
            for stream in self._streams()
        ]
        return torch.stack(distances).sum(0)

    def local_share(self, features: Features, points: Tensor) -> Tensor:
        """(B, N, 512) the first layer's share of local features at points (B, N, 3), whose z does not matter."""
        stream = next(stream for stream in self._streams() if "local" in stream.slices)
        return torch.bmm(_sampled(features, points), _local_table(stream, features))

    def _streams(self) -> list[Stream]:
        return [stream for stream in self.streams if isinstance(stream, Stream)]


def as_input(masks: NDArray[np.bool_]) -> Tensor:
    """(B, 1, 64, 64) float32 input of a network, 0 or 1, from masks (B, 64, 64)."""
    return torch.from_numpy(np.ascontiguousarray(masks, np.float32)[:, None])


def _start(layer: nn.Module) -> None:
    """He initialisation: with PyTorch's default the mask fades through ten convolutions.

    Hands, 240 steps: mean error 0.069 PART units, with PyTorch's 0.088.
    """
    if isinstance(layer, nn.Linear | nn.Conv2d):
        nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
        assert layer.bias is not None
        nn.init.zeros_(layer.bias)


class _Pointwise(nn.Sequential):
    """Convolutions of size 1 over points. The first layer keeps single precision: bfloat16 has three digits of x."""

    def forward(self, input: Tensor) -> Tensor:
        first, *others = self
        with torch.autocast(input.device.type, enabled=False):
            value: Tensor = first(input.float())
        for layer in others:
            value = layer(value)
        return value


def _pointwise() -> _Pointwise:
    layers: list[nn.Module] = []
    for before, after in itertools.pairwise((3, *POINT)):
        layers += [nn.Linear(before, after), nn.ReLU(inplace=True)]
    return _Pointwise(*layers)


def _sampled(features: Features, points: Tensor) -> Tensor:
    """(B, N, 24 + 84): the two fine maps at points, then the bilinear weights of each pixel of the coarse ones."""
    fine = [_bilinear(level.float(), points) for level in features.maps[:FINE]]
    weights = [_hats(points, level.shape[-1]) for level in features.maps[FINE:]]
    return torch.cat([*fine, *weights], -1)


def _local_table(stream: Stream, features: Features) -> Tensor:
    """(B, 24 + 84, 512) factor of `_sampled`: weights of the fine maps, products of the coarse ones."""
    weights = torch.split(stream.share("local"), list(FILTERS), 1)
    fine = torch.cat(weights[:FINE], 1).t().expand(len(features.overall), -1, -1)
    coarse = [
        F.linear(level.flatten(2).transpose(1, 2), weight)
        for level, weight in zip(features.maps[FINE:], weights[FINE:], strict=True)
    ]
    return torch.cat([fine.to(coarse[0].dtype), *coarse], 1)


def _bilinear(maps: Tensor, points: Tensor) -> Tensor:
    """(B, N, C) maps (B, C, h, w) at the (x, y) of points (B, N, 3), extrapolated beyond the pixel centres."""
    place = torch.stack([points[..., 0], -points[..., 1]], -1)[:, None]
    with torch.autocast(maps.device.type, enabled=False):
        values = F.grid_sample(maps, place, mode="bilinear", padding_mode="border", align_corners=False)
    return values[:, :, 0].transpose(1, 2)


def _hats(points: Tensor, size: int) -> Tensor:
    """(B, N, size²) weight of each pixel of a map in `_bilinear`."""
    pixel = torch.arange(size, device=points.device, dtype=points.dtype)
    place = torch.stack([points[..., 0], -points[..., 1]], -1)
    place = ((place + 1) * (size / 2) - 0.5).clamp(0, size - 1)
    hats = (1 - (place[..., None] - pixel).abs()).clamp_min_(0)
    return (hats[..., 1, :, None] * hats[..., 0, None, :]).flatten(-2)


PART_WEIGHTS: Final = WeightsFile[DisnShape, Disn](
    network="disn",
    title="part network",
    build=Disn,
    read_shape=lambda facts: DisnShape.of(facts["kind"], facts["variant"]),
    file_name=lambda shape: f"disn-{shape.kind}-{shape.variant}",
    write_shape=lambda shape: {"kind": shape.kind, "variant": shape.variant},
)
