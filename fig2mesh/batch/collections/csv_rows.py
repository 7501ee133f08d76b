"""Rows of a CSV file (RFC 4180), as spreadsheets and GDAL write them.

The first line names the columns. The separator is the comma, semicolon or tab that makes `figure` one of the names.
UTF-8, or UTF-16 with a byte order mark. Numbers have a decimal point, even between semicolons: decimal commas would
have to be guessed for every option.
"""

from __future__ import annotations

import csv
import re
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import TextIOWrapper
from pathlib import Path

from exporters.text import LONE_SURROGATE
from fig2mesh.batch.collections.rows import (
    FIGURE,
    MAX_RECORD,
    MAX_TEXT,
    Row,
    check_columns,
    column_name,
    make_row,
    unnamed_value,
)
from fig2mesh.batch.collections.values import InvalidValue, shown
from fig2mesh.conversion.cells import ABSENT
from fig2mesh.errors import InputError

SEPARATORS = ",;\t"

UTF8 = "save the table as CSV UTF-8"
NO_TABLE = "give a table whose first line names the columns"

_SEPARATOR_LINE = re.compile(r'"?sep=([,;\t])"?\s*', re.IGNORECASE)
"""First line in which spreadsheets declare the separator."""


class _TooLong(Exception):
    """A row of more than `MAX_RECORD` characters."""


class _Lines:
    """Numbered lines of a text; those of the current row can be read again."""

    def __init__(self, path: Path, text: TextIOWrapper, encoding: str) -> None:
        self.path, self.text, self.encoding = path, text, encoding
        self.number = 0
        self._taken: list[str] = []
        self._again: deque[str] = deque()
        self._size = 0

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        line = self._again.popleft() if self._again else self._read()
        if not line:
            raise StopIteration
        self.number += 1
        self._taken.append(line)
        self._size += len(line)
        if self._size > MAX_RECORD:
            raise _TooLong
        return line

    def begin(self) -> int:
        """Begin a row; return the number of the line on which it starts."""
        self._taken.clear()
        self._size = 0
        return self.number + 1

    def back(self, keep: int = 1) -> None:
        """Push back all lines of this row but the first `keep`, and skip the rest of a line that is too long."""
        while self._taken and not self._again and not self._taken[-1].endswith(("\n", "\r")):
            rest = self._read()
            if not rest:
                break
            self._taken[-1] = rest
        self._again.extendleft(reversed(self._taken[keep:]))
        self.number -= len(self._taken[keep:])

    def _read(self) -> str:
        try:
            line = self.text.readline(MAX_RECORD + 1)
        except UnicodeDecodeError:
            finding = f"line {self.number + 1} or one after it is not {self.encoding}"
            raise InputError(self.path, finding, UTF8) from None
        except OSError as error:
            raise InputError(self.path, f"cannot be read ({error.strerror})", "check the disk") from None
        if not line.isascii() and (found := LONE_SURROGATE.search(line)):
            code = ord(found.group())
            what = f"byte 0x{code - 0xDC00:02x}" if self.encoding == "UTF-8" else f"code unit 0x{code:04x}"
            raise InputError(self.path, f"line {self.number + 1}: {what} is not {self.encoding}", UTF8)
        return line


@contextmanager
def _opened(path: Path) -> Iterator[_Lines]:
    with path.open("rb") as stream:
        head = stream.read(4)
        stream.seek(0)
        if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
            text = TextIOWrapper(stream, "utf-16", errors="surrogatepass", newline="")
            yield _Lines(path, text, "UTF-16")
        else:
            # Bytes that are not UTF-8 become lone surrogates, which identify their line.
            text = TextIOWrapper(stream, "utf-8-sig", errors="surrogateescape", newline="")
            yield _Lines(path, text, "UTF-8")


def csv_columns(path: Path) -> tuple[str, ...]:
    """Names of the columns, as in `Row.values`."""
    with _opened(path) as lines:
        return tuple(name for name in _header(path, lines)[0] if name)


def csv_rows(path: Path) -> Iterator[Row]:
    """Rows of a CSV file; lines without any value are skipped.

    A row with an unclosed quote has a problem; the next row starts on the following line.

    Raises InputError for files without a usable header, and for text that is not UTF-8, naming the line.
    """
    with _opened(path) as lines:
        names, separator = _header(path, lines)
        table = _table(lines, separator)
        number = 0
        while True:
            first = lines.begin()
            problem: InvalidValue | None = None
            cells: Sequence[str] = ()
            try:
                cells = next(table)
            except StopIteration:
                return
            except _TooLong:
                problem = InvalidValue(f"more than {MAX_RECORD:,} characters", "close its quotes, or shorten it")
                lines.back()
            except csv.Error as error:
                problem = _unquoted(error)
                lines.back()
            if problem is None:
                if not any(cell.strip() for cell in cells):
                    continue
                problem = _misfit(names, cells)
            number += 1
            # Cells of a row that does not fit its headings may be those of other columns.
            given = zip(names, cells, strict=False) if problem is None else ()
            # Only here: GeoJSON and GeoPackage have a null, and keep such texts.
            found = [(name, None if cell.strip() in ABSENT else cell) for name, cell in given if name]
            yield make_row(number, f"line {first}", found, problem)


def _table(lines: _Lines, separator: str) -> Iterator[list[str]]:
    return csv.reader(lines, delimiter=separator, skipinitialspace=separator != "\t", strict=True)


def _unquoted(error: csv.Error) -> InvalidValue:
    if "field larger" in str(error):
        return InvalidValue(f"a cell of more than {MAX_TEXT:,} characters", "close its quotes, or shorten it")
    if "unexpected end" in str(error):
        return InvalidValue("unclosed quote", "close it, and double quotes within quotes")
    return InvalidValue("quote in the middle of a cell", "double quotes within quotes")


def _misfit(names: Sequence[str], cells: Sequence[str]) -> InvalidValue | None:
    count = len(cells)
    while count > len(names) and not cells[count - 1].strip():
        count -= 1
    if count != len(names):
        remedy = (
            "quote cells that contain the separator" if count > len(names) else "give all cells, including empty ones"
        )
        return InvalidValue(f"{count} cells under {len(names)} headings", remedy)
    first = next((index for index, name in enumerate(names) if name), 0)
    for index, (name, cell) in enumerate(zip(names, cells, strict=False)):
        if name or not cell.strip():
            continue
        # Only leading columns hold numbers of rows.
        if index >= first or unnamed_value(cell):
            return InvalidValue(f"{shown(cell.strip())!r} under an empty heading", "name the column")
    return None


def _header(path: Path, lines: _Lines) -> tuple[list[str], str]:
    """Names of the columns, "" for columns without a name, and the separator."""
    separators = SEPARATORS
    try:
        while True:
            lines.begin()
            line = next(lines, "")
            if not line:
                raise InputError(path, "no header line", f"name the columns, with {FIGURE} among them")
            if declared := _SEPARATOR_LINE.fullmatch(line):
                separators = declared.group(1)
            elif line.strip():
                lines.back(keep=0)
                break
        tried = {separator: _names(lines, separator) for separator in separators}
        separator = max(tried, key=lambda each: (FIGURE in tried[each], len(tried[each])))
        if FIGURE not in tried[separator] and not all(tried.values()):
            raise InputError(path, "unclosed quote in the first line", "close it")
        lines.begin()
        next(_table(lines, separator))
    except _TooLong:
        raise InputError(path, f"first line longer than {MAX_RECORD:,} characters", NO_TABLE) from None
    names = tried[separator]
    check_columns(path, names)
    return names, separator


def _names(lines: _Lines, separator: str) -> list[str]:
    """Names of the columns if this is the separator; empty if its quotes are then invalid."""
    lines.begin()
    try:
        return [column_name(cell) for cell in next(_table(lines, separator))]
    except (csv.Error, StopIteration):
        return []
    finally:
        lines.back(keep=0)
