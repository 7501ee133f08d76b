"""Interface of engines: local worker processes, or a cluster; the same rows give the same bytes with either."""

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
    """Outcome of a row that no worker could report."""
    return Outcome(task.number, task.name, "failed", how, internal=True, lost=True)


class Engine(Protocol):
    """Runner of tasks on several workers."""

    @property
    def workers(self) -> int:
        """Number of rows processed at a time."""
        ...

    def run(self, tasks: Iterable[RowTask]) -> Iterator[Outcome | StageNotice]:
        """Run all tasks and yield their outcomes in the order in which they end, with notices in between.

        Tasks are taken from the iterable as workers become free, a few ahead for each, so that memory does not depend
        on their number. A worker that dies is replaced; its row is retried once.
        """
        ...
