"""Records exchanged between the parent and the workers: the batch, a task, and its outcome."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from fig2mesh.batch.collections.rows import Value
from fig2mesh.batch.row_files import Roots
from fig2mesh.conversion.request import Request


@dataclass(frozen=True)
class Batch:
    """Settings common to all rows.

    roots : of the input files; folder : of the outputs; fresh : ignore stored results
    overwrite : replace folders that are not from an earlier batch; unplaced : accept rows without a place
    target : folder that a dry run checks instead of writing into `folder`
    """

    roots: Roots
    folder: Path
    fresh: bool = False
    overwrite: bool = False
    unplaced: bool = False
    target: Path | None = None


@dataclass(frozen=True)
class Problem:
    """Why a row cannot be converted; see `georef.errors.InputError`."""

    source: str
    finding: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.source}: {self.finding}; {self.remedy}"


@dataclass(frozen=True)
class RowTask:
    """A row of a collection, ready to be converted.

    number, where : as in `Row`; name : of its folder; title : for people
    request : None where there is a problem
    formats : suffixes besides .glb, without dot; date : as in the row, None without one
    attributes : other values of the row
    own_files : fields of the request whose files are named by the row, not by the command line
    """

    number: int
    where: str
    name: str
    title: str
    request: Request | None
    formats: tuple[str, ...] = ()
    date: str | None = None
    attributes: dict[str, Value] = field(default_factory=dict)
    own_files: tuple[str, ...] = ()
    problem: Problem | None = None


@dataclass(frozen=True)
class Outcome:
    """Outcome of a row.

    status : done or failed; error : one line, None if done; internal : internal error, not a fault of the input
    lost : its worker could not record it; full : the disk is full; unchanged : the outputs were up to date
    seconds : of work; ran, reused : stages; counts : work done, by kind; trace : traceback of a failure
    """

    number: int
    name: str
    status: str
    error: str | None = None
    internal: bool = False
    lost: bool = False
    full: bool = False
    unchanged: bool = False
    seconds: float = 0.0
    ran: tuple[str, ...] = ()
    reused: tuple[str, ...] = ()
    counts: dict[str, int] = field(default_factory=dict)
    trace: str | None = None
