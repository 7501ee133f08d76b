"""What runs tasks: worker processes of this machine, or a cluster; the same rows give the same bytes by either."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

from fig2mesh.batch.task import Outcome, RowTask


@dataclass(frozen=True)
class StageNotice:
    """Notice of a worker that a row is at a stage."""

    worker: str
    number: int
    name: str
    stage: str


def lost(task: RowTask, how: str) -> Outcome:
    """The outcome of a row that no worker could tell itself."""
    return Outcome(task.number, task.name, "failed", how, internal=True, lost=True)


class Engine(Protocol):
    """Runs tasks on its workers."""

    @property
    def workers(self) -> int:
        """How many rows are worked on at a time."""
        ...

    def run(self, tasks: Iterable[RowTask]) -> Iterator[Outcome | StageNotice]:
        """Run all tasks and yield how each went, in the order in which they end, with notices in between.

        Tasks are taken from the iterable as workers are free, and no more are held than a few for each: memory does not
        depend on their number. A worker that dies is replaced; its row is tried once more.
        """
        ...
