"""Train the networks that add details to painted sides: the whole side, and its head by the HSV autoencoder.

Scores are over unseen sides: mean absolute error of colours 0-1, and the same for the painted sides before refinement.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from fig2mesh.nets.head_hsv import HEAD_WEIGHTS, HeadHsv, HeadShape, disc_value, head_inputs, head_window, rgb_of
from fig2mesh.nets.texture_fill import FILL_WEIGHTS, FillShape
from fig2mesh.nets.view_refine import REFINE_WEIGHTS, RefineShape, ViewRefine, refine, refine_inputs
from fig2mesh.skeleton import PART
from fig2mesh.training.networks.loop import Regime, Result, TrainingTask, run_loop, seeded
from fig2mesh.training.networks.run_log import write_scores
from fig2mesh.training.networks.schedule import Schedule
from fig2mesh.training.samples.build import recipe_digest
from fig2mesh.training.samples.painted import PaintedSides, Painter, painters
from fig2mesh.training.samples.part_data import HELD_OUT

BATCH: Final = 8
HEADS: Final = 32
RATE: Final = 1e-3
EDGE_WEIGHT: Final = 0.5

Scores = dict[str, float]


def train_refine(
    data: Path,
    fill: Path,
    out: Path,
    schedule: Schedule,
    *,
    filters: int = RefineShape.filters,
) -> Scores:
    """Train the refiner of sides; writes weights, log and scores to `out`, and returns the held-out scores.

    fill : folder with the weights of the network that paints the sides
    """
    batch, _ = schedule.batch_and_rate(BATCH, RATE)
    known, held = _painters(data, fill)
    net = seeded(schedule.seed, lambda: ViewRefine(RefineShape(filters)))

    def step(model: nn.Module, generator: torch.Generator, progress: float) -> Mapping[str, Tensor]:
        sides = _draw(known, batch, generator)
        inputs = refine_inputs(sides.painted, sides.uv, sides.depth, sides.labels)
        found = sides.painted + model(inputs)
        return {"loss": picture_loss(found, sides.truth, sides.known)}

    result = _run(net, step, lambda: refine_scores(net, held["valid-clips"]), data, out, schedule, batch)
    found = {
        f"{split}_{name}": value
        for split, painter in held.items()
        for name, value in refine_scores(net, painter).items()
    }
    facts = _facts(data, len(known), schedule.seed, result, found, out)
    REFINE_WEIGHTS.save(REFINE_WEIGHTS.path(net.shape, out), net, facts)
    return found


def train_head(
    data: Path,
    fill: Path,
    out: Path,
    schedule: Schedule,
    *,
    shape: HeadShape = HeadShape(),  # noqa: B008 - frozen
) -> Scores:
    """Train the autoencoder of heads; writes weights, log and scores to `out`, and returns the held-out scores."""
    batch, _ = schedule.batch_and_rate(HEADS, RATE)
    known, held = _painters(data, fill)
    net = seeded(schedule.seed, lambda: HeadHsv(shape))

    def step(model: nn.Module, generator: torch.Generator, progress: float) -> Mapping[str, Tensor]:
        crops = _heads(_draw(known, batch, generator))
        angle = 2 * math.pi * float(torch.rand((), generator=generator))
        painted, truth = (_turned(disc_value(c), angle) for c in (crops[:, :3], crops[:, 3:6]))
        noise = 0.03 * torch.randn(painted.shape, generator=generator) * torch.rand(len(painted), 1, 1, 1)
        there = crops[:, 8] > 0.5
        inputs = head_inputs(crops[:, :3], crops[:, 6:8], there)
        inputs = torch.cat([(painted + noise) * there[:, None], inputs[:, 3:]], dim=1)
        return head_losses(model(inputs), truth, there)

    result = _run(net, step, lambda: head_scores(net, held["valid-clips"]), data, out, schedule, batch)
    found = {
        f"{split}_{name}": value for split, painter in held.items() for name, value in head_scores(net, painter).items()
    }
    facts = _facts(data, len(known), schedule.seed, result, found, out)
    HEAD_WEIGHTS.save(HEAD_WEIGHTS.path(net.shape, out), net, facts)
    return found


def picture_loss(found: Tensor, truth: Tensor, known: Tensor) -> Tensor:
    """Mean absolute error of colours and of their steps from pixel to pixel, where they are known."""
    mask = known[:, None].float()
    error = ((found - truth).abs() * mask).sum() / (3 * mask.sum().clamp_min(1))
    edges = torch.zeros((), device=found.device)
    for axis in (2, 3):
        both = torch.diff(mask, dim=axis).abs() < 0.5
        both = both & (mask.narrow(axis, 1, mask.shape[axis] - 1) > 0)
        step = (torch.diff(found, dim=axis) - torch.diff(truth, dim=axis)).abs()
        edges = edges + (step * both).sum() / (3 * both.sum().clamp_min(1))
    return error + EDGE_WEIGHT * edges


def head_losses(found: Tensor, truth: Tensor, there: Tensor) -> dict[str, Tensor]:
    """Loss with equal weights of colour disc and value (paper §4.4)."""
    count = there.sum().clamp_min(1)
    colour = ((found[:, :2] - truth[:, :2]).abs().sum(dim=1) * there).sum() / (2 * count)
    value = ((found[:, 2] - truth[:, 2]).abs() * there).sum() / count
    return {"loss": colour + value, "colour": colour.detach(), "value": value.detach()}


def refine_scores(net: ViewRefine, painter: Painter) -> Scores:
    """Mean absolute errors over the three unseen sides."""
    sums = np.zeros(3)
    for row in range(len(painter)):
        sides = painter.sides(np.full(3, row), np.arange(1, 4))
        made = refine(net, sides.painted, sides.uv, sides.depth, sides.labels)
        mask = sides.known[:, None]
        sums += [float(((c - sides.truth).abs() * mask).sum()) for c in (made, sides.painted)] + [3 * int(mask.sum())]
    return {"mae": float(sums[0] / max(sums[2], 1)), "painted_mae": float(sums[1] / max(sums[2], 1))}


@torch.no_grad()
def head_scores(net: HeadHsv, painter: Painter) -> Scores:
    """Mean absolute errors over the heads of the three unseen sides."""
    sums = np.zeros(3)
    for row in range(len(painter)):
        crops = _heads(painter.sides(np.full(3, row), np.arange(1, 4)))
        there = crops[:, 8] > 0.5
        made = rgb_of(net(head_inputs(crops[:, :3], crops[:, 6:8], there)))
        truth = crops[:, 3:6]
        errors = [float(((c - truth).abs() * there[:, None]).sum()) for c in (made, crops[:, :3])]
        sums += [*errors, 3 * int(there.sum())]
    return {"mae": float(sums[0] / max(sums[2], 1)), "painted_mae": float(sums[1] / max(sums[2], 1))}


def _painters(data: Path, fill: Path) -> tuple[Painter, dict[str, Painter]]:
    net, _ = FILL_WEIGHTS.read(FILL_WEIGHTS.path(FillShape(), fill))
    known = painters(data, net, ("train",))
    return known, {split: painters(data, net, (split,), 16) for split in HELD_OUT}


def _draw(painter: Painter, count: int, generator: torch.Generator) -> PaintedSides:
    rows = torch.randint(len(painter), (count,), generator=generator).numpy()
    return painter.sides(rows, 1 + torch.randint(3, (count,), generator=generator).numpy())


def _heads(sides: PaintedSides) -> Tensor:
    """(N, 9, 64, 64) painted, truth, texture coordinates and mask of the heads; nothing where there is none."""
    stack = torch.cat([sides.painted, sides.truth, sides.uv], dim=1)
    crops = []
    for row, picture in enumerate(stack):
        head = sides.labels[row] == PART["head"]
        grid = head_window(head)
        if grid is None:
            grid = torch.full((1, 64, 64, 2), 2.0)
        whole = torch.cat([picture, head[None].float()])[None]
        crops.append(functional.grid_sample(whole, grid, mode="bilinear", padding_mode="zeros", align_corners=False))
    return torch.cat(crops)


def _turned(disc: Tensor, angle: float) -> Tensor:
    """Rotate the hue of colours, as in paper §4.4."""
    x, y, value = disc.unbind(dim=1)
    cos, sin = math.cos(angle), math.sin(angle)
    return torch.stack([cos * x - sin * y, sin * x + cos * y, value], dim=1)


def _run(
    net: nn.Module,
    step: Callable[[nn.Module, torch.Generator, float], Mapping[str, Tensor]],
    validate: Callable[[], Scores],
    data: Path,
    out: Path,
    schedule: Schedule,
    batch: int,
) -> Result:
    _, rate = schedule.batch_and_rate(batch, RATE)
    optimizer = torch.optim.AdamW(net.parameters(), rate, weight_decay=1e-4)
    return run_loop(
        TrainingTask(
            net,
            optimizer,
            step,
            validate,
            batch=batch,
            arguments={"data": recipe_digest(data)},
        ),
        out,
        schedule,
        Regime(warmup=100, clip=1.0, amp=True, validations=5),
    )


def _facts(data: Path, bodies: int, seed: int, result: Result, found: Scores, out: Path) -> dict[str, object]:
    write_scores(out, found)
    return {
        "data": recipe_digest(data),
        "bodies": bodies,
        "seed": seed,
        "steps": result.steps,
        "samples": result.samples,
        "scores": found,
    }
