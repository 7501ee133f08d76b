"""What `fig2mesh batch` does: read the rows, run them, write what stands over them all."""

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
from fig2mesh.batch.collections.read import read_rows
from fig2mesh.batch.engine import Engine, Stage
from fig2mesh.batch.ledger import WORK, Ledger
from fig2mesh.batch.local_engine import LocalEngine
from fig2mesh.batch.progress import Kind, Tally, watching
from fig2mesh.batch.row_files import Roots
from fig2mesh.batch.row_job import LASTING
from fig2mesh.batch.row_options import OWN_COLUMNS, known_columns
from fig2mesh.batch.summary import MANIFEST, Collection, Summary, summarise_apart
from fig2mesh.batch.task import Batch, Outcome
from fig2mesh.batch.tasks import TAKEN, read_spool, tasks_of, write_spool
from fig2mesh.errors import InputError, OutputError

log = logging.getLogger("fig2mesh")

WORKER_BYTES: Final = 2_500_000_000
"""Memory that a figure of standard quality takes at most, networks included."""


def run(
    *,
    collection: Path,
    output: Path | None,
    jobs: int | None,
    engine: str,
    address: str | None,
    resume: bool,
    dry_run: bool,
    progress: Kind,
    timeout: float,
    root: Path | None,
    layer: str | None,
    unplaced: bool,
    title: str | None,
    visible_from: float,
    overwrite: bool,
    quiet: bool,
    verbose: int,
    defaults: dict[str, Any],
) -> int:
    """What `fig2mesh batch COLLECTION -o DIR …` does; the parameters are the options of the command line.

    defaults : options of the main job for rows that have none, column → value

    Returns the exit code: 0 all rows are done, 2 some are not because of their input, 1 because of us.
    """
    from fig2mesh.convert.job import configure_logging

    configure_logging(quiet, verbose)
    if engine == "dask" and address is None:
        raise InputError("--engine dask", "no scheduler is named", "pass --address tcp://HOST:8786")
    if engine == "local" and address is not None:
        raise InputError("--address", "given without --engine dask", "pass --engine dask as well")
    if output is None and not dry_run:
        raise InputError("-o", "no folder for the outputs", "pass -o DIR")
    if not 0 < visible_from < 1e9:
        raise InputError("--visible-from", f"{visible_from:g} m", "give a distance in metres")
    if root is not None and not root.is_dir():
        raise InputError("--root", f"no folder {root}", "name a folder that holds the collection's files")
    base = Path(os.path.abspath(collection)).parent
    roots = Roots(base, Path(os.path.realpath(root or base)))

    with _folder(output, dry_run, overwrite) as folder:
        batch = Batch(roots, folder, defaults, not resume, overwrite, unplaced)
        spool = folder / WORK / "rows.jsonl"
        with atomic_path(spool) as partial:
            count, unknown = write_spool(tasks_of(read_rows(collection, layer)), partial)
        if count == 0:
            raise InputError(collection, "has no rows", "give one row for each figure")
        _tell_unknown(unknown)
        tally = Tally(count)
        runner: Engine
        if engine == "dask":
            from fig2mesh.batch.dask_engine import DaskEngine

            runner = DaskEngine(batch, str(address), dry_run)
        else:
            runner = LocalEngine(batch, min(jobs or usual_jobs(), count), timeout, dry_run)
        with watching(progress, tally, bool(verbose), quiet) as watchers:
            for notice in runner.run(read_spool(spool)):
                if isinstance(notice, Stage):
                    for watcher in watchers:
                        watcher.stage(notice)
                    continue
                tally.add(notice)
                for watcher in watchers:
                    watcher.row(notice, tally)
                if notice.full and not dry_run:
                    raise OutputError(folder, "the disk is full", "free some space and run the same command again")
                if notice.lost and not dry_run:
                    _keep_failure(folder, notice)
        if dry_run:
            log.info("%d rows: %d are fine, %d are not", count, count - tally.failed, tally.failed)
        else:
            columns = tuple(unknown)
            name = title or collection.stem
            summary = summarise_apart(Collection(folder, spool, columns, name, visible_from))
            _tell(folder, tally, summary)
        return 0 if not tally.failed else 1 if tally.ours else 2


def usual_jobs() -> int:
    """As many workers as there are cores, and memory for."""
    cores = os.cpu_count() or 1
    try:
        memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return cores
    return max(1, min(cores, memory // WORKER_BYTES))


@contextmanager
def _folder(output: Path | None, dry_run: bool, overwrite: bool) -> Iterator[Path]:
    """The folder of the outputs, ours alone for now; for a dry run one that goes away again."""
    from filelock import FileLock, Timeout

    if dry_run or output is None:
        with tempfile.TemporaryDirectory(prefix="fig2mesh-") as name:
            (Path(name) / WORK).mkdir()
            yield Path(name)
        return
    folder = Path(os.path.abspath(output))
    if folder.exists() and not folder.is_dir():
        raise OutputError(output, "is no folder", "give -o a folder")
    if not (folder / WORK).is_dir() and not overwrite:
        for name in TAKEN:
            if (folder / name).exists():
                raise OutputError(
                    folder / name, "exists, and is not of an earlier batch", "pass --overwrite or another -o DIR"
                )
    try:
        (folder / WORK).mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / WORK / "lock", timeout=0)
        with lock:
            # The folders of figures are swept by their rows.
            sweep_temporary(folder)
            sweep_temporary(folder / WORK, below=True)
            yield folder
    except Timeout:
        raise OutputError(output, "another batch is writing there", "wait for it, or choose another -o DIR") from None


def _tell_unknown(unknown: dict[str, int]) -> None:
    """Say which columns are no options; one that is nearly called like an option may be a slip."""
    if not unknown:
        return
    known = [*known_columns(), *OWN_COLUMNS]
    shown = []
    for column in list(unknown)[:20]:
        near = difflib.get_close_matches(column, known, 1, 0.8)
        shown.append(f"{column} (not {near[0]}?)" if near else column)
    more = f" and {len(unknown) - 20} more" if len(unknown) > 20 else ""
    log.info("columns that are no options are kept as attributes: %s%s", ", ".join(shown), more)


def _keep_failure(folder: Path, outcome: Outcome) -> None:
    """Record a row that its worker could not record itself."""
    ledger = Ledger(folder)
    before = ledger.read(outcome.name) or {}
    kept: dict[str, Any] = {name: before[name] for name in LASTING if name in before}
    ledger.write(outcome.name, {**kept, "status": "failed", "error": outcome.error, "ours": True})


def _tell(folder: Path, tally: Tally, summary: Summary) -> None:
    log.info(
        "%s: %d figures: %d converted, %d unchanged, %d failed; %d on the globe",
        folder,
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
        log.info("%d figures of an earlier collection are left where they are: %s", len(summary.left), names)
    if tally.failed:
        log.error("%d of %d rows failed; %s says why", tally.failed, tally.total, folder / MANIFEST)
