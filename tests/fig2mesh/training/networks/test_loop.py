"""The training loop: same seed same weights, resumed equals undisturbed, the budget counts from the first start."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor, nn

from fig2mesh.errors import InputError
from fig2mesh.training.networks.loop import Regime, Result, TrainingTask, run_loop, seeded
from fig2mesh.training.networks.schedule import Schedule


class Stop(Exception):
    """Stands for the plug that is pulled."""


def network() -> nn.Module:
    return nn.Sequential(nn.Linear(3, 16), nn.BatchNorm1d(16), nn.ReLU(), nn.Dropout(0.5), nn.Linear(16, 1))


def train(folder: Path, stop_at: int | None = None, **changed: Any) -> tuple[nn.Module, Result]:
    model = seeded(3, network)
    calls = 0

    def step(model: nn.Module, generator: torch.Generator, progress: float) -> Mapping[str, Tensor]:
        nonlocal calls
        calls += 1
        if calls == stop_at:
            raise Stop
        points = torch.randn(32, 3, generator=generator)
        error = model(points)[:, 0] - points.sum(dim=1)
        return {"loss": error.square().mean(), "largest": error.abs().max()}

    def validate() -> Mapping[str, float]:
        points = torch.eye(3)
        return {"loss": float((model(points)[:, 0] - 1).square().mean())}

    clock = {name: changed.pop(name) for name in ("clock",) if name in changed}
    regime = Regime(warmup=5, validations=changed.pop("validations", 2), checkpoint_s=0.0)
    optimizer = torch.optim.Adam(model.parameters(), 1e-2)
    task = TrainingTask(model, optimizer, step, validate, batch=32, arguments=changed.pop("arguments", {}))
    schedule = Schedule(**{"steps": 60, "seed": 7, "batch": 32, **changed})
    return model, run_loop(task, folder, schedule, regime, **clock)


def same(first: nn.Module, second: nn.Module) -> bool:
    pairs = zip(first.state_dict().values(), second.state_dict().values(), strict=True)
    return all(torch.equal(a, b) for a, b in pairs)


def ticking(seconds: float) -> Callable[[], float]:
    now = 0.0

    def clock() -> float:
        nonlocal now
        now += seconds
        return now

    return clock


def test_same_seed_same_weights_whatever_the_global_state(tmp_path: Path) -> None:
    first, _ = train(tmp_path / "a")
    torch.manual_seed(99)
    state = torch.get_rng_state()
    second, _ = train(tmp_path / "b")
    assert same(first, second)
    assert torch.equal(state, torch.get_rng_state())
    assert not same(first, train(tmp_path / "c", seed=8)[0])


@pytest.mark.parametrize("stop_at", [2, 31, 60])
def test_resumed_equals_undisturbed(tmp_path: Path, stop_at: int) -> None:
    whole, _ = train(tmp_path / "whole")
    with pytest.raises(Stop):
        train(tmp_path / "cut", stop_at=stop_at)
    resumed, result = train(tmp_path / "cut")
    assert same(whole, resumed)
    assert result.steps == 60
    rows = [list(csv.DictReader((tmp_path / name / "log.csv").open())) for name in ("whole", "cut")]
    for row in (*rows[0], *rows[1]):
        del row["seconds"]
    assert rows[0] == rows[1]


def test_a_finished_run_does_nothing_more(tmp_path: Path) -> None:
    first, _ = train(tmp_path)
    second, result = train(tmp_path, stop_at=1)
    assert same(first, second)
    assert result.metrics["valid_loss"] >= 0


def test_time_before_an_interruption_counts(tmp_path: Path) -> None:
    budget: dict[str, Any] = {"steps": None, "budget_min": 10.0, "validations": 1}
    with pytest.raises(Stop):
        train(tmp_path, stop_at=30, clock=ticking(10), **budget)
    _, result = train(tmp_path, clock=ticking(10), **budget)
    assert 600 <= result.seconds <= 640
    assert 30 < result.steps <= 60


def test_loss_falls_and_is_drawn(tmp_path: Path) -> None:
    _, result = train(tmp_path, steps=300, validations=5)
    rows = list(csv.DictReader((tmp_path / "log.csv").open()))
    assert float(rows[-1]["loss"]) < 0.5 * float(rows[0]["loss"])
    assert sum(bool(row["valid_loss"]) for row in rows) == 5
    assert int(rows[-1]["samples"]) == result.samples == 300 * 32
    pytest.importorskip("matplotlib")
    assert (tmp_path / "curve.png").stat().st_size > 1000


def test_other_arguments_are_refused(tmp_path: Path) -> None:
    train(tmp_path, arguments={"kind": "hand"})
    with pytest.raises(InputError, match=r"kind hand there and foot here") as caught:
        train(tmp_path, arguments={"kind": "foot"})
    assert str(tmp_path) in str(caught.value)
    with pytest.raises(InputError, match="seed 7 there and 8 here"):
        train(tmp_path, seed=8, arguments={"kind": "hand"})


def test_a_damaged_checkpoint_is_named(tmp_path: Path) -> None:
    (tmp_path / "checkpoint.pt").write_bytes(b"no checkpoint")
    with pytest.raises(InputError, match="delete it"):
        train(tmp_path)
