"""How much work was done: calls of networks, values of fields, rays. A report can prove by it what was not done."""

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
    """Work done inside the block, by kind; none is 0. Blocks within blocks count for the inner one alone."""
    counts = dict.fromkeys(WORK, 0)
    token = _counts.set(counts)
    try:
        yield counts
    finally:
        _counts.reset(token)


def count(work: Work, number: int = 1) -> None:
    """Note some work, if anybody counts."""
    counts = _counts.get()
    if counts is not None:
        counts[work] += number
