"""Train the network that predicts positions in the drawing from which unseen texels take their colours, and score it.

Scores are over texels that the front does not show, weighted by how well other sides show them: PSNR of colours, and
the same for colours taken straight through the body (`front_psnr`), the result of an untrained network.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from fig2mesh.nets.texture_fill import FILL_WEIGHTS, FillShape, TextureFill, sample
from fig2mesh.training.networks.loop import Regime, TrainingTask, run_loop, seeded
from fig2mesh.training.networks.run_log import write_scores
from fig2mesh.training.networks.schedule import Schedule
from fig2mesh.training.samples.build import recipe_digest
from fig2mesh.training.samples.part_data import HELD_OUT
from fig2mesh.training.samples.texels import Texels, gather
from fig2mesh.training.samples.texture_data import load_drawings
from fig2mesh.training.samples.unfold import Unfolded, unfold

BATCH: Final = 8
RATE: Final = 2e-3

SEEN_WEIGHT: Final = 0.2
"""Weight of texels visible from the front; the others have 1."""

COARSE: Final = 8
"""Downsampling factor of a second, coarse picture, whose gradient reaches colours further away."""

SMOOTH: Final = 0.02
OUTSIDE: Final = 0.1


def train_fill(
    data: Path,
    out: Path,
    schedule: Schedule,
) -> dict[str, float]:
    """Train a network; writes weights, log and scores to `out`, and returns the scores on the held-out splits.

    Computes in bfloat16, which is three times as fast on processors that support it.
    """
    batch, rate = schedule.batch_and_rate(BATCH, RATE)
    device = schedule.device
    known = unfold(load_drawings(data, ("train",), pictures=True))
    held = {split: unfold(load_drawings(data, (split,), pictures=True, limit=24)) for split in HELD_OUT}
    net = seeded(schedule.seed, lambda: TextureFill(FillShape(known.part.shape[-1]))).to(device)

    def step(model: torch.nn.Module, generator: torch.Generator, progress: float) -> Mapping[str, Tensor]:
        rows = torch.randint(len(known), (batch,), generator=generator).numpy()
        return losses(model, Texels(*(t.to(device) for t in gather(known, rows))))

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
            arguments={"size": net.shape.size, "filters": net.shape.filters, "data": recipe_digest(data)},
        ),
        out,
        schedule,
        Regime(warmup=100, clip=1.0, amp=True, validations=6),
    )
    found = {
        f"{split}_{name}": value
        for split, bodies in held.items()
        for name, value in scores(net, bodies, device).items()
    }
    write_scores(out, found)
    facts = {
        "data": recipe_digest(data),
        "bodies": len(known),
        "seed": schedule.seed,
        "steps": result.steps,
        "samples": result.samples,
        "scores": found,
    }
    FILL_WEIGHTS.save(FILL_WEIGHTS.path(net.shape, out), net, facts)
    return found


def losses(model: torch.nn.Module, texels: Texels) -> dict[str, Tensor]:
    """Loss: colour error at the predicted positions, roughness of the offsets, and positions outside the figure."""
    change = model(texels.inputs)
    place = texels.place + change
    weight = texels.weight * torch.where(texels.observed, SEEN_WEIGHT, 1.0)
    total = weight.sum().clamp_min(1e-6)
    blurred = functional.avg_pool2d(texels.front, COARSE)
    fine, coarse = ((sample(picture, place) - texels.truth).abs().mean(dim=1) for picture in (texels.front, blurred))
    colour = ((fine + coarse) * weight).sum() / total
    known = texels.weight > 0
    across = (change[..., 1:] - change[..., :-1]).abs().sum(dim=1) * (known[..., 1:] & known[..., :-1])
    down = (change[..., 1:, :] - change[..., :-1, :]).abs().sum(dim=1) * (known[:, 1:] & known[:, :-1])
    rough = (across.sum() + down.sum()) / known.sum().clamp_min(1)
    outside = ((1 - sample(texels.inside, place)[:, 0]) * weight).sum() / total
    return {"loss": colour + SMOOTH * rough + OUTSIDE * outside, "colour": colour.detach()}


@torch.no_grad()
def scores(net: TextureFill, bodies: Unfolded, device: str = "cpu") -> dict[str, float]:
    """PSNR of unseen texels, dB, of the network and of positions straight through the body."""
    sums = np.zeros(3)
    for first in range(0, len(bodies), BATCH):
        rows = np.arange(first, min(first + BATCH, len(bodies)))
        texels = Texels(*(t.to(device) for t in gather(bodies, rows)))
        weight = texels.weight * ~texels.observed
        for index, place in enumerate((texels.place + net(texels.inputs), texels.place)):
            error = (sample(texels.front, place) - texels.truth).square().mean(dim=1)
            sums[index] += float((error * weight).sum())
        sums[2] += float(weight.sum())
    ours, straight = (10 * np.log10(sums[2] / max(total, 1e-12)) for total in sums[:2])
    return {"psnr": float(ours), "front_psnr": float(straight)}
