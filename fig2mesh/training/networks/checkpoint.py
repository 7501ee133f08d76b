"""Checkpoints of a training run: the state from which it resumes as if it had not been interrupted."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from exporters.atomic_file import atomic_path
from fig2mesh.errors import InputError

CHECKPOINT = "checkpoint.pt"


Argument = str | int | float | bool | None


@dataclass
class State:
    """State that changes at each step, besides the model and the optimiser."""

    generator: torch.Generator
    averaged: dict[str, Tensor]
    step: int = 0
    seconds: float = 0.0
    progress: float = 0.0
    rows: list[dict[str, float]] = field(default_factory=list)
    sums: dict[str, Tensor] = field(default_factory=dict)
    summed: int = 0


def save_checkpoint(
    folder: Path,
    identity: dict[str, Argument],
    model: nn.Module,
    optimizer: torch.optim.Optimizer,
    state: State,
) -> None:
    """Write the checkpoint of a run, whole or not at all."""
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


def resume(
    folder: Path,
    identity: dict[str, Argument],
    model: nn.Module,
    optimizer: torch.optim.Optimizer,
    state: State,
) -> None:
    """Restore the model, the optimiser and the state from the checkpoint in `folder`, if there is one."""
    path = folder / CHECKPOINT
    if not path.exists():
        return
    another = "give the same arguments to resume, or another folder to start again"
    device = next(model.parameters()).device
    try:
        found: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
        stored: dict[str, Argument] = found["arguments"]
    except Exception as error:
        raise InputError(str(path), f"not a readable checkpoint ({type(error).__name__})", "delete it") from None
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
