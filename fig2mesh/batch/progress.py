"""Progress of a batch: a bar on a terminal, the state of each worker on demand, or a stream of events for programs."""

from __future__ import annotations

import json
import logging
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Final, Literal, Protocol, TextIO

from fig2mesh.batch.engine import StageNotice
from fig2mesh.batch.task import Outcome

log = logging.getLogger("fig2mesh")

Kind = Literal["auto", "bar", "json", "none"]

SHOWN: Final = 20
"""Number of failed rows that are logged; the manifest lists them all."""

RECENT: Final = 200
"""Number of rows over which the rate is averaged."""


class Watcher(Protocol):
    """Observer of the stages and outcomes of a run."""

    def stage(self, notice: StageNotice) -> None:
        """A worker begins a stage."""

    def row(self, outcome: Outcome, tally: Tally) -> None:
        """A row has ended."""


@dataclass
class Tally:
    """Counts of a run.

    total : rows; converted, unchanged, failed, internal : rows of each kind, internal errors among the failed
    stages : number of runs of each stage; counts : work done, by kind
    """

    total: int
    converted: int = 0
    unchanged: int = 0
    failed: int = 0
    internal: int = 0
    stages: dict[str, int] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    start: float = field(default_factory=time.monotonic)
    ends: deque[float] = field(default_factory=lambda: deque(maxlen=RECENT))

    @property
    def ended(self) -> int:
        """Rows that have ended."""
        return self.converted + self.failed + self.unchanged

    def add(self, outcome: Outcome) -> None:
        """Count a row; an unchanged failure counts as failed."""
        if outcome.status == "failed":
            self.failed += 1
            self.internal += outcome.internal
        elif outcome.unchanged:
            self.unchanged += 1
        else:
            self.converted += 1
        for stage in outcome.ran:
            self.stages[stage] = self.stages.get(stage, 0) + 1
        for work, number in outcome.counts.items():
            self.counts[work] = self.counts.get(work, 0) + number
        self.ends.append(time.monotonic())

    @property
    def per_minute(self) -> float:
        """Recent rate, rows per minute."""
        if not self.ends:
            return 0.0
        first = self.start if len(self.ends) < RECENT else self.ends[0]
        return 60 * len(self.ends) / max(self.ends[-1] - first, 1e-6)

    @property
    def left_s(self) -> float | None:
        """Estimated seconds until the end; None before the first row has ended."""
        rate = self.per_minute
        return 60 * (self.total - self.ended) / rate if rate else None

    def as_dict(self) -> dict[str, Any]:
        """Fields for events."""
        left = self.left_s
        return {
            "total": self.total,
            "ended": self.ended,
            "converted": self.converted,
            "unchanged": self.unchanged,
            "failed": self.failed,
            "rows_per_minute": round(self.per_minute, 2),
            "seconds_left": None if left is None else round(left, 1),
        }


class Events:
    """Events start, stage, row and end, one JSON object per line; `t` is seconds since the start."""

    def __init__(self, stream: TextIO) -> None:
        self._stream, self._start = stream, time.monotonic()

    def emit(self, event: str, **facts: Any) -> None:
        """Write an event and flush."""
        line = {"event": event, "t": round(time.monotonic() - self._start, 3), **facts}
        self._stream.write(json.dumps(line, ensure_ascii=False) + "\n")
        self._stream.flush()

    def stage(self, notice: StageNotice) -> None:
        """A worker begins a stage."""
        self.emit("stage", worker=notice.worker, row=notice.number, name=notice.name, stage=notice.stage)

    def row(self, outcome: Outcome, tally: Tally) -> None:
        """A row has ended."""
        self.emit(
            "row",
            row=outcome.number,
            name=outcome.name,
            status=outcome.status,
            error=outcome.error,
            unchanged=outcome.unchanged,
            seconds=outcome.seconds,
            ran=list(outcome.ran),
            reused=list(outcome.reused),
            progress=tally.as_dict(),
        )


class Lines:
    """Log of failed rows, on stderr."""

    def stage(self, notice: StageNotice) -> None:
        """Stages are not logged."""

    def row(self, outcome: Outcome, tally: Tally) -> None:
        """A row has ended."""
        if outcome.status == "failed" and tally.failed <= SHOWN:
            log.error("%s", failed_line(outcome))
        if outcome.status == "failed" and tally.failed == SHOWN:
            log.error("further failed rows are in the manifest")


def failed_line(outcome: Outcome) -> str:
    """Description of a failed row in one line."""
    return f"row {outcome.number}, {outcome.name}: {outcome.error}"


class Workers:
    """Current stage of each worker: shown below the bar with -v, and on the signal USR1."""

    def __init__(self) -> None:
        self.now: dict[str, tuple[StageNotice, float]] = {}

    def stage(self, notice: StageNotice) -> None:
        """A worker begins a stage."""
        self.now[notice.worker] = (notice, time.monotonic())

    def row(self, outcome: Outcome, tally: Tally) -> None:
        """A row has ended, so its worker is idle."""
        for worker, (notice, _) in list(self.now.items()):
            if notice.number == outcome.number:
                del self.now[worker]

    def lines(self) -> list[str]:
        """One line per worker."""
        return [
            f"worker {worker}: row {notice.number}, {notice.name}: {notice.stage}, {time.monotonic() - since:.0f} s"
            for worker, (notice, since) in sorted(self.now.items())
        ]


@contextmanager
def watching(kind: Kind, tally: Tally, verbose: bool, quiet: bool) -> Iterator[list[Watcher]]:
    """Watchers of a run: bar or events, log of failures, and state of the workers."""
    workers = Workers()
    watchers: list[Watcher] = [workers, Lines()]
    with _on_signal(tally, workers):
        if kind == "json":
            events = Events(sys.stdout)
            events.emit("start", progress=tally.as_dict())
            yield [*watchers, events]
            events.emit("end", progress=tally.as_dict(), stages=tally.stages, counts=tally.counts)
            return
        if kind == "none" or (kind == "auto" and (quiet or not sys.stderr.isatty())):
            yield watchers
            return
        with _bar(tally, workers if verbose else None) as bar:
            yield [*watchers, bar]


@contextmanager
def _on_signal(tally: Tally, workers: Workers) -> Iterator[None]:
    """Print the state of each worker on the signal USR1, on systems that have it."""
    if not hasattr(signal, "SIGUSR1") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def show(number: int, frame: object) -> None:
        shown = [f"{tally.ended} of {tally.total} rows, {tally.failed} failed", *workers.lines()]
        sys.stderr.write("\n".join(shown) + "\n")

    before = signal.signal(signal.SIGUSR1, show)
    try:
        yield
    finally:
        signal.signal(signal.SIGUSR1, before)


@contextmanager
def _bar(tally: Tally, workers: Workers | None) -> Iterator[Watcher]:
    from rich.console import Console, Group
    from rich.live import Live
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.text import Text

    progress = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
    )
    task = progress.add_task("figures", total=tally.total, rate="")

    def shown() -> Any:
        return Group(progress, Text("\n".join(workers.lines()))) if workers is not None else progress

    live = Live(console=Console(stderr=True), transient=True, refresh_per_second=4, get_renderable=shown)

    class Bar:
        def stage(self, notice: StageNotice) -> None:
            """The lines of the workers are formatted when they are shown."""

        def row(self, outcome: Outcome, tally: Tally) -> None:
            """A row has ended."""
            left = tally.left_s
            rate = f"{tally.per_minute:.1f}/min" + ("" if left is None else f", {_duration(left)} left")
            failed = f", {tally.failed} failed" if tally.failed else ""
            progress.update(task, completed=tally.ended, rate=rate + failed)

    with live:
        yield Bar()


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
