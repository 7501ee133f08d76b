"""Rows with their names, spooled to a file: read once, from then on the same whatever happens to the collection."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import asdict
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Final

from exporters.tiles.tileset import safe_name
from fig2mesh.batch.row_options import is_known
from fig2mesh.batch.task import Task

if TYPE_CHECKING:
    from fig2mesh.batch.collections.rows import Row

LONGEST_NAME: Final = 60
"""Characters of a folder's name; file systems allow 255 bytes, and a character takes up to four."""

TAKEN: Final = ("tileset.json", "index.geojson", "index.gpkg", "figures.czml", "collection.json", "manifest.jsonl")
"""Files in the folder of the outputs, which no figure may be called."""


class Names:
    """Which names are taken, in a file that goes away by itself: a million of them take no memory."""

    def __init__(self) -> None:
        self._table = sqlite3.connect("")
        self._table.execute("create table names (name text primary key, row integer) without rowid")
        self._table.executemany("insert into names values (?, 0)", [(name.casefold(),) for name in TAKEN])

    def take(self, name: str, row: int) -> int | None:
        """Take a name for a row; the row that has it already, if any (0: it is ours)."""
        # Some file systems take Anna and anna for the same file.
        found = self._table.execute("select row from names where name = ?", (name.casefold(),)).fetchone()
        if found is not None:
            return int(found[0])
        self._table.execute("insert into names values (?, ?)", (name.casefold(), row))
        return None

    def close(self) -> None:
        """Let the file go."""
        self._table.close()


def tasks_of(rows: Iterable[Row]) -> Iterator[Task]:
    """Rows with names: the one that a row gives, else the stem of its picture, with a number where that is taken."""
    with closing(Names()) as names:
        for row in rows:
            yield _task(row, names)


def _task(row: Row, names: Names) -> Task:
    values, problem = dict(row.values), row.problem
    given = values.get("name")
    title = (
        str(given) if given is not None else PurePosixPath(str(values.get("figure", ""))).stem or f"row {row.number}"
    )
    wanted = safe_name(title)[:LONGEST_NAME].strip(".") or "figure"
    name, number = wanted, 1
    while (other := names.take(name, row.number)) is not None:
        if given is not None and problem is None:
            whose = f"also that of row {other}" if other else "that of a file of the batch"
            problem = f"its name {name} is {whose}; give each row a name of its own"
        number += 1
        name = f"{wanted}_{number}"
    return Task(row.number, row.where, name, title, values, problem)


def write_spool(tasks: Iterable[Task], path: Path) -> tuple[int, dict[str, int]]:
    """Write tasks to a file, one a line; returns their number, and in how many rows each unknown column has a value."""
    count = 0
    unknown: dict[str, int] = {}
    with path.open("w", encoding="utf-8") as stream:
        for task in tasks:
            stream.write(json.dumps(asdict(task), ensure_ascii=False) + "\n")
            count += 1
            for column in task.values:
                if not is_known(column) and (column in unknown or len(unknown) < 1000):
                    unknown[column] = unknown.get(column, 0) + 1
    return count, unknown


def read_spool(path: Path) -> Iterator[Task]:
    """The tasks in a file."""
    with path.open(encoding="utf-8") as stream:
        for line in stream:
            fields = json.loads(line)
            fields["values"] = {column: _value(value) for column, value in fields["values"].items()}
            yield Task(**fields)


def _value(value: object) -> object:
    return tuple(map(_value, value)) if isinstance(value, list) else value
