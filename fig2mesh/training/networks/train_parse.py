"""Train the figure parser and score it on held-out crops.

Scores: IoU of the silhouette; mean IoU of the part labels that a crop has; share of visible joints nearer than 0.05
and 0.1 of the figure's height (PCK); share of crops with the arms and legs on the right sides.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from fig2mesh.nets.figure_parser import (
    HEAT,
    INPUT,
    JOINTS,
    LABELS,
    MASK,
    PARSER_WEIGHTS,
    Depthwise,
    FigureParser,
    Parsed,
)
from fig2mesh.skeleton import JOINT
from fig2mesh.training.networks.loop import Regime, TrainingTask, run_loop, seeded
from fig2mesh.training.networks.run_log import write_scores
from fig2mesh.training.networks.schedule import Schedule
from fig2mesh.training.samples.crop_data import KINDS, concatenate, crops_digest, load_crops
from fig2mesh.training.samples.crop_views import CropViewer

BATCH: Final = 8
RATE: Final = 1e-3
ENCODER_RATE: Final = 0.4
"""Learning rate of the encoder, as a share of the rate: it starts from pretrained weights."""

SPREAD: Final = 0.9
"""Standard deviation of the target around a joint, cells of the heat map."""

GUESSED: Final = 0.35
"""Weight of hidden joints; visible ones have 1."""

DOODLES: Final = 0.42
"""Share of doodles among training samples."""

HELD_OUT: Final = ("valid-clips", "valid-characters")
VIEWS = 64
"""Number of views of each of these that are scored."""


def train_parse(
    data: Path,
    out: Path,
    schedule: Schedule,
    *,
    blazepose: Path | None = None,
    whole: bool = False,
) -> dict[str, float]:
    """Train on the crops of `data`; weights, log and scores go to `out`.

    blazepose : TFLite file with initial weights of the encoder
    whole : train the encoder's first stages and its filters too, which takes twice the time and gains little
    """
    import cv2

    cv2.setNumThreads(1)
    batch, rate = schedule.batch_and_rate(BATCH, RATE)
    seed, init = schedule.seed, schedule.init
    net = seeded(seed, FigureParser)
    if blazepose is not None:
        from fig2mesh.training.networks.blazepose import start_from

        start_from(net, blazepose)
    if init is not None:
        net.load_state_dict(PARSER_WEIGHTS.read(PARSER_WEIGHTS.path(net.shape, init))[0].state_dict())
        net.requires_grad_(True)
    if not whole:
        for early in (
            net.encoder.stem,
            net.encoder.stem_filter,
            net.encoder.stem_narrow,
            net.encoder.stage64,
            net.encoder.stage32,
        ):
            early.requires_grad_(False)
        for module in net.encoder.modules():
            if isinstance(module, Depthwise):
                module.requires_grad_(False)
    net = net.to(memory_format=torch.channels_last)
    parts = [load_crops(data, "train", kind) for kind in KINDS]
    bodies, doodles = (len(part) for part in parts)
    viewer = CropViewer(concatenate(*parts), seed)
    parts.clear()
    held = [CropViewer(load_crops(data, split, limit=1), seed + 1, backgrounds=40) for split in HELD_OUT]
    views = [_fixed(viewer_, VIEWS) for viewer_ in held]

    def step(model: torch.nn.Module, generator: torch.Generator, progress: float) -> Mapping[str, Tensor]:
        rng = np.random.default_rng(int(torch.randint(2**62, (), generator=generator)))
        drawn = rng.random(batch) < DOODLES
        rows = np.where(drawn, bodies + rng.integers(doodles, size=batch), rng.integers(bodies, size=batch))
        target = collate([viewer.view(int(row), rng) for row in rows])
        return losses(model(target["picture"]), target)

    def validate() -> Mapping[str, float]:
        found = [score(net, target) for target in views]
        return {name: float(np.mean([scores[name] for scores in found])) for name in found[0]}

    encoder = [parameter for parameter in net.encoder.parameters() if parameter.requires_grad]
    known = {id(parameter) for parameter in encoder}
    optimizer = torch.optim.AdamW(
        [
            {"params": [p for p in net.parameters() if p.requires_grad and id(p) not in known], "lr": rate},
            {"params": encoder, "lr": rate * ENCODER_RATE},
        ],
        weight_decay=0.01,
    )
    facts: dict[str, Any] = {
        "data": crops_digest(data),
        "crops": len(viewer.crops),
        "seed": seed,
        "start": None if blazepose is None else "BlazePose full (Apache-2.0)",
    }
    result = run_loop(
        TrainingTask(
            net,
            optimizer,
            step,
            validate,
            batch=batch,
            arguments={"data": facts["data"], "init": None if init is None else init.name, "whole": whole},
        ),
        out,
        schedule,
        Regime(warmup=60, ema=0.998, clip=1.0, amp=True, validations=12),
    )
    scores = dict(validate())
    PARSER_WEIGHTS.save(
        PARSER_WEIGHTS.path(net.shape, out),
        net,
        {
            **facts,
            "steps": result.steps,
            "samples": result.samples,
            "minutes": round(result.seconds / 60, 1),
            "scores": scores,
        },
    )
    write_scores(out, scores)
    return scores


def collate(views: list[Any]) -> dict[str, Tensor]:
    """Views as tensors: picture (N, 3, H, W) float32 0-1, labels (N, H/2, W/2) int64, joints, visible, inside."""
    step = INPUT // MASK
    picture = torch.from_numpy(np.stack([view.picture for view in views])).permute(0, 3, 1, 2).float() / 255
    return {
        "picture": picture.contiguous(memory_format=torch.channels_last),
        "labels": torch.from_numpy(
            np.stack([view.labels[step // 2 :: step, step // 2 :: step] for view in views])
        ).long(),
        "joints": torch.from_numpy(np.stack([view.joints for view in views])),
        "visible": torch.from_numpy(np.stack([view.visible for view in views])),
        "inside": torch.from_numpy(np.stack([view.inside for view in views])),
    }


def losses(found: Parsed, target: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Loss and its terms."""
    mask = (target["labels"] > 0).float()
    cross = functional.binary_cross_entropy_with_logits(found.silhouette, mask)
    share = found.silhouette.sigmoid()
    overlap = 1 - (2 * (share * mask).sum((1, 2)) + 1) / ((share + mask).sum((1, 2)) + 1)
    silhouette = cross + 0.5 * overlap.mean()
    labels = functional.cross_entropy(found.labels, target["labels"])
    wanted = heat_targets(target["joints"])
    weight = target["inside"].float() * torch.where(target["visible"], 1.0, GUESSED)
    joints = -(wanted * found.heat.flatten(2).log_softmax(dim=2)).sum(dim=2)
    joint = (joints * weight).sum() / weight.sum().clamp_min(1)
    seen = functional.binary_cross_entropy_with_logits(found.visible, target["visible"].float())
    return {
        "loss": 2.0 * silhouette + labels + 0.5 * joint + 0.2 * seen,
        "silhouette": silhouette,
        "labels": labels,
        "joints": joint,
        "visible": seen,
    }


def heat_targets(joints: Tensor) -> Tensor:
    """(N, 21, HEAT²) target heat maps: a Gaussian around each joint, of sum 1. joints : (N, 21, 2) shares."""
    cells = torch.arange(HEAT) + 0.5
    bell = [(-0.5 * ((joints[..., axis, None] * HEAT - cells) / SPREAD) ** 2).softmax(dim=2) for axis in (0, 1)]
    return (bell[1][..., :, None] * bell[0][..., None, :]).flatten(2)


def _fixed(viewer: CropViewer, count: int) -> dict[str, Tensor]:
    """Collate `count` views that are the same every time."""
    rng = np.random.default_rng(5)
    rows = np.linspace(0, len(viewer.crops) - 1, count).astype(int)
    return collate([viewer.view(int(row), rng) for row in rows])


def peaks(heat: Tensor) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Peak positions (N, 21, 2) as shares of the picture, and the share of the map's mass near them (N, 21)."""
    count, size = heat.shape[0], heat.shape[-1]
    share = heat.flatten(2).softmax(dim=2).reshape(count, JOINTS, size, size)
    near = functional.avg_pool2d(share, 5, 1, 2, count_include_pad=True) * 25
    best = near.flatten(2).argmax(dim=2)
    row, column = best // size, best % size
    cells = torch.arange(size)
    window = ((cells[None, None] - row[..., None]).abs() <= 2).float()[..., :, None] * (
        (cells[None, None] - column[..., None]).abs() <= 2
    ).float()[..., None, :]
    local = share * window
    mass = local.sum((2, 3)).clamp_min(1e-9)
    x = (local.sum(2) * (cells + 0.5)).sum(2) / mass / size
    y = (local.sum(3) * (cells + 0.5)).sum(2) / mass / size
    return torch.stack([x, y], dim=2).numpy().astype(np.float32), mass.numpy().astype(np.float32)


@torch.no_grad()
def score(net: FigureParser, target: Mapping[str, Tensor]) -> dict[str, float]:
    """Scores of the network alone on views: without a second pass or refinement."""
    parts = [net(chunk) for chunk in torch.split(target["picture"], 16)]
    found = Parsed(*(torch.cat(values) for values in zip(*parts, strict=True)))
    mask, own = target["labels"] > 0, found.silhouette > 0
    iou = (mask & own).sum((1, 2)) / (mask | own).sum((1, 2)).clamp_min(1)
    labels = found.labels.argmax(dim=1)
    each = []
    for row in range(len(labels)):
        for part in range(1, LABELS):
            a, b = labels[row] == part, target["labels"][row] == part
            if b.any():
                each.append(float((a & b).sum() / (a | b).sum()))
    places, _ = peaks(found.heat)
    rows = [np.flatnonzero(m.any(axis=1)) for m in mask.numpy()]
    columns = [np.flatnonzero(m.any(axis=0)) for m in mask.numpy()]
    tall = np.array([max(np.ptp(r), np.ptp(c)) + 1 for r, c in zip(rows, columns, strict=True)]) / mask.shape[-1]
    joints, visible = target["joints"].numpy(), target["visible"].numpy()
    off = np.linalg.norm(places - joints, axis=2) / tall[:, None]
    return {
        "iou": float(iou.mean()),
        "part_iou": float(np.mean(each)),
        "pck05": float((off < 0.05)[visible].mean()),
        "pck10": float((off < 0.1)[visible].mean()),
        "sides": sides_right(places, joints),
        "seen": float(((found.visible > 0) == target["visible"])[target["inside"]].float().mean()),
    }


def sides_right(found: NDArray[np.floating], joints: NDArray[np.floating]) -> float:
    """Share of limbs (elbows, wrists, knees, ankles) nearer to their own position than to their twin's."""
    right = []
    for name in ("elbow", "wrist", "knee", "ankle"):
        l, r = JOINT[f"l_{name}"], JOINT[f"r_{name}"]  # noqa: E741
        same = np.linalg.norm(found[:, [l, r]] - joints[:, [l, r]], axis=2).sum(axis=1)
        crossed = np.linalg.norm(found[:, [l, r]] - joints[:, [r, l]], axis=2).sum(axis=1)
        apart = np.linalg.norm(joints[:, l] - joints[:, r], axis=1) > 0.04
        right += (same < crossed)[apart].tolist()
    return float(np.mean(right)) if right else 1.0
