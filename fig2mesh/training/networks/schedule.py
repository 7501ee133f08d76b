"""How long a network is trained, and on what: the settings that all trainers share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Schedule:
    """Extent and conditions of one training run; the run ends with its minutes or its steps, whichever ends first.

    budget_min : minutes, those before an interruption included; None for no limit
    steps : their number; None for no limit
    seed : of the network's first weights and of all that is drawn at random
    batch : samples a step; None for as many as the network usually takes
    rate : learning rate at its highest; None for the network's usual one
    device : where the network is trained
    init : folder of an earlier run whose weights training starts from; None to start at random
    """

    budget_min: float | None = None
    steps: int | None = None
    seed: int = 0
    batch: int | None = None
    rate: float | None = None
    device: str = "cpu"
    init: Path | None = None

    def usual(self, batch: int, rate: float) -> tuple[int, float]:
        """Batch and learning rate, given those that a network usually has."""
        return batch if self.batch is None else self.batch, rate if self.rate is None else self.rate
