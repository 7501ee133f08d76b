"""One loop that trains every network: seeded, resumable, and done when its budget is.

The caller gives a function that turns the model and a generator into losses; the loop does the rest: mixed precision,
gradients, learning rate, averaged weights, validation, `log.csv`, `curve.png` and a checkpoint a minute.

Everything random follows from one `torch.Generator` (CPU) whose state is in the checkpoint; the global generators,
which dropout uses, are reseeded from it before every step. So a step may draw from the generator given or, on its own
device, from the global one, and must keep no state between steps. With `steps` given, two runs on as many CPU
threads give the same weights, and an interrupted run that is resumed gives those of an undisturbed one.
"""

from __future__ import annotations

import csv
import json
import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import get_ema_multi_avg_fn

from exporters.atomic_file import atomic_path, atomic_text, sweep_temporary, write_text
from fig2mesh.errors import InputError

CHECKPOINT = "checkpoint.pt"
LOG = "log.csv"
CURVE = "curve.png"
SCORES = "scores.json"

ROWS_A_VALIDATION = 10
"""Rows of the log from one validation to the next."""

DRAW_S = 60.0
"""Seconds from one drawing of the curve to the next; it costs half a second."""

LAST_RATE = 0.01
"""Share of the learning rate that the cosine ends at."""

Argument = str | int | float | bool | None
Step = Callable[[nn.Module, torch.Generator, float], Mapping[str, Tensor]]
"""(model, generator, progress in [0, 1]) → scalar tensors; "loss" is what is minimised, the others are logged."""

Validate = Callable[[], Mapping[str, float]]
"""() → scores of the model, which is in evaluation mode and has the averaged weights meanwhile."""

M = TypeVar("M")


@dataclass(frozen=True)
class Result:
    """How a run ended; the model itself then has the averaged weights and is in evaluation mode.

    steps, samples : done in all, over every resumption
    seconds : spent in all
    metrics : the last row of the log, "valid_" before the names of the last validation
    """

    steps: int
    samples: int
    seconds: float
    metrics: dict[str, float]


@dataclass
class _State:
    """What changes from step to step, besides the model and the optimizer."""

    generator: torch.Generator
    averaged: dict[str, Tensor]
    step: int = 0
    seconds: float = 0.0
    progress: float = 0.0
    rows: list[dict[str, float]] = field(default_factory=list)
    sums: dict[str, Tensor] = field(default_factory=dict)
    summed: int = 0


def seeded(seed: int, make: Callable[[], M]) -> M:
    """`make()` with the global generators seeded, and left as they were: for building a model."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return make()


def run_loop(
    *,
    model: nn.Module,
    optimizer: torch.optim.Optimizer,
    step: Step,
    folder: Path,
    validate: Validate | None = None,
    budget_min: float | None = None,
    steps: int | None = None,
    seed: int = 0,
    batch: int = 1,
    warmup: int = 100,
    ema: float = 0.999,
    clip: float | None = None,
    device: torch.device | str = "cpu",
    amp: bool | None = None,
    validations: int = 20,
    arguments: Mapping[str, Argument] | None = None,
    checkpoint_s: float = 60.0,
    clock: Callable[[], float] = time.perf_counter,
) -> Result:
    """Train `model` until its time or its steps are used up, going on from the checkpoint in `folder` if there is one.

    budget_min : minutes, those before an interruption included; steps : their number; whichever ends first
    batch : samples a step, for the log
    warmup : steps over which the learning rate rises; then it falls as a cosine of the progress
    ema : decay of the averaged weights, less at first; 0 for none
    clip : largest norm of the gradients
    device : where the model is; amp : compute in bfloat16 where that is safe (the default on CUDA)
    validations : how often, over the whole run; the last comes at its end
    arguments : whatever else decides the result; a checkpoint with others is refused
    """
    if budget_min is None and steps is None:
        raise ValueError("neither budget_min nor steps given")
    device = torch.device(device)
    mixed = device.type == "cuda" if amp is None else amp
    rates = [float(group.setdefault("initial_lr", group["lr"])) for group in optimizer.param_groups]
    identity: dict[str, Argument] = {
        "seed": seed,
        "steps": steps,
        "budget_min": budget_min,
        "batch": batch,
        "warmup": warmup,
        "ema": ema,
        "clip": clip,
        "amp": mixed,
        "learning_rate": rates[0],
        **(arguments or {}),
    }
    folder.mkdir(parents=True, exist_ok=True)
    sweep_temporary(folder)
    state = _State(torch.Generator().manual_seed(seed), _copy(model))
    _resume(folder, identity, model, optimizer, state)

    before, start = state.seconds, clock()
    saved = drawn = before
    devices = [device.index or 0] if device.type == "cuda" else []
    with torch.random.fork_rng(devices=devices):
        while state.progress < 1:
            torch.manual_seed(int(torch.randint(2**62, (), generator=state.generator)))
            rate = _rate(state.step, state.progress, warmup)
            for group, initial in zip(optimizer.param_groups, rates, strict=True):
                group["lr"] = initial * rate
            model.train()
            with torch.autocast(device.type, torch.bfloat16, enabled=mixed):
                losses = step(model, state.generator, state.progress)
            optimizer.zero_grad(set_to_none=True)
            losses["loss"].backward()  # type: ignore[no-untyped-call]
            if clip is not None:
                nn.utils.clip_grad_norm_(model.parameters(), clip)
            optimizer.step()
            _average(state.averaged, model, min(ema, (1 + state.step) / (10 + state.step)) if ema else 0.0)
            state.step += 1
            state.summed += 1
            for name, value in losses.items():
                value = value.detach().float()
                state.sums[name] = state.sums[name] + value if name in state.sums else value

            last = state.progress
            state.seconds = before + clock() - start
            state.progress = _progress(state, budget_min, steps)
            ticks = validations * ROWS_A_VALIDATION
            if int(state.progress * ticks) > int(last * ticks):
                wanted = int(state.progress * validations) > int(last * validations)
                _log_row(state, batch, rates[0] * rate, _scores(model, state, validate) if wanted else {})
                write_log(folder / LOG, state.rows)
                if state.progress >= 1 or state.seconds - drawn >= DRAW_S:
                    draw_curve(folder / CURVE, state.rows)
                    drawn = state.seconds
                state.seconds = before + clock() - start
            if state.seconds - saved >= checkpoint_s or state.progress >= 1:
                _save(folder, identity, model, optimizer, state)
                saved = state.seconds
    model.load_state_dict(state.averaged)
    model.eval()
    return Result(state.step, state.step * batch, state.seconds, dict(state.rows[-1]) if state.rows else {})


def _progress(state: _State, budget_min: float | None, steps: int | None) -> float:
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


def _scores(model: nn.Module, state: _State, validate: Validate | None) -> dict[str, float]:
    if validate is None:
        return {}
    with averaged_weights(model, state.averaged):
        return {f"valid_{name}": float(value) for name, value in validate().items()}


def _log_row(state: _State, batch: int, rate: float, scores: Mapping[str, float]) -> None:
    means = {name: float(value) / state.summed for name, value in state.sums.items()}
    head = {"step": float(state.step), "seconds": state.seconds, "samples": float(state.step * batch), "rate": rate}
    state.rows.append({**head, **means, **scores})
    state.sums, state.summed = {}, 0


def write_log(path: Path, rows: list[dict[str, float]]) -> None:
    """Write the rows as CSV, one column a name; replaced as a whole, so that no row of a lost step remains."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with atomic_text(path) as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([f"{row[name]:.6g}" if name in row else "" for name in columns] for row in rows)


def write_scores(folder: Path, scores: Mapping[str, float]) -> None:
    """Write the scores of a finished run, whole or not at all."""
    write_text(folder / SCORES, json.dumps(dict(scores), indent=1) + "\n")


def draw_curve(path: Path, rows: list[dict[str, float]]) -> None:
    """Losses and scores over the steps; nothing is drawn where matplotlib is not installed."""
    try:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib.figure import Figure
    except ImportError:
        return
    every = dict.fromkeys(name for row in rows for name in row)
    names = [name for name in every if name not in ("step", "seconds", "samples", "rate")]
    pairs = {
        name.removeprefix("valid_"): [n for n in names if n.removeprefix("valid_") == name.removeprefix("valid_")]
        for name in names
    }
    figure = Figure(figsize=(5, 2.2 * len(pairs)), layout="constrained")
    for index, (title, shown) in enumerate(pairs.items()):
        axes = figure.add_subplot(len(pairs), 1, index + 1)
        for name in shown:
            points = [(row["step"], row[name]) for row in rows if name in row]
            axes.plot(*zip(*points, strict=True), label=name, marker="." if name.startswith("valid_") else "")
        if all(row[name] > 0 for name in shown for row in rows if name in row):
            axes.set_yscale("log")
        axes.set_title(title, fontsize="small")
        axes.legend(fontsize="x-small")
    with atomic_path(path) as partial:
        figure.savefig(partial, dpi=80)


def _save(
    folder: Path,
    identity: dict[str, Argument],
    model: nn.Module,
    optimizer: torch.optim.Optimizer,
    state: _State,
) -> None:
    content: dict[str, Any] = {
        "arguments": identity,
        "model": model.state_dict(),
        "averaged": state.averaged,
        "optimizer": optimizer.state_dict(),
        "generator": state.generator.get_state(),
        "step": state.step,
        "seconds": state.seconds,
        "progress": state.progress,
        "rows": state.rows,
        "sums": state.sums,
        "summed": state.summed,
    }
    with atomic_path(folder / CHECKPOINT) as partial:
        torch.save(content, partial)


def _resume(
    folder: Path,
    identity: dict[str, Argument],
    model: nn.Module,
    optimizer: torch.optim.Optimizer,
    state: _State,
) -> None:
    """Put the model, the optimizer and the state where the checkpoint in `folder` left them, if there is one."""
    path = folder / CHECKPOINT
    if not path.exists():
        return
    another = "give the same arguments to go on, or another folder to start again"
    device = next(model.parameters()).device
    try:
        found: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
        stored: dict[str, Argument] = found["arguments"]
    except Exception as error:
        raise InputError(str(path), f"no readable checkpoint ({type(error).__name__})", "delete it") from None
    differing = [name for name in {**stored, **identity} if stored.get(name) != identity.get(name)]
    if differing:
        listed = ", ".join(f"{name} {stored.get(name)} there and {identity.get(name)} here" for name in differing)
        raise InputError(str(folder), f"its checkpoint was made with other arguments: {listed}", another)
    try:
        model.load_state_dict(found["model"])
    except RuntimeError:
        raise InputError(str(folder), "its checkpoint is of another network", another) from None
    optimizer.load_state_dict(found["optimizer"])
    state.averaged = {name: value.to(device) for name, value in found["averaged"].items()}
    state.generator.set_state(found["generator"])
    state.sums = {name: value.to(device) for name, value in found["sums"].items()}
    state.step, state.summed, state.rows = int(found["step"]), int(found["summed"]), found["rows"]
    state.seconds, state.progress = float(found["seconds"]), float(found["progress"])
