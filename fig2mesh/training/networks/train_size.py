"""Train the perceptrons that predict a part's size, and score them on held-out people and clips.

Scores are mean relative errors, |found / true - 1| in percent, of the width, height and depth of the part's box and of
the edge of its cube: with the mask of the whole part, with the mask of its visible region, and without a mask.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from fig2mesh.field.camera import VIEW_YAW_DEG, axes
from fig2mesh.nets.part_size import OUTPUTS, SIZE_WEIGHTS, PartSizeNet, SizeShape, bone_unit
from fig2mesh.records import _Checked
from fig2mesh.skeleton import MIRRORED, PART_KIND, anchor_joints
from fig2mesh.training.networks.loop import Regime, TrainingTask, run_loop, seeded
from fig2mesh.training.networks.run_log import write_scores
from fig2mesh.training.networks.schedule import Schedule
from fig2mesh.training.samples.build import read_shard, recipe_digest, shards

BATCH: Final = 512
RATE: Final = 3e-3

WHOLE, SEEN = 0.5, 0.3
"""Shares of training samples with the mask of the whole part and of its visible region; the others have none."""

STRETCH: Final = 0.18
"""Maximum logarithm of the factor by which half of the samples are stretched along each axis."""

SHAKE: Final = (0.04, 0.04, 0.10)
"""Maximum standard deviation of errors of lifted joints, units of the bone: x, y, depth."""

NAMES: Final = ("width", "height", "depth", "edge")


@dataclass(frozen=True)
class PartSizes(_Checked):
    """Parts of one kind, seen from all four sides, right ones mirrored; view axes, FIGURE units.

    anchors : (N, A, 3) float32, relative to the centre of the part's cube
    size : (N, 4) float32, width, height and depth of the part's box, and edge of its cube
    whole, seen : (N, 2) float32, width and height of the part's mask, and of its visible region; zeros where empty
    """

    anchors: NDArray[np.float32]
    size: NDArray[np.float32]
    whole: NDArray[np.float32]
    seen: NDArray[np.float32]

    def __post_init__(self) -> None:
        self._put("anchors", np.float32, (None, None, 3))
        count = len(self.anchors)
        self._put("size", np.float32, (count, OUTPUTS))
        self._put("whole", np.float32, (count, 2))
        self._put("seen", np.float32, (count, 2))


def read_sizes(data: Path, split: str, kind: str) -> PartSizes:
    """Read the parts of a kind in all shards of a split."""
    columns: list[tuple[NDArray[np.float64], ...]] = []
    for path in shards(data, split):
        arrays = read_shard(path, ("joints", "centre", "edge", "size", "mask_amodal", "mask_visible"))
        for part in (part for part, own in PART_KIND.items() if own == kind):
            for view, yaw in enumerate(VIEW_YAW_DEG.values()):
                columns.append(_part(arrays, part, view, axes(yaw)))
    return PartSizes(*(np.concatenate(column).astype(np.float32) for column in zip(*columns, strict=True)))


def _part(
    arrays: dict[str, NDArray[Any]], part: int, view: int, turn: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    row = part - 1
    edge = arrays["edge"][:, row, None]
    anchors = arrays["joints"][:, list(anchor_joints(part))] - arrays["centre"][:, None, row]
    anchors = anchors @ turn.T * [-1.0 if MIRRORED[part] else 1.0, 1.0, 1.0]
    size = np.concatenate([arrays["size"][:, row] @ np.abs(turn.T), edge], axis=1)
    masks = [mask_extent(arrays[f"mask_{name}"][:, view, row]) * edge for name in ("amodal", "visible")]
    return anchors, size, *masks


def mask_extent(packed: NDArray[np.uint8]) -> NDArray[np.float64]:
    """(N, 2) width and height of masks (N, 64, 8), bits packed along the rows; shares of the square."""
    masks: NDArray[np.bool_] = np.unpackbits(packed, axis=-1).astype(np.bool_)
    result = []
    for axis in (1, 2):
        filled: NDArray[np.bool_] = np.asarray(masks.any(axis=axis))
        length = filled.shape[1]
        extent = length - filled.argmax(axis=1) - filled[:, ::-1].argmax(axis=1)
        result.append(np.where(filled.any(axis=1), extent / length, 0.0))
    return np.stack(result, axis=1)


class SizeTensors(NamedTuple):
    """`PartSizes` as tensors."""

    anchors: Tensor
    size: Tensor
    whole: Tensor
    seen: Tensor

    @classmethod
    def from_sizes(cls, sizes: PartSizes, device: str) -> SizeTensors:
        arrays = (sizes.anchors, sizes.size, sizes.whole, sizes.seen)
        return cls(*(torch.tensor(array, device=device) for array in arrays))


def train_size(
    data: Path,
    kind: str,
    out: Path,
    schedule: Schedule,
) -> tuple[PartSizeNet, dict[str, float]]:
    """Train the network of a kind; writes weights, log and scores to `out`, returns it with the held-out scores."""
    batch, rate = schedule.batch_and_rate(BATCH, RATE)
    device = schedule.device
    known = SizeTensors.from_sizes(read_sizes(data, "train", kind), device)
    held = {
        split: SizeTensors.from_sizes(read_sizes(data, split, kind), device)
        for split in ("valid-clips", "valid-characters")
    }
    net = seeded(schedule.seed, lambda: PartSizeNet(SizeShape(kind))).to(device)
    # Start from the median size, not from the length of the bone.
    offset = (known.size / bone_unit(known.anchors)[:, None]).log().median(dim=0).values
    with torch.no_grad():
        last = net.layers[-1]
        assert isinstance(last, torch.nn.Linear)
        last.bias.copy_(offset)

    def step(model: torch.nn.Module, generator: torch.Generator, progress: float) -> Mapping[str, Tensor]:
        anchors, mask, size, exact = _augmented(known, batch, generator)
        error = torch.nn.functional.smooth_l1_loss(model(anchors, mask), size.log(), beta=0.1, reduction="none")
        box, edge = error[:, :3].mean(), error[exact, 3].mean()
        return {"loss": box + edge, "box": box.detach(), "edge": edge.detach()}

    def validate() -> Mapping[str, float]:
        scores = size_scores(net, held["valid-characters"])
        return {name: scores[f"{name}_percent"] for name in ("whole_depth", "none_depth", "whole_edge", "none_edge")}

    optimizer = torch.optim.AdamW(net.parameters(), rate, weight_decay=1e-4)
    result = run_loop(
        TrainingTask(
            net,
            optimizer,
            step,
            validate,
            batch=batch,
            arguments={"kind": kind, "data": recipe_digest(data), "parts": len(known.size)},
        ),
        out,
        schedule,
        Regime(clip=1.0, amp=False),
    )
    scores = {
        f"{split}_{name}": value for split, columns in held.items() for name, value in size_scores(net, columns).items()
    }
    write_scores(out, scores)
    facts = {
        "data": {"parts": len(known.size), "name": data.name},
        "seed": schedule.seed,
        "steps": result.steps,
        "samples": result.samples,
        "scores": scores,
    }
    SIZE_WEIGHTS.save(SIZE_WEIGHTS.path(net.shape, out), net, facts)
    return net, scores


def _augmented(known: SizeTensors, count: int, generator: torch.Generator) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Augmented anchors, mask, size, and bool: samples whose cube edge is still valid.

    A body stretched along the axes of the view has boxes and masks stretched alike; the edge of a cube is only known
    where nothing was stretched.
    """
    device = known.size.device
    rows = torch.randint(len(known.size), (count,), generator=generator).to(device)
    amount = torch.rand(count, 8, generator=generator).to(device)
    noise = torch.randn(count, known.anchors.shape[1], 3, generator=generator).to(device)
    anchors, size = known.anchors[rows], known.size[rows]
    stretched = amount[:, 0] < 0.5
    factor = torch.exp((2 * amount[:, 1:4] - 1) * STRETCH * stretched[:, None])
    mask = torch.where(amount[:, 4:5] < WHOLE, known.whole[rows], known.seen[rows])
    mask = torch.where(amount[:, 4:5] < WHOLE + SEEN, mask, 0.0) * factor[:, :2]
    anchors = anchors * factor[:, None]
    shake = noise * torch.tensor(SHAKE, device=device) * (amount[:, 5] * bone_unit(anchors))[:, None, None]
    return anchors + shake, mask, torch.cat([size[:, :3] * factor, size[:, 3:]], dim=1), ~stretched


@torch.no_grad()
def size_scores(net: PartSizeNet, columns: SizeTensors) -> dict[str, float]:
    """Mean relative errors in percent, as defined in the module's docstring."""
    net.eval()
    masks = {"whole": columns.whole, "seen": columns.seen, "none": torch.zeros_like(columns.whole)}
    result: dict[str, float] = {}
    for given, mask in masks.items():
        error = (net(columns.anchors, mask).exp() / columns.size - 1).abs().mean(dim=0)
        result |= {f"{given}_{name}_percent": 100 * float(value) for name, value in zip(NAMES, error, strict=True)}
    return result
