"""Spool for rows of a table whose columns are known only after the last row; memory holds one chunk of rows."""

from __future__ import annotations

import json
import pickle
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.placed_figure import Value

CHUNK_ROWS = 4096
"""Rows in memory at a time, below 10 MB at about 1 kB each; a database commits once per chunk."""

IN_MEMORY_BYTES = 1 << 22
"""Size up to which chunks are kept in memory; larger ones are written to disk."""

KINDS: tuple[type, ...] = (bool, int, float, str)
"""Column types, narrowest first; each can hold the values of those before it."""

Rows = list[tuple[Any, dict[str, Value]]]


class TableSpool:
    """Rows in order, stored in chunks on disk, and the columns of all of them.

    columns : name → type, in the order of first occurrence; the narrowest type that holds every value exactly. A
        column of numbers and text is text, and so is one of only None. So is one of floats and an integer that float64
        would round, as 2^53 + 1; without floats it is a column of integers, even with missing values. Among numbers,
        booleans are 1 and 0. Names that differ only in case are one column, as in SQL; the first spelling is used
    """

    def __init__(self, folder: Path, columns: Mapping[str, type] | None = None) -> None:
        """folder : of the temporary file; columns : columns with a fixed type, present even without rows."""
        self.rows = 0
        self._kinds: dict[str, int] = {name: KINDS.index(kind) for name, kind in (columns or {}).items()}
        self._fixed = frozenset(self._kinds)
        self._rounded: set[str] = set()
        """Columns with an integer that float64 cannot represent; Python compares the two without rounding."""
        self._columns: dict[str, str] = {}
        self._spellings = {name.casefold(): name for name in self._kinds}
        self._chunk: Rows = []
        self._file = tempfile.SpooledTemporaryFile(max_size=IN_MEMORY_BYTES, dir=str(folder))  # noqa: SIM115  closed by __exit__

    def __enter__(self) -> TableSpool:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    @property
    def columns(self) -> dict[str, type]:
        """See the class."""
        return {name: self._column_kind(name, kind) for name, kind in self._kinds.items()}

    def _column_kind(self, name: str, kind: int) -> type:
        if kind < 0 or (KINDS[kind] is float and name in self._rounded):
            return str
        return KINDS[kind]

    def add(self, key: Any, values: Mapping[str, Value]) -> None:
        """Append a row; key : data of the row besides the columns, such as its geometry."""
        row: dict[str, Value] = {}
        for name, value in values.items():
            column = self._columns.get(name)
            if column is None:
                column = self._columns[name] = self._spellings.setdefault(name.casefold(), name)
            row[column] = value
            if column not in self._fixed:
                self._kinds[column] = max(self._kinds.get(column, -1), _kind(value))
                if type(value) is int and float(value) != value:
                    self._rounded.add(column)
        self._chunk.append((key, row))
        self.rows += 1
        if len(self._chunk) == CHUNK_ROWS:
            self._flush()

    def chunks(self) -> Iterator[Rows]:
        """Iterate over the rows in order, in chunks, after all of them are added."""
        self._flush()
        end = self._file.tell()
        self._file.seek(0)
        while self._file.tell() < end:
            yield pickle.load(self._file)

    def _flush(self) -> None:
        if self._chunk:
            pickle.dump(self._chunk, self._file, pickle.HIGHEST_PROTOCOL)
            self._chunk = []


def _kind(value: Value) -> int:
    """Index in KINDS of the narrowest type that holds a value; -1 for None, which any holds."""
    return -1 if value is None else KINDS.index(type(value))


def column_arrays(values: list[Value], kind: type) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """Convert a column to an array, (N,) bool, int64, float64 or object of str, and a mask of its None values.

    The mask is None for text, where the array itself contains None, and for a column without None. Numbers in a column
    of text are formatted as in JSON, without loss of digits.
    """
    if kind is str:
        text = [value if value is None or isinstance(value, str) else json.dumps(value) for value in values]
        return np.array(text, dtype=object), None
    empty = np.array([value is None for value in values], dtype=np.bool_)
    dtype = {bool: np.bool_, int: np.int64, float: np.float64}[kind]
    return np.array([0 if value is None else value for value in values], dtype=dtype), empty if empty.any() else None
