"""The runner of stages: makes the requested results with as little work as the store allows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar, cast

from fig2mesh.conversion.keys import figure_digest, key_of, stage_keys
from fig2mesh.conversion.observer import Observer
from fig2mesh.conversion.stores import NoStore, Store
from fig2mesh.records import Figure
from fig2mesh.settings import Settings
from fig2mesh.skeleton import FIGURE_HEIGHT
from fig2mesh.stages.stage import Stage
from fig2mesh.stages.table import STAGES

T = TypeVar("T")


@dataclass(frozen=True)
class Inputs:
    """Inputs of the first stages, besides settings.

    figure : without specks, see `fig2mesh.parts.pieces`
    pieces : number of connected pieces of the drawing
    height_m : of the model, metres
    """

    figure: Figure
    pieces: int
    height_m: float = FIGURE_HEIGHT

    def values(self) -> dict[str, object]:
        """Inputs by name."""
        return {"figure": self.figure, "pieces": self.pieces, "height_m": self.height_m}

    def keys(self) -> dict[str, str]:
        """Key of each input."""
        return {
            "figure": figure_digest(self.figure),
            "pieces": key_of(pieces=self.pieces),
            "height_m": key_of(height_m=self.height_m),
        }


@dataclass(frozen=True)
class Results:
    """Results of stages: `results[lift]` is what the stage function `lift` returned, with its type.

    keys : key of each result; empty unless the store goes by keys
    """

    values: Mapping[str, object]
    keys: Mapping[str, str]

    def __getitem__(self, stage: Callable[..., T]) -> T:
        return cast(T, self.values[stage.__name__])

    def __contains__(self, stage: Callable[..., object]) -> bool:
        return stage.__name__ in self.values


@dataclass(frozen=True)
class Runner:
    """Runs stages in the order of `stages`.

    settings : each stage gets those that it reads
    store : where results are looked up and kept
    observer : records time and memory
    """

    settings: Settings
    stages: Sequence[Stage] = STAGES
    store: Store = field(default_factory=NoStore)
    observer: Observer = field(default_factory=Observer)

    def keys(self, inputs: Inputs) -> dict[str, str]:
        """Key of each stage's result."""
        return stage_keys(self.stages, self.settings, inputs.keys())

    def run(self, goals: Sequence[Callable[..., object]], inputs: Inputs) -> Results:
        """Results of the stage functions `goals`, and of all stages that were needed for them.

        Stages whose results the store holds are not run, nor are those that only they need.
        """
        keys = self.keys(inputs) if self.store.keyed else {}
        results = inputs.values()
        wanted = {goal.__name__ for goal in goals}
        not_run: dict[str, str] = {}
        # From the goals back to the inputs: what a stage needs is wanted only if the stage is to run.
        for stage in reversed(self.stages):
            why = stage.left_out(self.settings)
            if why is not None:
                results[stage.name] = None
                not_run[stage.name] = why
            elif stage.name not in wanted:
                not_run[stage.name] = "nothing needs it"
            elif (found := self.store.load(stage, keys.get(stage.name, ""))) is not None:
                results[stage.name] = found
                not_run[stage.name] = "read from the store"
            else:
                wanted.update(stage.needs)
        for stage in self.stages:
            if stage.name in not_run:
                self.observer.left_out(stage.name, not_run[stage.name])
                continue
            with self.observer.work(stage.name, stage.why(self.settings)):
                results[stage.name] = stage.run(self.settings, results)
            self.store.save(stage, keys.get(stage.name, ""), results[stage.name])
        return Results(results, keys)
