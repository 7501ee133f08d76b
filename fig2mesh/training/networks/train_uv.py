"""Train the network that predicts texture coordinates, and score it as table 4 does.

Scores are errors of u and v over the pixels of bodies that have texture coordinates: MAE and RMSE of both coordinates
together, in texture units (0 to 1).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from fig2mesh.nets.uv_unet import UV_WEIGHTS, UvUnet, UvUnetShape, uv_inputs
from fig2mesh.skeleton import PART
from fig2mesh.training.networks.loop import Regime, TrainingTask, run_loop, seeded
from fig2mesh.training.networks.run_log import write_scores
from fig2mesh.training.networks.schedule import Schedule
from fig2mesh.training.samples.build import recipe_digest
from fig2mesh.training.samples.part_data import HELD_OUT
from fig2mesh.training.samples.texture_data import Drawings, load_drawings

BATCH: Final = 8
RATE: Final = 2e-3
MASK_WEIGHT: Final = 0.05

HEAD_WEIGHT: Final = 2.0
"""Weight of pixels of heads, where errors put faces on the back; others have 1."""

COARSE: Final = 0.03
"""Standard deviation of smooth errors that are added to depths in training, FIGURE units: inferred
bodies are smoother than dressed ones and never quite as deep."""

Batch = tuple[Tensor, Tensor, Tensor, Tensor]
"""depth (N, H, W), labels (N, H, W), uv (N, 2, H, W), known (N, H, W)."""


def train_uv(
    data: Path,
    out: Path,
    schedule: Schedule,
    shape: UvUnetShape = UvUnetShape(),  # noqa: B008 - frozen
) -> dict[str, float]:
    """Train a network; writes weights, log and scores to `out`, and returns the scores on the held-out splits.

    Computes in bfloat16, which is three times as fast on processors that support it.
    """
    batch, rate = schedule.batch_and_rate(BATCH, RATE)
    device = schedule.device
    known = load_drawings(data, ("train",), pictures=False)
    held = {split: load_drawings(data, (split,), pictures=False, limit=24) for split in HELD_OUT}
    net = seeded(schedule.seed, lambda: UvUnet(shape)).to(device)
    before: dict[str, Any] = {}
    if schedule.init is not None:
        other, before = UV_WEIGHTS.read(UV_WEIGHTS.path(shape, schedule.init))
        net.load_state_dict(other.state_dict())

    def step(model: torch.nn.Module, generator: torch.Generator, progress: float) -> Mapping[str, Tensor]:
        rows = torch.randint(len(known), (batch,), generator=generator).numpy()
        views = torch.randint(4, (batch,), generator=generator).numpy()
        depth, labels, uv, there = _augmented(gather(known, rows, views), generator)
        inputs = uv_inputs(depth, labels, shape.masks)
        found = model(inputs.to(device))
        return losses(found, labels.to(device), uv.to(device), there.to(device))

    def validate() -> Mapping[str, float]:
        return scores(net, held["valid-clips"], device)

    optimizer = torch.optim.AdamW(net.parameters(), rate, weight_decay=1e-4)
    result = run_loop(
        TrainingTask(
            net,
            optimizer,
            step,
            validate,
            batch=batch,
            arguments={
                "masks": shape.masks,
                "filters": shape.filters,
                "data": recipe_digest(data),
                "init_samples": before.get("samples", 0),
            },
        ),
        out,
        schedule,
        Regime(warmup=100, clip=1.0, amp=True, validations=6),
    )
    found = {
        f"{split}_{name}": value
        for split, drawings in held.items()
        for name, value in scores(net, drawings, device).items()
    }
    write_scores(out, found)
    facts = {
        "data": recipe_digest(data),
        "bodies": len(known),
        "seed": schedule.seed,
        "steps": result.steps,
        "samples": before.get("samples", 0) + result.samples,
        "scores": found,
    }
    UV_WEIGHTS.save(UV_WEIGHTS.path(shape, out), net, facts)
    return found


def gather(drawings: Drawings, rows: np.ndarray, views: np.ndarray) -> Batch:
    """Gather bodies `rows` from sides `views` as a batch."""
    return (
        torch.from_numpy(drawings.depth[rows, views].astype(np.float32)),
        torch.from_numpy(drawings.labels[rows, views]),
        torch.from_numpy(drawings.uv[rows, views].astype(np.float32)).movedim(3, 1),
        torch.from_numpy(drawings.known(rows, views)),
    )


def losses(found: Tensor, labels: Tensor, uv: Tensor, known: Tensor) -> dict[str, Tensor]:
    """Mean absolute error where texture coordinates are known, heads weighted, and cross entropy of the mask."""
    error = (found[:, :2] - uv).abs().mean(dim=1) * known
    weighted = error * torch.where(labels == PART["head"], HEAD_WEIGHT, 1.0)
    mask = functional.binary_cross_entropy_with_logits(found[:, 2], (labels > 0).float())
    count = known.sum().clamp_min(1)
    return {"loss": weighted.sum() / count + MASK_WEIGHT * mask, "mae": (error.sum() / count).detach()}


def scores(net: UvUnet, drawings: Drawings, device: str = "cpu") -> dict[str, float]:
    """MAE and RMSE of texture coordinates over all pixels of all four sides."""
    absolute = square = 0.0
    count = 0
    for row in range(len(drawings)):
        depth, labels, uv, known = (t.to(device) for t in gather(drawings, np.full(4, row), np.arange(4)))
        with torch.no_grad():
            found = net(uv_inputs(depth, labels, net.shape.masks))[:, :2].clamp(0, 1)
        error = (found - uv).movedim(1, 3)[known]
        absolute += float(error.abs().sum())
        square += float(error.square().sum())
        count += error.numel()
    return {"mae": absolute / max(count, 1), "rmse": float(np.sqrt(square / max(count, 1)))}


def _augmented(batch: Batch, generator: torch.Generator) -> Batch:
    """Augment a batch: another size and position, smooth errors of the depth, some depths blurred as in the paper."""
    depth, labels, uv, known = batch
    count, size = len(depth), depth.shape[-1]
    scale = 1.0 + 0.25 * torch.rand(count, generator=generator)
    shift = (torch.rand(count, 2, generator=generator) - 0.5) * 0.1
    theta = torch.zeros(count, 2, 3)
    theta[:, 0, 0] = theta[:, 1, 1] = scale
    theta[:, :, 2] = shift
    grid = functional.affine_grid(theta, [count, 1, size, size], align_corners=False)
    extra = torch.where(labels == PART["garment"], 0.0, 1.0) * known
    stack = torch.cat([depth.nan_to_num(neginf=0.0)[:, None], labels[:, None].float(), extra[:, None], uv], dim=1)
    moved = functional.grid_sample(stack, grid, mode="nearest", align_corners=False)
    depth, labels = moved[:, 0], moved[:, 1].round().to(torch.uint8)
    waves = torch.randn(count, 1, 6, 6, generator=generator)
    depth = depth + COARSE * functional.interpolate(waves, (size, size), mode="bicubic", align_corners=False)[:, 0]
    smooth = torch.rand(count, generator=generator) < 0.5
    blurred = _averaged(depth, labels > 0)
    return torch.where(smooth[:, None, None], blurred, depth), labels, moved[:, 3:], moved[:, 2] > 0.5


def _averaged(depth: Tensor, seen: Tensor) -> Tensor:
    """(N, H, W) depths averaged over the visible of 5 x 5 pixels (paper appendix B)."""
    weight = seen.float()
    pair = torch.stack([depth * weight, weight], dim=1)
    total = functional.avg_pool2d(pair, 5, 1, 2)
    return total[:, 0] / total[:, 1].clamp_min(1e-6)
