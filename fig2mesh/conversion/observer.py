"""Record of a conversion while it runs: time, memory, and which stages were run, read or left out."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

log = logging.getLogger("fig2mesh")


@dataclass(frozen=True)
class Timing:
    """Timing of a stage, or of another piece of work that a report lists.

    seconds : wall clock
    peak_mb : largest resident size of the process until its end, MiB
    why : reason for running it, or not
    runs : False where its result was read from a store, or not needed
    """

    name: str
    seconds: float
    peak_mb: float
    why: str
    runs: bool = True

    def as_dict(self) -> dict[str, Any]:
        """Fields as they appear in reports."""
        return {
            "stage": self.name,
            "seconds": round(self.seconds, 4),
            "peak_mb": round(self.peak_mb, 1),
            "run": self.runs,
            "why": self.why,
        }


@dataclass
class Observer:
    """Timings of one conversion.

    advance : called with the name of each piece of work before it begins
    timings : in the order in which the work ended
    """

    advance: Callable[[str], object] = lambda name: None
    timings: list[Timing] = field(default_factory=list)

    @contextmanager
    def work(self, name: str, why: str) -> Iterator[None]:
        """Time the block."""
        self.advance(name)
        start = time.perf_counter()
        yield
        self.note(name, why, time.perf_counter() - start)

    def note(self, name: str, why: str, seconds: float) -> None:
        """Record work that is done."""
        self.timings.append(Timing(name, seconds, peak_mb(), why))
        log.debug("%s: %.2f s", name, seconds)

    def left_out(self, name: str, why: str) -> None:
        """Record a stage that is not run."""
        self.timings.append(Timing(name, 0.0, peak_mb(), why, runs=False))

    @property
    def seconds(self) -> dict[str, float]:
        """Seconds of what was run, by name."""
        return {timing.name: timing.seconds for timing in self.timings if timing.runs}


def peak_mb() -> float:
    """Largest resident size of the process so far, MiB; 0 where the system does not report it."""
    try:
        import resource
    except ImportError:
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1 << 20) if sys.platform == "darwin" else peak / 1024
