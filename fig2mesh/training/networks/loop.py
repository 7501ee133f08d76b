"""Training loop of all networks: seeded, resumable, limited by a budget.

The caller gives a function that turns the model and a generator into losses; the loop does the rest: mixed precision,
gradients, learning rate, averaged weights, validation, `log.csv`, `curve.png` and a checkpoint every minute.

Everything random follows from one `torch.Generator` (CPU) whose state is in the checkpoint; the global generators,
which dropout uses, are reseeded from it before every step. So a step may draw from the generator given or, on its own
device, from the global one, and must keep no state between steps. With `steps` given, two runs on as many CPU
threads give the same weights, and an interrupted run that is resumed gives those of an undisturbed one.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import get_ema_multi_avg_fn

from exporters.atomic_file import sweep_temporary
from fig2mesh.training.networks.checkpoint import Argument, State, resume, save_checkpoint
from fig2mesh.training.networks.run_log import CURVE, LOG, draw_curve, write_log
from fig2mesh.training.networks.schedule import Schedule

ROWS_A_VALIDATION = 10
"""Rows of the log per validation."""

DRAW_S = 60.0
"""Interval between drawings of the curve, seconds; each takes half a second."""

LAST_RATE = 0.01
"""Share of the learning rate at the end of the cosine."""

Step = Callable[[nn.Module, torch.Generator, float], Mapping[str, Tensor]]
"""(model, generator, progress in [0, 1]) → scalar tensors; "loss" is minimised, the others are logged."""

Validate = Callable[[], Mapping[str, float]]
"""() → scores of the model, which is in evaluation mode and has the averaged weights meanwhile."""

M = TypeVar("M")


@dataclass(frozen=True)
class Result:
    """Outcome of a run; the model itself then has the averaged weights and is in evaluation mode.

    steps, samples : totals over all resumptions
    seconds : total time
    metrics : the last row of the log, "valid_" before the names of the last validation
    """

    steps: int
    samples: int
    seconds: float
    metrics: dict[str, float]


def seeded(seed: int, make: Callable[[], M]) -> M:
    """Call `make` with the global generators seeded, and restore them: for building a model."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return make()


@dataclass(frozen=True)
class TrainingTask:
    """A network, its optimiser, loss and validation.

    model, optimizer : on the device of the schedule
    step : loss of one batch
    validate : scores for the log; None for none
    batch : samples per step, for the log
    arguments : everything else that affects the result; a checkpoint with others is refused
    """

    model: nn.Module
    optimizer: torch.optim.Optimizer
    step: Step
    validate: Validate | None = None
    batch: int = 1
    arguments: Mapping[str, Argument] = field(default_factory=dict)


@dataclass(frozen=True)
class Regime:
    """Hyperparameters common to all runs of a network.

    warmup : steps over which the learning rate rises; then it falls as a cosine of the progress
    ema : decay of the exponential moving average of the weights, less at first; 0 for none
    clip : maximum norm of the gradients; None for no limit
    amp : compute in bfloat16 where that is safe; None to do so on CUDA alone
    validations : number over the whole run; the last is at its end
    checkpoint_s : seconds between checkpoints
    """

    warmup: int = 100
    ema: float = 0.999
    clip: float | None = None
    amp: bool | None = None
    validations: int = 20
    checkpoint_s: float = 60.0


def run_loop(
    task: TrainingTask,
    folder: Path,
    schedule: Schedule,
    regime: Regime = Regime(),
    *,
    clock: Callable[[], float] = time.perf_counter,
) -> Result:
    """Train a network until its time or steps are used up, resuming from the checkpoint in `folder` if there is one."""
    if schedule.budget_min is None and schedule.steps is None:
        raise ValueError("neither budget_min nor steps given")
    model, optimizer = task.model, task.optimizer
    device = torch.device(schedule.device)
    mixed = device.type == "cuda" if regime.amp is None else regime.amp
    rates = [float(group.setdefault("initial_lr", group["lr"])) for group in optimizer.param_groups]
    identity: dict[str, Argument] = {
        "seed": schedule.seed,
        "steps": schedule.steps,
        "budget_min": schedule.budget_min,
        "batch": task.batch,
        "warmup": regime.warmup,
        "ema": regime.ema,
        "clip": regime.clip,
        "amp": mixed,
        "learning_rate": rates[0],
        **task.arguments,
    }
    folder.mkdir(parents=True, exist_ok=True)
    sweep_temporary(folder)
    state = State(torch.Generator().manual_seed(schedule.seed), _copy(model))
    resume(folder, identity, model, optimizer, state)

    before, start = state.seconds, clock()
    saved = drawn = before
    devices = [device.index or 0] if device.type == "cuda" else []
    with torch.random.fork_rng(devices=devices):
        while state.progress < 1:
            torch.manual_seed(int(torch.randint(2**62, (), generator=state.generator)))
            rate = _rate(state.step, state.progress, regime.warmup)
            for group, initial in zip(optimizer.param_groups, rates, strict=True):
                group["lr"] = initial * rate
            model.train()
            with torch.autocast(device.type, torch.bfloat16, enabled=mixed):
                losses = task.step(model, state.generator, state.progress)
            optimizer.zero_grad(set_to_none=True)
            losses["loss"].backward()  # type: ignore[no-untyped-call]
            if regime.clip is not None:
                nn.utils.clip_grad_norm_(model.parameters(), regime.clip)
            optimizer.step()
            decay = min(regime.ema, (1 + state.step) / (10 + state.step)) if regime.ema else 0.0
            _average(state.averaged, model, decay)
            state.step += 1
            state.summed += 1
            for name, value in losses.items():
                value = value.detach().float()
                state.sums[name] = state.sums[name] + value if name in state.sums else value

            last = state.progress
            state.seconds = before + clock() - start
            state.progress = _progress(state, schedule.budget_min, schedule.steps)
            ticks = regime.validations * ROWS_A_VALIDATION
            if int(state.progress * ticks) > int(last * ticks):
                wanted = int(state.progress * regime.validations) > int(last * regime.validations)
                scores = _scores(model, state, task.validate) if wanted else {}
                _log_row(state, task.batch, rates[0] * rate, scores)
                write_log(folder / LOG, state.rows)
                if state.progress >= 1 or state.seconds - drawn >= DRAW_S:
                    draw_curve(folder / CURVE, state.rows)
                    drawn = state.seconds
                state.seconds = before + clock() - start
            if state.seconds - saved >= regime.checkpoint_s or state.progress >= 1:
                save_checkpoint(folder, identity, model, optimizer, state)
                saved = state.seconds
    model.load_state_dict(state.averaged)
    model.eval()
    return Result(state.step, state.step * task.batch, state.seconds, dict(state.rows[-1]) if state.rows else {})


def _progress(state: State, budget_min: float | None, steps: int | None) -> float:
    shares = [0.0]
    if budget_min is not None:
        shares.append(state.seconds / max(60 * budget_min, 1e-9))
    if steps is not None:
        shares.append(state.step / max(steps, 1))
    return min(1.0, max(shares))


def _rate(step: int, progress: float, warmup: int) -> float:
    """Share of the learning rate: linear warm-up times a cosine."""
    rise = min(1.0, (step + 1) / warmup) if warmup else 1.0
    return rise * (LAST_RATE + (1 - LAST_RATE) * 0.5 * (1 + math.cos(math.pi * progress)))


def _copy(model: nn.Module) -> dict[str, Tensor]:
    return {name: value.detach().clone() for name, value in model.state_dict().items()}


@torch.no_grad()
def _average(averaged: dict[str, Tensor], model: nn.Module, decay: float) -> None:
    old: list[Tensor] = []
    new: list[Tensor] = []
    for name, value in model.state_dict().items():
        if value.is_floating_point():
            old.append(averaged[name])
            new.append(value)
        else:
            averaged[name].copy_(value)
    get_ema_multi_avg_fn(decay)(old, new, 0)  # type: ignore[no-untyped-call]


@contextmanager
def averaged_weights(model: nn.Module, averaged: Mapping[str, Tensor]) -> Iterator[None]:
    """The model with other weights, in evaluation mode and without gradients."""
    own = _copy(model)
    model.load_state_dict(averaged)
    model.eval()
    try:
        with torch.no_grad():
            yield
    finally:
        model.load_state_dict(own)


def _scores(model: nn.Module, state: State, validate: Validate | None) -> dict[str, float]:
    if validate is None:
        return {}
    with averaged_weights(model, state.averaged):
        return {f"valid_{name}": float(value) for name, value in validate().items()}


def _log_row(state: State, batch: int, rate: float, scores: Mapping[str, float]) -> None:
    means = {name: float(value) / state.summed for name, value in state.sums.items()}
    head = {"step": float(state.step), "seconds": state.seconds, "samples": float(state.step * batch), "rate": rate}
    state.rows.append({**head, **means, **scores})
    state.sums, state.summed = {}, 0
