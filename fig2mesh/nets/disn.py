"""DISN: the signed distance field of a body part from its 64 x 64 mask and anchor joints (paper §4.2, appendix A).

Of the first decoder layer's inputs the global and pose features are the same for all points of a part, and the local
ones are bilinear in five small maps. The layer is linear, so `query` multiplies each of them where it is smallest:
constants once a part, the three coarse maps once a map pixel, and only encoded points and two fine maps once a point.
`query_plain` concatenates everything as appendix A draws it; both are the same function of the same parameters.
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

from fig2mesh.nets.bones import Frames, bone_frames, feature_count, mask_distance, point_features
from fig2mesh.parts.kinds import ANCHORS

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
BONE_POINT: Final = (64, 128)
BONE_DECODER: Final = (256, 128)
"""The bone variant's inputs say more, so half of the decoder does."""
FINE: Final = 2
"""Levels whose maps are sampled; the others have fewer pixels than filters, and are multiplied before sampling."""

VARIANTS: Final = {
    "one-stream": (1, False, False),
    "one-stream-pose": (1, True, False),
    "two-stream": (2, False, False),
    "two-stream-pose": (2, True, False),
    "bone": (1, True, True),
    "bone-two-stream": (2, True, True),
}
"""Name → (streams, pose points, bone frame): the four of paper table 2, and ours."""


@dataclass(frozen=True)
class DisnShape:
    """Which part a network is for, and which of `VARIANTS` it is."""

    kind: str
    streams: int = 2
    pose_points: bool = True
    bone_frame: bool = False

    def __post_init__(self) -> None:
        if self.kind not in ANCHORS:
            raise ValueError(f"kind: {self.kind!r}, expected one of {', '.join(ANCHORS)}")
        if (self.streams, self.pose_points, self.bone_frame) not in VARIANTS.values():
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
        key = (self.streams, self.pose_points, self.bone_frame)
        return next(name for name, value in VARIANTS.items() if value == key)

    @property
    def anchors(self) -> int:
        """Pose points."""
        return len(ANCHORS[self.kind])


class Features(NamedTuple):
    """What a network knows of B parts before it sees a point.

    maps : five (B, C, h, w), C = `FILTERS`; overall : (B, 256); pose : (B, A * 128), A = 0 without pose points
    constants : one a stream (B, W): the first decoder layer's share of what is the same for all points, bias included
    signed_mask : (B, 1, 64, 64), frames, radius (B,) of the capsule that the field is told from: bone variants only
    """

    maps: tuple[Tensor, ...]
    overall: Tensor
    pose: Tensor
    constants: tuple[Tensor, ...]
    signed_mask: Tensor | None
    frames: Frames | None
    radius: Tensor | None


class Stream(nn.Module):
    """One decoder: [encoded point, global?, local?, pose] → distance."""

    def __init__(self, inputs: dict[str, int], widths: tuple[int, int], skip: int, activation: type[nn.Module]) -> None:
        super().__init__()
        starts = np.cumsum([0, *inputs.values()]).tolist()
        self.slices = {name: slice(starts[i], starts[i + 1]) for i, name in enumerate(inputs)}
        self.first = nn.Linear(starts[-1], widths[0])
        self.second = nn.Linear(widths[0] + skip, widths[1])
        self.third = nn.Linear(widths[1], 1)
        self.skip = skip
        self.activation = activation(inplace=True)

    def share(self, name: str) -> Tensor:
        """(W, C) columns of the first layer that belong to one input."""
        return self.first.weight[:, self.slices[name]]

    def constant(self, overall: Tensor, pose: Tensor) -> Tensor:
        """(B, W) share of the inputs that are the same for all points, and the bias."""
        known = {"global": overall, "pose": pose}
        names = [name for name in known if name in self.slices]
        if not names:
            return self.first.bias.expand(len(overall), -1)
        weight = torch.cat([self.share(name) for name in names], 1)
        return F.linear(torch.cat([known[name] for name in names], 1), weight, self.first.bias)

    def rest(self, hidden: Tensor, encoded: Tensor) -> Tensor:
        """(B, N) distances from the first layer's sums (B, N, W), which are overwritten."""
        hidden = self.activation(hidden)
        if self.skip:
            hidden = torch.cat([hidden, encoded.to(hidden.dtype)], -1)
        hidden = self.activation(self.second(hidden))
        # The bias is added in single precision: bfloat16 would cost small distances their digits.
        return F.linear(hidden, self.third.weight)[..., 0].float() + self.third.bias


class Disn(nn.Module):
    """The network; masks come from `mask_channels`, coordinates are PART (mask row 0 at y = +1, column 0 at x = -1)."""

    def __init__(self, shape: DisnShape) -> None:
        super().__init__()
        self.shape = shape
        activation: type[nn.Module] = nn.SiLU if shape.bone_frame else nn.ReLU
        before = (2 if shape.bone_frame else 1, *FILTERS[:-1])
        self.levels = nn.ModuleList(
            nn.Sequential(
                nn.Conv2d(c_in, c_out, 3, stride=2, padding=1), activation(),
                nn.Conv2d(c_out, c_out, 3, padding=1), activation(),
            ) for c_in, c_out in zip(before, FILTERS, strict=True)
        )  # fmt: skip
        self.overall = nn.Linear(FILTERS[-1] * (MASK >> len(FILTERS)) ** 2, GLOBAL)
        widths = BONE_POINT if shape.bone_frame else POINT
        self.point = _pointwise(feature_count(shape.kind) if shape.bone_frame else 3, widths, activation)
        if shape.pose_points:
            self.pose = _pointwise(3, POINT, activation)
        if shape.bone_frame:
            self.radius = nn.Linear(GLOBAL + shape.anchors * POINT[-1], 1)
        pose = {"pose": shape.anchors * POINT[-1]} if shape.pose_points else {}
        inputs = {"point": widths[-1], "global": GLOBAL, "local": sum(FILTERS), **pose}
        kept = [("global", "local")] if shape.streams == 1 else [("global",), ("local",)]
        self.streams = nn.ModuleList(
            Stream(
                {name: size for name, size in inputs.items() if name in (*names, "point", "pose")},
                BONE_DECODER if shape.bone_frame else DECODER,
                widths[-1] if shape.bone_frame else 0,
                activation,
            )
            for names in kept
        )
        self.apply(_start)
        for stream in self._streams():
            nn.init.normal_(stream.third.weight, std=0.02)
        if shape.bone_frame:
            nn.init.normal_(self.radius.weight, std=0.01)

    def encode(self, mask: Tensor, anchors: Tensor) -> Features:
        """Features of B parts; mask : (B, C, 64, 64), anchors : (B, A, 3) PART."""
        maps: list[Tensor] = []
        for level in self.levels:
            maps.append(level(maps[-1] if maps else mask))
        overall = self.overall(maps[-1].flatten(1))
        pose = self.pose(anchors).flatten(1) if self.shape.pose_points else anchors.new_zeros(len(anchors), 0)
        overall = overall.to(pose.dtype) if self.shape.pose_points else overall
        constants = tuple(stream.constant(overall, pose) for stream in self._streams())
        if not self.shape.bone_frame:
            return Features(tuple(maps), overall, pose, constants, None, None, None)
        radius = F.softplus(self.radius(torch.cat([overall, pose], 1)).float()[:, 0] - 1.5)
        frames = bone_frames(self.shape.kind, anchors)
        return Features(tuple(maps), overall, pose, constants, mask[:, 1:2].float(), frames, radius)

    def forward(self, mask: Tensor, anchors: Tensor, points: Tensor) -> Tensor:
        """(B, N) signed distances at points (B, N, 3), PART units."""
        return self.query(self.encode(mask, anchors), points)

    def query(self, features: Features, points: Tensor, local: Tensor | None = None) -> Tensor:
        """(B, N) signed distances at points (B, N, 3), cheaply.

        local : (B, N, W) the first layer's share of local features, where a caller kept `local_share` of the pixels
        """
        encoded, guess = self._encoded(features, points)
        mixed: tuple[Tensor, Tensor] | None = None
        total = guess
        for stream, constant in zip(self._streams(), features.constants, strict=True):
            share = stream.share("point").t()
            columns, table = encoded, share.expand(len(points), -1, -1)
            if "local" in stream.slices and local is None:
                mixed = mixed or self._sampled(features, points)
                columns = torch.cat([encoded, mixed[0].to(encoded.dtype)], -1)
                table = self._table(stream, features)
            hidden = torch.baddbmm(constant[:, None], columns, table)
            if "local" in stream.slices and local is not None:
                hidden = hidden.add_(local)
            distance = stream.rest(hidden, encoded)
            total = distance if total is None else total + distance
        assert total is not None
        return total

    def query_plain(self, features: Features, points: Tensor) -> Tensor:
        """(B, N) the same as `query`, by concatenation."""
        encoded, guess = self._encoded(features, points)
        count = points.shape[1]
        local = torch.cat([_bilinear(level.float(), points) for level in features.maps], -1)
        inputs = {
            "point": encoded,
            "global": features.overall[:, None].expand(-1, count, -1),
            "local": local,
            "pose": features.pose[:, None].expand(-1, count, -1),
        }
        total = guess
        for stream in self._streams():
            distance = stream.rest(stream.first(torch.cat([inputs[name] for name in stream.slices], -1)), encoded)
            total = distance if total is None else total + distance
        assert total is not None
        return total

    def local_share(self, features: Features, points: Tensor) -> Tensor:
        """(B, N, W) the first layer's share of local features at points (B, N, 3), whose z does not matter."""
        stream = next(stream for stream in self._streams() if "local" in stream.slices)
        sampled, _ = self._sampled(features, points)
        return torch.bmm(sampled, self._table(stream, features)[:, stream.slices["point"].stop :])

    def _streams(self) -> list[Stream]:
        return [stream for stream in self.streams if isinstance(stream, Stream)]

    def _encoded(self, features: Features, points: Tensor) -> tuple[Tensor, Tensor | None]:
        """(B, N, 128) encoded points, and for bone variants (B, N) the capsule from which the field is told."""
        if features.frames is None or features.signed_mask is None or features.radius is None:
            return self.point(points), None
        outline = _bilinear(features.signed_mask, points)[..., 0]
        inputs, nearest = point_features(features.frames, points, outline)
        return self.point(inputs), nearest - features.radius[:, None]

    def _sampled(self, features: Features, points: Tensor) -> tuple[Tensor, Tensor]:
        """(B, N, 24 + 84): the two fine maps at points, then the bilinear weights of each pixel of the coarse ones."""
        fine = [_bilinear(level.float(), points) for level in features.maps[:FINE]]
        weights = [_hats(points, level.shape[-1]) for level in features.maps[FINE:]]
        columns = torch.cat([*fine, *weights], -1)
        return columns, columns

    def _table(self, stream: Stream, features: Features) -> Tensor:
        """(B, 128 + 24 + 84, W) what `_sampled`, after encoded points, is multiplied by."""
        batch = len(features.overall)
        near, far = sum(FILTERS[:FINE]), stream.share("local")
        shared = torch.cat([stream.share("point"), far[:, :near]], 1).t().expand(batch, -1, -1)
        rows, start = [], near
        for level in features.maps[FINE:]:
            filters = level.shape[1]
            rows.append(F.linear(level.flatten(2).transpose(1, 2), far[:, start : start + filters]))
            start += filters
        return torch.cat([shared.to(rows[0].dtype), *rows], 1)


def mask_channels(masks: NDArray[np.bool_], shape: DisnShape) -> Tensor:
    """(B, C, 64, 64) float32 input of a network from masks (B, 64, 64); for bone variants with signed distances."""
    layers = [np.asarray(masks, np.float32)]
    if shape.bone_frame:
        layers.append(mask_distance(masks))
    return torch.from_numpy(np.stack(layers, 1))


def _start(layer: nn.Module) -> None:
    """He's initial values: by PyTorch's own the mask fades on its way through ten convolutions.

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


def _pointwise(inputs: int, widths: tuple[int, ...], activation: type[nn.Module]) -> _Pointwise:
    sizes = (inputs, *widths)
    layers: list[nn.Module] = []
    for before, after in itertools.pairwise(sizes):
        layers += [nn.Linear(before, after), activation(inplace=True)]
    return _Pointwise(*layers)


def _bilinear(maps: Tensor, points: Tensor) -> Tensor:
    """(B, N, C) maps (B, C, h, w) at the (x, y) of points (B, N, 3); beyond pixel centres the border goes on."""
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
