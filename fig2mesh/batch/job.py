"""Implementation of `fig2mesh batch`: read the rows, run them, write the summary of all figures."""

from __future__ import annotations

import difflib
import logging
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from exporters.atomic_file import atomic_path, sweep_temporary
from exporters.gis.time_span import time_span
from exporters.text import check_utf8, plain_text
from exporters.tiles.tileset import short_range_warning
from fig2mesh.batch.collections.read import read_rows
from fig2mesh.batch.columns import OWN_COLUMNS, fields_by_column
from fig2mesh.batch.engine import Engine, StageNotice
from fig2mesh.batch.ledger import WORK, Ledger
from fig2mesh.batch.local_engine import LocalEngine
from fig2mesh.batch.progress import Tally, watching
from fig2mesh.batch.request import BatchRequest
from fig2mesh.batch.row_files import Roots
from fig2mesh.batch.row_job import FOLDER_KEYS
from fig2mesh.batch.summary import MANIFEST, TILESET, Collection, Summary, summarise_apart
from fig2mesh.batch.task import Batch, Outcome
from fig2mesh.batch.tasks import TAKEN, check_formats, read_spool, tasks_of, write_spool
from fig2mesh.errors import InputError, OutputError
from fig2mesh.terminal import print_outputs

log = logging.getLogger("fig2mesh")

WORKER_BYTES: Final = 2_500_000_000
"""Peak memory of a worker for a figure of standard quality, networks included."""


def run(request: BatchRequest, quiet: bool = False, verbose: int = 0) -> int:
    """Run a batch.

    Returns the exit code: 0 if all rows are done, 2 if some failed because of their input, 1 after internal errors.
    """
    defaults = request.row_defaults
    check_formats(request.formats, "--format")
    if request.date is not None:
        time_span(request.date, "--date")
    base = Path(os.path.abspath(request.collection)).parent
    roots = Roots(base, Path(os.path.realpath(request.root or base)))
    with _folder(request.output, request.dry_run, request.overwrite) as folder:
        target = folder if request.output is None else Path(os.path.abspath(request.output))
        batch = Batch(roots, folder, not request.resume, request.overwrite, request.unplaced, target)
        spool = folder / WORK / "rows.jsonl"
        with atomic_path(spool) as partial:
            count, unknown = write_spool(tasks_of(read_rows(request.collection, request.layer), defaults), partial)
        if count == 0:
            raise InputError(request.collection, "has no rows", "give one row for each figure")
        _log_unknown(unknown)
        tally = Tally(count)
        engine = _engine(request, batch, count)
        with watching(request.progress, tally, bool(verbose), quiet) as watchers:
            for notice in engine.run(read_spool(spool)):
                if isinstance(notice, StageNotice):
                    for watcher in watchers:
                        watcher.stage(notice)
                    continue
                tally.add(notice)
                for watcher in watchers:
                    watcher.row(notice, tally)
                if verbose > 1 and notice.trace is not None:
                    log.debug("%s", notice.trace.rstrip())
                if notice.full and not request.dry_run:
                    raise OutputError(folder, "the disk is full", "free some space and run the same command again")
                if notice.lost and not request.dry_run:
                    _keep_failure(folder, notice)
        if request.dry_run:
            log.info("%d rows: %d valid, %d invalid", count, count - tally.failed, tally.failed)
        else:
            title = plain_text(request.title or request.collection.stem)
            summary = summarise_apart(
                Collection(folder, spool, tuple(unknown), title, request.visible_from, request.license)
            )
            _log_summary(folder, tally, summary)
            if request.progress != "json":  # whose events are on stdout
                print_outputs(folder / (TILESET if summary.figures else MANIFEST))
            if summary.figures and (note := short_range_warning(request.visible_from, summary.tallest_m)):
                log.warning("%s", note)
        return 0 if not tally.failed else 1 if tally.internal else 2


def _engine(request: BatchRequest, batch: Batch, count: int) -> Engine:
    if request.engine == "dask":
        from fig2mesh.batch.dask_engine import DaskEngine

        return DaskEngine(batch, str(request.address), request.dry_run)
    return LocalEngine(batch, min(request.jobs or usual_jobs(), count), request.timeout, request.dry_run)


def usual_jobs() -> int:
    """Default number of workers: as many as there are cores, and memory for."""
    cores = os.cpu_count() or 1
    try:
        memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return cores
    return max(1, min(cores, memory // WORKER_BYTES))


@contextmanager
def _folder(output: Path | None, dry_run: bool, overwrite: bool) -> Iterator[Path]:
    """Lock the output folder and yield it; for a dry run, yield a temporary folder."""
    from filelock import FileLock, Timeout

    if output is not None:
        check_output(output, overwrite)
    if dry_run or output is None:
        with tempfile.TemporaryDirectory(prefix="fig2mesh-") as name:
            (Path(name) / WORK).mkdir()
            yield Path(name)
        return
    folder = Path(os.path.abspath(output))
    try:
        (folder / WORK).mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / WORK / "lock", timeout=0)
        with lock:
            # Rows sweep the folders of their figures.
            sweep_temporary(folder)
            sweep_temporary(folder / WORK, below=True)
            yield folder
    except Timeout:
        raise OutputError(output, "another batch is writing there", "wait for it, or choose another -o DIR") from None


def check_output(output: Path, overwrite: bool) -> None:
    """Raise OutputError or ExportError for a folder that a batch cannot write into; the same for a dry run."""
    check_utf8(output)
    folder = Path(os.path.abspath(output))
    if folder.exists() and not folder.is_dir():
        raise OutputError(output, "not a directory", "give -o a folder")
    above = next(each for each in (folder, *folder.parents) if each.exists())
    if not above.is_dir():
        raise OutputError(output, f"{above} is not a directory", "give -o a folder")
    if not os.access(above, os.W_OK | os.X_OK):
        raise OutputError(output, f"no permission to write in {above}", "choose another -o DIR")
    if not (folder / WORK).is_dir() and not overwrite:
        for name in TAKEN:
            if (folder / name).exists():
                raise OutputError(
                    folder / name,
                    "already exists, and is not from an earlier batch",
                    "use --overwrite or choose another -o DIR",
                )


def _log_unknown(unknown: dict[str, int]) -> None:
    """Log the columns that are not options, with suggestions for those that may be misspelt."""
    if not unknown:
        return
    known = [*fields_by_column(), *OWN_COLUMNS]
    shown = []
    for column in list(unknown)[:20]:
        near = difflib.get_close_matches(column, known, 1, 0.8)
        shown.append(f"{column} (did you mean {near[0]}?)" if near else column)
    more = f" and {len(unknown) - 20} more" if len(unknown) > 20 else ""
    log.info("columns that are not options become attributes: %s%s", ", ".join(shown), more)


def _keep_failure(folder: Path, outcome: Outcome) -> None:
    """Record the failure of a row whose worker could not record it."""
    ledger = Ledger(folder)
    before = ledger.read(outcome.name) or {}
    kept: dict[str, Any] = {name: before[name] for name in FOLDER_KEYS if name in before}
    ledger.write(outcome.name, {**kept, "status": "failed", "error": outcome.error, "ours": True})


def _log_summary(folder: Path, tally: Tally, summary: Summary) -> None:
    log.info(
        "%d figures: %d converted, %d unchanged, %d failed; %d on the globe",
        tally.total,
        tally.converted,
        tally.unchanged,
        tally.failed,
        summary.figures,
    )
    if summary.unplaced:
        log.info("%d figures have no place and are not in the tileset", summary.unplaced)
    if summary.left:
        names = ", ".join(summary.left[:5]) + (", …" if len(summary.left) > 5 else "")
        log.info("%d figures of an earlier collection were left in place: %s", len(summary.left), names)
    if tally.failed:
        log.error("%d of %d rows failed; see %s", tally.failed, tally.total, folder / MANIFEST)
