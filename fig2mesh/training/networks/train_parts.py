"""Training and scoring of the part networks (paper §4.2, tables 2 and 3).

A sample is one part in one of four views with one of three masks (whole, visible region, none) and as many points
inside as outside, sampled again each time; the loss is the mean absolute error.

Measured, batch 16 x 1024 points, CPU time on one core with bfloat16 tiles, samples per second: two-stream with pose
points 95 (single precision 34, by concatenation 20), one-stream with pose points 174.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from fig2mesh.nets.decode import decode, decode_dense
from fig2mesh.nets.disn import PART_WEIGHTS, Disn, DisnShape, as_input
from fig2mesh.training.networks.loop import Regime, TrainingTask, run_loop, seeded
from fig2mesh.training.networks.schedule import Schedule
from fig2mesh.training.samples.build import recipe_digest
from fig2mesh.training.samples.part_data import MIRROR, VIEWS, PartData, load_parts, swapped, turned, turned_grid

MASK_MIX: Final = (0.45, 0.45, 0.10)
"""Shares of whole, visible and empty masks."""
CHECKED: Final = 64
"""Number of parts whose sampled points are scored during training."""

BATCH: Final = 16
RATE: Final = 2e-3


@dataclass(frozen=True)
class PartSampling:
    """Selection of the data for training and scoring a part network.

    points : points of each sample
    mask_mix : shares of whole, visible and empty masks
    jitter : maximum standard deviation of the joints, PART units; each sample draws its own up to this
    max_bodies : bodies of the training split that are used; None for all
    validation_bodies : held-out bodies for the final scores
    """

    points: int = 384
    mask_mix: tuple[float, float, float] = MASK_MIX
    jitter: float = 0.0
    max_bodies: int | None = None
    validation_bodies: int = 6


def train_parts(
    data: Path,
    kind: str,
    shape: DisnShape,
    out: Path,
    schedule: Schedule = Schedule(),  # noqa: B008 - frozen
    sampling: PartSampling = PartSampling(),
    *,
    epochs: int | None = None,
    ema: float = 0.999,
) -> dict[str, float]:
    """Train one network on the shards in `data`, resuming where an earlier call stopped; returns its scores.

    Writes log.csv, curve.png, checkpoint.pt and at last the weights, `PART_WEIGHTS.path(shape, out)`. The learning rate
    falls to a hundredth as a cosine.
    epochs : times that each part is seen in each view, in place of the steps of the schedule
    ema : decay of the averaged weights
    """
    if kind != shape.kind:
        raise ValueError(f"kind: {kind}, but the network is for {shape.kind}")
    batch, rate = schedule.batch_and_rate(BATCH, RATE)
    points = sampling.points
    train = load_parts(data, kind, "train", max_bodies=sampling.max_bodies)
    held_out = bool(list(data.glob("valid*.npz")))
    checked = load_parts(data, kind, "valid", max_bodies=CHECKED) if held_out else None
    net = seeded(schedule.seed, lambda: Disn(shape)).to(schedule.device)
    before: dict[str, Any] = {}
    if schedule.init is not None:
        earlier, before = PART_WEIGHTS.read(PART_WEIGHTS.path(shape, schedule.init))
        net.load_state_dict(earlier.state_dict())
    optimizer = torch.optim.Adam(net.parameters(), lr=rate, fused=True)

    def step(model: nn.Module, generator: torch.Generator, progress: float) -> Mapping[str, Tensor]:
        chance = np.random.default_rng(int(torch.randint(2**62, (), generator=generator)))
        mask, anchors, places, target = draw(
            train, chance, batch, points, sampling.mask_mix, sampling.jitter, schedule.device
        )
        predicted = model(mask, anchors, places)
        error = (predicted - target).abs()
        near = target.abs() < 2 / 63
        right = ((predicted < 0) == (target < 0)).float().mean()
        return {"loss": error.mean(), "l1_near": error[near].mean().nan_to_num(), "sign": right}

    def validate() -> dict[str, float]:
        return sampled_scores(net, checked, points) if checked is not None else {}

    if epochs is not None:
        schedule = replace(schedule, steps=-(-epochs * VIEWS * len(train) // batch))
    result = run_loop(
        TrainingTask(
            net,
            optimizer,
            step,
            validate,
            batch=batch,
            arguments={
                "kind": kind,
                "variant": shape.variant,
                "points": points,
                "parts": len(train),
                "data": recipe_digest(data),
                "jitter": sampling.jitter,
                "mask_mix": " ".join(map(str, sampling.mask_mix)),
                "init_samples": before.get("samples", 0),
            },
        ),
        out,
        schedule,
        Regime(ema=ema, clip=1.0, amp=True),
    )
    scores: dict[str, float] = {}
    if held_out:
        for which in ("visible", "amodal"):
            found = evaluate_parts(net, data, "valid", which, sampling.validation_bodies, one_view=True, dense=False)
            scores |= {f"{name}_{which}": value for name, value in found.items()}
    facts = {
        "data": {"parts": len(train), "name": data.name},
        "seed": schedule.seed,
        "steps": result.steps,
        "samples": before.get("samples", 0) + result.samples,
        "scores": scores,
    }
    PART_WEIGHTS.save(PART_WEIGHTS.path(shape, out), net, facts)
    return {**result.metrics, **scores}


def draw(
    parts: PartData,
    chance: np.random.Generator,
    batch: int,
    points: int,
    mask_mix: tuple[float, float, float],
    jitter: float,
    device: str = "cpu",
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Sample a batch: masks (B, 1, 64, 64), anchors (B, A, 3), points (B, N, 3) and their distances (B, N)."""
    items, views = chance.integers(len(parts), size=batch), chance.integers(VIEWS, size=batch)
    half = parts.points.shape[1] // 2
    inside = chance.integers(half, size=(batch, points // 2))
    outside = chance.integers(half, parts.points.shape[1], size=(batch, points - points // 2))
    chosen = np.concatenate([inside, outside], 1)
    places = turned(parts.points[items[:, None], chosen], views)
    anchors = turned(parts.anchors[items], views)
    which = chance.choice(3, size=batch, p=mask_mix)
    packed = parts.masks[items, views, np.minimum(which, 1)]
    masks = np.unpackbits(packed, axis=-1).astype(np.bool_)
    masks[which == 2] = False
    if parts.kind in ("torso", "head"):
        mirror = chance.random(batch) < 0.5
        masks[mirror] = masks[mirror][:, :, ::-1]
        places[mirror] *= MIRROR
        anchors[mirror] = swapped(anchors[mirror], parts.kind)
    deviation = chance.uniform(0, jitter, size=(batch, 1, 1))
    anchors = (anchors + deviation * chance.standard_normal(anchors.shape)).astype(np.float32)
    target = parts.distance[items[:, None], chosen].astype(np.float32)
    arrays = (torch.from_numpy(anchors), torch.from_numpy(places), torch.from_numpy(target))
    moved = [array.to(device) for array in (as_input(masks), *arrays)]
    return moved[0], moved[1], moved[2], moved[3]


def sampled_scores(net: Disn, parts: PartData, points: int) -> dict[str, float]:
    """Mean error and share of correct signs at stored points of some parts, visible masks, views by turns."""
    device = next(net.parameters()).device
    chosen = np.linspace(0, len(parts) - 1, min(CHECKED, len(parts))).astype(np.int64)
    views = np.arange(len(chosen)) % VIEWS
    some = np.linspace(0, parts.points.shape[1] - 1, points).astype(np.int64)
    places = turned(parts.points[chosen][:, some], views)
    target = torch.from_numpy(parts.distance[chosen][:, some].astype(np.float32)).to(device)
    mask = as_input(parts.mask(chosen, views, "visible")).to(device)
    anchors = torch.from_numpy(turned(parts.anchors[chosen], views)).to(device)
    with torch.inference_mode():
        found = torch.cat(
            [
                net(mask[i : i + 16], anchors[i : i + 16], torch.from_numpy(places[i : i + 16]).to(device)).float()
                for i in range(0, len(chosen), 16)
            ]
        )
    right = ((found < 0) == (target < 0)).float().mean()
    return {"l1": float((found - target).abs().mean()), "sign": float(right)}


def evaluate_parts(
    net: Disn,
    data: Path,
    split: str,
    mask: str = "visible",
    limit: int | None = None,
    *,
    one_view: bool = False,
    dense: bool = True,
) -> dict[str, float]:
    """Scores against the dense fields of held-out bodies, means over parts and views.

    mask : "visible" or "amodal"; limit : bodies
    one_view : each part in one view, by turns, instead of all four; dense : every node is evaluated
    Returns rmse over all nodes in PART units, iou of the negative nodes, and n, the number of parts times views.
    """
    parts = load_parts(data, net.shape.kind, split, max_bodies=limit, grid=True, points=False)
    assert parts.grid is not None
    net.eval()
    method = decode_dense if dense else decode
    errors, ious = [], []
    for item in range(len(parts)):
        for view in [item % VIEWS] if one_view else range(VIEWS):
            where = np.array([item]), np.array([view])
            anchors = turned(parts.anchors[where[0]], where[1])[0]
            found = method(net, parts.mask(*where, mask)[0], anchors, parts.grid.shape[1])
            truth = turned_grid(parts.grid[item], view).astype(np.float32)
            errors.append(float(np.sqrt(np.mean((found - truth) ** 2))))
            ious.append(intersection_over_union(found < 0, truth < 0))
    return {"rmse": float(np.mean(errors)), "iou": float(np.mean(ious)), "n": float(len(errors))}


def intersection_over_union(found: NDArray[np.bool_], truth: NDArray[np.bool_]) -> float:
    """Intersection over union of two masks; 1 where both are empty."""
    union = np.count_nonzero(found | truth)
    return np.count_nonzero(found & truth) / union if union else 1.0
