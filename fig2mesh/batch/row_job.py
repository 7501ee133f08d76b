"""Conversion of one row of a collection to its files and its record; runs in workers, local or remote."""

from __future__ import annotations

import errno
import os
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from exporters.atomic_file import sweep_temporary, without_temporary
from fig2mesh.batch.collections.rows import Value
from fig2mesh.batch.ledger import BEGUN, WORK, Ledger
from fig2mesh.batch.resolved_row import ResolvedRow
from fig2mesh.batch.row_files import digest_of
from fig2mesh.batch.task import Batch, Outcome, RowTask
from fig2mesh.errors import InputError, OutputError

if TYPE_CHECKING:
    from exporters.asset import Asset
    from exporters.placed_figure import Attributes
    from fig2mesh.conversion.request import Request
    from fig2mesh.conversion.stores import KeyedStore

READ = "figure"
"""Name of the result of reading and parsing, which precede the stages."""

MEASURES = "measures"
"""Name of the result of measuring the model, which takes longer than writing it."""

UNKNOWN_DATE = "1678/2261"
"""Date in the catalogue, which requires one: all years that pandas can hold, in nanoseconds from 1970. The modification
time of a file is not that of the drawing, and copying changes it."""

FULL = (errno.ENOSPC, errno.EDQUOT)

FOLDER_KEYS = ("claimed", "files")
"""Entries of a record about the folder, kept whatever the outcome of the row: whether it belongs to the batch, and the
files that the batch has written there."""

Advance = Callable[[str], object]


def check_row(batch: Batch, task: RowTask) -> Outcome:
    """Read all files of a row and report problems, without writing anything or running a network."""
    try:
        ResolvedRow(batch, task).check()
        if batch.target is not None:
            before = Ledger(batch.target).read(task.name) if (batch.target / WORK).is_dir() else None
            check_free(batch.target / task.name, bool(before and before.get("claimed")), batch.overwrite)
    except InputError as error:
        line, trace = batch.roots.shorten(_line(error)), traceback.format_exc()
        return Outcome(task.number, task.name, "failed", line, trace=trace)
    except Exception as error:
        line = f"internal error: {type(error).__name__}: {_line(error)}"
        return Outcome(task.number, task.name, "failed", line, internal=True, trace=traceback.format_exc())
    return Outcome(task.number, task.name, "done")


def convert_row(batch: Batch, task: RowTask, advance: Advance = lambda stage: None) -> Outcome:
    """Convert a row, unless its outputs are up to date; errors become part of the outcome.

    advance : called with the name of each stage before it runs
    """
    ledger = Ledger(batch.folder)
    start = time.perf_counter()
    before = ledger.read(task.name)
    record: dict[str, Any] = {
        "status": BEGUN,
        **{name: before[name] for name in FOLDER_KEYS if before and name in before},
    }
    fault: BaseException | None = None
    try:
        try:
            row = ResolvedRow(batch, task)
            record["key"] = row.key
            if not batch.fresh and before is not None and before.get("key") == row.key and row.is_current(before):
                return _outcome(task, before, unchanged=True)
            row.check_values()
            _claim(batch, task, ledger, record)
            from fig2mesh.conversion.stores import KeyedStore

            store = KeyedStore(batch.folder / WORK / "stages", batch.fresh)
            record |= _convert(row, store, record.get("files", ()), advance) | {"status": "done"}
        except InputError as error:
            fault = error
            # Errors of the disk may not recur; errors of the input will.
            record |= {"status": "failed", "error": batch.roots.shorten(_line(error))}
            record["lasting"] = "key" in record and error.permanent
        except Exception as error:
            fault = error
            found = f"internal error: {type(error).__name__}: {_line(error)}"
            record |= {"status": "failed", "error": batch.roots.shorten(found), "ours": True}
        record["full"] = fault is not None and _full(fault)
        record["seconds"] = round(time.perf_counter() - start, 3)
        if before is not None and record | {"seconds": before.get("seconds")} == before:
            record = before  # the same failure as before
        ledger.write(task.name, record)
    except OSError as error:
        record |= {"status": "failed", "error": f"its record cannot be written ({error.strerror})"}
        record["full"] = error.errno in FULL
    trace = None if fault is None else "".join(traceback.format_exception(fault))
    return replace(_outcome(task, record), trace=trace)


def _outcome(task: RowTask, record: dict[str, Any], unchanged: bool = False) -> Outcome:
    work = record.get("work", {}) if not unchanged else {}
    return Outcome(
        number=task.number,
        name=task.name,
        status=record["status"],
        error=record.get("error"),
        internal=record.get("ours", False),
        full=record.get("full", False),
        unchanged=unchanged,
        seconds=record.get("seconds", 0.0),
        ran=tuple(work.get("ran", ())),
        reused=tuple(work.get("reused", ())),
        counts=work.get("counts", {}),
    )


def _full(error: BaseException | None) -> bool:
    """Whether an error was caused by a full disk."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in FULL:
            return True
        error = error.__cause__ or error.__context__
    return False


def _line(error: Exception) -> str:
    # Temporary paths are of no use to the user.
    return " ".join(without_temporary(str(error)).split())[:500] or type(error).__name__


def check_free(target: Path, claimed: bool, overwrite: bool) -> None:
    """Raise OutputError for the folder of a figure that the batch may not replace; claimed : whether it is its own."""
    if target.is_symlink():
        raise OutputError(target, "is a link", "remove it, or rename the figure")
    if not claimed and os.path.lexists(target) and not overwrite:
        raise OutputError(
            target, "already exists, and is not from an earlier batch", "use --overwrite or choose another -o DIR"
        )


def _claim(batch: Batch, task: RowTask, ledger: Ledger, record: dict[str, Any]) -> None:
    """Record that the folder of a figure belongs to the batch, and remove temporary files of workers that died."""
    target = batch.folder / task.name
    check_free(target, bool(record.get("claimed")), batch.overwrite)
    record["claimed"] = True
    ledger.write(task.name, record)
    if target.is_dir():
        sweep_temporary(target)


def _convert(row: ResolvedRow, store: KeyedStore, before: Sequence[str], advance: Advance) -> dict[str, Any]:
    """Make the outputs, replacing the files `before`; return the entries of the record."""
    from exporters.placed_figure import figure_of
    from exporters.tiles.tileset import with_visible_outlines
    from fig2mesh.conversion.convert import convert
    from fig2mesh.conversion.keys import key_of
    from fig2mesh.conversion.observer import Observer
    from fig2mesh.conversion.report import model_measures
    from fig2mesh.counters import counting
    from fig2mesh.parse.read import read_figure
    from fig2mesh.records import Figure

    request, task = row.request, row.task
    with counting() as counts:
        advance("read")
        files = {name: (path.name, digest_of(path)) for name, path in _figure_files(request).items()}
        key = key_of(stage=READ, files=files, bbox=request.bbox)
        drawn = store.make(READ, key, Figure, lambda: read_figure(**request.reading(), name=READ, force=request.force))
        done = convert(
            request, replace(drawn, name=task.title), sheet=row.sheet(), store=store, observer=Observer(advance)
        )
        advance("write")
        asset = with_visible_outlines(done.asset)
        outputs = _write(row, asset, before)
        key = key_of(stage=MEASURES, model=done.run.results.keys["model"], evidence=request.evidence)
        measures = store.make(MEASURES, key, dict[str, Any], lambda: model_measures(done))
    record = {
        "inputs": row.inputs,
        "outputs": {name: digest for name, (_, digest) in outputs.items()},
        "sizes": {name: size for name, (size, _) in outputs.items()},
        "files": sorted(outputs),
        "measures": measures,
        "placement": None if asset.placement is None else asdict(asset.placement),
        "map": done.placed.map,
        "notes": [*map(row.batch.roots.shorten, done.placed.notes), *done.notes],
        "score": done.run.figure.score,
        "doubts": [*map(row.batch.roots.shorten, done.run.figure.doubts)],
        "date": task.date or UNKNOWN_DATE,
        "work": {"ran": store.made, "reused": store.reused, "counts": {k: n for k, n in counts.items() if n}},
    }
    if asset.placement is not None:
        contents = tuple(f"{task.name}/{name}" for name in _levels(row, asset))
        whole = replace(figure_of(asset, contents), attributes=_plain(task.attributes), source=row.source)
        record["figure"] = asdict(whole)
    return record


def _figure_files(request: Request) -> dict[str, Path]:
    given = {name: getattr(request, name) for name in ("figure", "mask", "keypoints", "part_labels")}
    return {name: path for name, path in given.items() if path is not None}


def _levels(row: ResolvedRow, asset: Asset) -> list[str]:
    """File names of the levels of detail, finest first."""
    from exporters.tiles.tileset import content_name

    return [content_name(row.task.name, level) for level in range(len(asset.lods))]


def _write(row: ResolvedRow, asset: Asset, before: Sequence[str]) -> dict[str, tuple[int, str]]:
    """Write all outputs or none; return size and digest of each, by its path relative to the batch's folder.

    before : files of an earlier run in the folder of the figure
    """
    from exporters.atomic_file import write_whole
    from exporters.write import in_order, write

    folder, profile = row.batch.folder / row.task.name, row.profile()
    main = folder / row.targets[0]

    def fill(stage: Path) -> None:
        for target in in_order(row.targets):
            write(asset, stage / target, profile=profile)
        for level, name in enumerate(_levels(row, asset)[1:], start=1):
            write(replace(asset, lods=(asset.lods[level],)), stage / name, profile=profile)

    outdated = [Path(name).name for name in before]
    files = write_whole(main, main, fill, overwrite=True, outdated=outdated)
    return {
        file.relative_to(row.batch.folder).as_posix(): (file.stat().st_size, digest_of(file)) for file in sorted(files)
    }


def _plain(attributes: Mapping[str, Value]) -> Attributes:
    """Attributes for indexes, with lists as text."""
    from exporters.placed_figure import plain_attributes

    return plain_attributes(
        {name: ", ".join(map(str, value)) if isinstance(value, tuple) else value for name, value in attributes.items()}
    )
