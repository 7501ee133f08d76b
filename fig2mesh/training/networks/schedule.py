"""Budget, seed, batch, learning rate and device of a training run: the settings that all trainers share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Schedule:
    """Settings of one training run; it ends with its minutes or its steps, whichever ends first.

    budget_min : minutes, those before an interruption included; None for no limit
    steps : maximum number; None for no limit
    seed : of the network's first weights and of all that is drawn at random
    batch : samples per step; None for the default of the network
    rate : peak learning rate; None for the default of the network
    device : "cpu" or "cuda"
    init : folder of an earlier run whose weights training starts from; None to start at random
    """

    budget_min: float | None = None
    steps: int | None = None
    seed: int = 0
    batch: int | None = None
    rate: float | None = None
    device: str = "cpu"
    init: Path | None = None

    def batch_and_rate(self, batch: int, rate: float) -> tuple[int, float]:
        """Batch size and learning rate, given the defaults of a network."""
        return batch if self.batch is None else self.batch, rate if self.rate is None else self.rate
