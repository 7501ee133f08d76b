"""Counters of work: network calls, field values, rays. With them a report can prove what was not computed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Final, Literal

Work = Literal[
    "pose network",
    "part networks",
    "texture coordinate network",
    "texture completion network",
    "field values",
    "rays",
    "shading normals",
    "texels",
]
"""calls of a network with one figure or part; points; rays; vertices; texels that were coloured"""

# fmt: off
WORK: Final[tuple[Work, ...]] = (
    "pose network", "part networks", "texture coordinate network", "texture completion network",
    "field values", "rays", "shading normals", "texels",
)
# fmt: on

_counts: ContextVar[dict[Work, int] | None] = ContextVar("counts", default=None)


@contextmanager
def counting() -> Iterator[dict[Work, int]]:
    """Count the work done inside the block, by kind, from 0. Work in a nested block counts for the inner block only."""
    counts = dict.fromkeys(WORK, 0)
    token = _counts.set(counts)
    try:
        yield counts
    finally:
        _counts.reset(token)


def count(work: Work, number: int = 1) -> None:
    """Add to the counters, inside a `counting` block."""
    counts = _counts.get()
    if counts is not None:
        counts[work] += number
