"""Train the pose network on skeletons made on the fly, and score it as table 1 does.

Scores: RMSE is the square root of the mean, over joints and samples, of the squared 3D distance in mm; PCK150 is the
share of joints within 150 mm. Both count the pelvis, a joint of the paper's sixteen that is right by definition;
`rmse_without_pelvis_mm` does not. `mean_mm` is the mean distance. In orthographic views x and y are given, so the
distance is that of depths.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import torch
from torch import Tensor

from fig2mesh.nets.pose_lift import POSE_WEIGHTS, PoseLift, PoseLiftShape, bone_lengths, lift
from fig2mesh.skeleton import JOINT, JOINT_NAMES
from fig2mesh.training.bodies.skeletons import AROUND, DRAWN, SIDES, Sample, Sampler, Skeletons, ViewSampling
from fig2mesh.training.networks.loop import Regime, TrainingTask, run_loop, seeded
from fig2mesh.training.networks.run_log import write_scores
from fig2mesh.training.networks.schedule import Schedule

if TYPE_CHECKING:
    from fig2mesh.training.bodies.pack import Pack

BATCH: Final = 512
RATE: Final = 1e-3
COUNT: Final = 4096
"""Number of samples per score."""

NEAR: Final = 0.150
"""Threshold on the distance of a correct joint, m (PCK150)."""

VIEWS: Final = {"sides": SIDES, "around": AROUND, "drawn": DRAWN}
"""Protocols: the paper's four sides, all around, and as drawings are (`skeletons.DRAWN`)."""


def train_pose(
    train: Skeletons,
    valid: Skeletons,
    out: Path,
    schedule: Schedule,
    *,
    shape: PoseLiftShape = PoseLiftShape(),  # noqa: B008 - frozen
    augment: bool = True,
    dropout: float = 0.1,
) -> tuple[PoseLift, dict[str, float]]:
    """Train a network; writes weights, log and scores to `out`, returns it with its scores on held-out skeletons.

    dropout : of all hidden layers; Martinez et al. use 0.5
    augment : train on drawings' proportions, views and errors, and not on the plain protocol of the paper
    """
    batch, rate = schedule.batch_and_rate(BATCH, RATE)
    view = replace(DRAWN if augment else AROUND, perspective=shape.perspective)
    sampler = Sampler(train, schedule.device)
    net = seeded(schedule.seed, lambda: PoseLift(shape, dropout)).to(schedule.device)
    measured = sampler.draw(4096, AROUND, torch.Generator().manual_seed(schedule.seed)).joints
    net.bone_length.copy_(bone_lengths(measured))
    if shape.limbs:
        net.limb_length.copy_(bone_lengths(measured, shape.bones))
    chosen = list(shape.indices)

    def step(model: torch.nn.Module, generator: torch.Generator, progress: float) -> Mapping[str, Tensor]:
        sample = sampler.draw(batch, view, generator)
        target = sample.joints[:, chosen]
        found = model(sample.drawn[:, chosen], sample.visible[:, chosen])
        part = slice(0, 3) if shape.perspective else slice(2, 3)
        return {"loss": (found[..., part] - target[..., part]).square().sum(dim=2).mean()}

    held = Sampler(valid, schedule.device)
    quick = _held(held, view, shape, 1024)

    def validate() -> Mapping[str, float]:
        return {name: value for name, value in pose_scores(net, quick).items() if name in ("rmse_mm", "pck150")}

    optimizer = torch.optim.AdamW(net.parameters(), rate, weight_decay=1e-4)
    result = run_loop(
        TrainingTask(
            net,
            optimizer,
            step,
            validate,
            batch=batch,
            arguments={
                "joints": shape.joints,
                "perspective": shape.perspective,
                "visibility": shape.visibility,
                "metric": shape.metric,
                "width": shape.width,
                "augment": augment,
                "limbs": shape.limbs,
                "dropout": dropout,
                "data": hashlib.sha256(train.rotations.tobytes() + train.reach.tobytes()).hexdigest()[:16],
            },
        ),
        out,
        schedule,
        Regime(warmup=200, clip=1.0, amp=True, validations=10),
    )
    scores = {
        f"{name}_{score}": value
        for name, view in VIEWS.items()
        for score, value in pose_scores(net, _held(held, view, shape, COUNT)).items()
    }
    write_scores(out, scores)
    data = {"poses": len(train.rotations), "bodies": len(train.reach), "augment": augment}
    facts = {"data": data, "seed": schedule.seed, "steps": result.steps, "samples": result.samples, "scores": scores}
    POSE_WEIGHTS.save(POSE_WEIGHTS.path(shape, out), net, facts)
    return net, scores


def _held(sampler: Sampler, view: ViewSampling, shape: PoseLiftShape, count: int) -> Sample:
    """Draw samples that are the same for every network of a projection."""
    return sampler.draw(count, replace(view, perspective=shape.perspective), torch.Generator().manual_seed(1))


def joint_distances(net: PoseLift, sample: Sample) -> Tensor:
    """(N, J) distance of each joint from the truth, FIGURE units."""
    chosen = list(net.shape.indices)
    found = lift(net, sample.drawn[:, chosen], sample.visible[:, chosen])
    error = found - sample.joints[:, chosen]
    distance: Tensor = (error if net.shape.perspective else error[..., 2:]).norm(dim=2)
    return distance


def pose_scores(net: PoseLift, sample: Sample) -> dict[str, float]:
    """Scores as the module's docstring defines them, and the mean distance of each joint."""
    distance = joint_distances(net, sample)
    indices = net.shape.indices
    moving = [row for row, index in enumerate(indices) if index != JOINT["pelvis"]]
    mean = 1000 * distance.mean(dim=0)
    return {
        "rmse_mm": 1000 * float(distance.square().mean().sqrt()),
        "rmse_without_pelvis_mm": 1000 * float(distance[:, moving].square().mean().sqrt()),
        "pck150": 100 * float((distance <= NEAR).float().mean()),
        "mean_mm": float(mean.mean()),
        **{f"mean_{JOINT_NAMES[index]}_mm": float(mean[row]) for row, index in enumerate(indices)},
    }


def pack_skeletons(pack: Pack, *, bodies: int = 256, seed: int = 0) -> tuple[Skeletons, Skeletons]:
    """Training and held-out skeletons of a pack, with disjoint poses and characters; 70 % are realistic bodies."""
    from fig2mesh.training.bodies.anny_body import random_body
    from fig2mesh.training.bodies.pack import held_out

    rng = np.random.default_rng(seed)

    def of(poses_held_out: bool) -> Skeletons:
        people = [person.rig for person in pack.characters if held_out(person.rig.name) == poses_held_out]
        realistic = [random_body(pack.anny, rng)[0] for _ in range(bodies if not people else round(0.7 * bodies))]
        people = [people[i % len(people)] for i in range(bodies - len(realistic))]
        return Skeletons.from_rigs(
            [*realistic, *people], pack.held_out_poses if poses_held_out else pack.training_poses
        )

    return of(False), of(True)
