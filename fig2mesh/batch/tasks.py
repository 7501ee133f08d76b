"""Tasks of the rows, with unique names, spooled to a file so that later changes of the collection have no effect."""

from __future__ import annotations

import dataclasses
import json
import re
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing
from pathlib import Path, PurePosixPath
from typing import Any, Final

from exporters.file_names import figure_name, name_key, safe_name
from exporters.text import plain_text
from fig2mesh.batch.collections.rows import Row
from fig2mesh.batch.columns import attributes_of, request_of
from fig2mesh.batch.row_files import FILE_FIELDS
from fig2mesh.batch.task import Problem, RowTask
from fig2mesh.conversion.cells import date_of
from fig2mesh.conversion.fields import as_plain, cell_text, list_of
from fig2mesh.conversion.request import Request
from fig2mesh.errors import InputError

FORMATS: Final = ("glb", "gltf", "usda", "usdc", "usdz", "ply", "obj", "czml", "geojson")
"""Formats that a row may request; .glb is always made."""

TAKEN: Final = (
    "tileset.json",
    "index.geojson",
    "index.gpkg",
    "figures.czml",
    "collection.json",
    "manifest.jsonl",
    "license.txt",
)
"""Names of files in the output folder, which no figure may have."""

FURTHER: Final = re.compile(r"tileset_\d+\.json", re.IGNORECASE)
"""Names of the further files of a large tileset."""


class Names:
    """Names that are taken, in a temporary database file, so that a million of them need no memory."""

    def __init__(self) -> None:
        self._table = sqlite3.connect("")
        self._table.execute("create table names (name text primary key, row integer, title text) without rowid")
        self._table.executemany("insert into names values (?, 0, ?)", [(name, name) for name in map(name_key, TAKEN)])

    def take(self, name: str, row: int, title: str) -> tuple[int, bool] | None:
        """Reserve the name of a folder for a row called `title`.

        Returns the row that already has it, if any (0: a file of the batch), and whether that has the same title too.
        """
        if FURTHER.fullmatch(name):
            return 0, True
        key, whole = name_key(name), name_key(title).encode("utf-8", "replace")
        found = self._table.execute("select row, title from names where name = ?", (key,)).fetchone()
        if found is not None:
            return int(found[0]), found[0] == 0 or found[1] == whole
        self._table.execute("insert into names values (?, ?, ?)", (key, row, whole))
        return None

    def close(self) -> None:
        """Delete the file."""
        self._table.close()


def tasks_of(rows: Iterable[Row], defaults: Mapping[str, Any] | None = None) -> Iterator[RowTask]:
    """Tasks of rows, named by the row or else by the stem of its picture, with a number if the name is taken.

    defaults : options for rows without them, by column
    """
    with closing(Names()) as names:
        for row in rows:
            yield _task(row, names, defaults or {})


def _task(row: Row, names: Names, defaults: Mapping[str, Any]) -> RowTask:
    values = row.values
    problem = None if row.problem is None else _problem(row.where, row.problem)
    given = values.get("name")
    picture = PurePosixPath(str(values.get("figure", "")).replace("\\", "/"))
    title = plain_text(cell_text(given) if given is not None else figure_name(picture) or f"row {row.number}")
    wanted = safe_name(title)
    name, number = wanted, 1
    while (taken := names.take(name, row.number, title)) is not None:
        other, same = taken
        # Names that differ, but not in characters that a file can have, such as "?" and "!", get numbers.
        if given is not None and problem is None and same:
            whose = f"also that of row {other}" if other else "that of a file of the batch"
            problem = _problem(row.where, f"its name {name} is {whose}; give each row a unique name")
        number += 1
        name = f"{wanted}_{number}"
    return make_task(row, name, title, defaults, problem)


def make_task(row: Row, name: str, title: str, defaults: Mapping[str, Any], problem: Problem | None = None) -> RowTask:
    """Task of a row; problem : one that has already been found."""
    values = row.values
    formats = tuple(list_of(values.get("format", defaults.get("format", ()))))
    date = values.get("date", defaults.get("date"))
    request = None
    if problem is None:
        try:
            request = request_of(values, defaults, title)
            check_formats(formats, "column format")
        except InputError as error:
            request, problem = None, Problem(error.source, error.finding, error.remedy)
    return RowTask(
        row.number,
        row.where,
        name,
        title,
        request,
        formats,
        None if date is None else date_of(date),
        attributes_of(values),
        tuple(field for field in FILE_FIELDS if field in values),
        problem,
    )


def check_formats(formats: Iterable[str], where: str) -> None:
    """Raise InputError, naming `where`, for a format that a row may not request."""
    for each in formats:
        if each.lower().lstrip(".") not in FORMATS:
            raise InputError(
                where, f"unknown format {each[:40]!r}", f"choose from {', '.join(FORMATS)}; .glb is always made"
            )


def _problem(where: str, text: str) -> Problem:
    finding, _, remedy = text.partition("; ")
    return Problem(where, finding, remedy or "correct the row")


def write_spool(tasks: Iterable[RowTask], path: Path) -> tuple[int, dict[str, int]]:
    """Write tasks to a file, one per line; return their number, and the number of rows with each attribute."""
    count = 0
    unknown: dict[str, int] = {}
    with path.open("w", encoding="utf-8") as stream:
        for task in tasks:
            stream.write(json.dumps(_plain(task), ensure_ascii=False) + "\n")
            count += 1
            for column in task.attributes:
                if column in unknown or len(unknown) < 1000:
                    unknown[column] = unknown.get(column, 0) + 1
    return count, unknown


def read_spool(path: Path) -> Iterator[RowTask]:
    """Tasks of a spool file."""
    with path.open(encoding="utf-8") as stream:
        for line in stream:
            yield _task_from(json.loads(line))


def _plain(task: RowTask) -> dict[str, Any]:
    fields = {each.name: getattr(task, each.name) for each in dataclasses.fields(task)}
    return fields | {
        "request": None if task.request is None else as_plain(task.request),
        "problem": None if task.problem is None else dataclasses.astuple(task.problem),
    }


def _task_from(fields: dict[str, Any]) -> RowTask:
    request, problem = fields["request"], fields["problem"]
    return RowTask(
        **fields
        | {
            "request": None if request is None else Request(**request),
            "problem": None if problem is None else Problem(*problem),
            "formats": tuple(fields["formats"]),
            "own_files": tuple(fields["own_files"]),
            "attributes": {column: _value(value) for column, value in fields["attributes"].items()},
        }
    )


def _value(value: object) -> object:
    return tuple(map(_value, value)) if isinstance(value, list) else value
