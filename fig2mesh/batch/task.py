"""What goes between the parent and the workers: what all rows have in common, a row, and how it went."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fig2mesh.batch.collections.rows import Value
from fig2mesh.batch.row_files import Roots


@dataclass(frozen=True)
class Batch:
    """What all rows have in common.

    roots : where their files are; folder : of the outputs; defaults : options where a row has none, column → value;
    fresh : nothing that is kept is used; overwrite : folders of figures that no batch has begun may be replaced;
    unplaced : rows need no place
    """

    roots: Roots
    folder: Path
    defaults: dict[str, Any]
    fresh: bool = False
    overwrite: bool = False
    unplaced: bool = False


@dataclass(frozen=True)
class Task:
    """A row with its name. number, where, values, problem : as in `Row`; name : of its folder; title : for people."""

    number: int
    where: str
    name: str
    title: str
    values: dict[str, Value]
    problem: str | None = None


@dataclass(frozen=True)
class Outcome:
    """How a row went.

    status : done, or failed; error : one line, None if done; ours : the fault is ours, not the input's
    lost : its worker could not record it; full : the disk is; unchanged : nothing was to do
    seconds : of work; ran, reused : stages; counts : work done, by kind
    """

    number: int
    name: str
    status: str
    error: str | None = None
    ours: bool = False
    lost: bool = False
    full: bool = False
    unchanged: bool = False
    seconds: float = 0.0
    ran: tuple[str, ...] = ()
    reused: tuple[str, ...] = ()
    counts: dict[str, int] = field(default_factory=dict)
