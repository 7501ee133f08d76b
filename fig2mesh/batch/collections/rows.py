"""Rows of a collection, whatever kind of file they come from, and their permitted values.

Names of columns are lower case and stripped, and `-` counts as `_`: `height-m` and `Height_M` are one name.
`longitude` and `lng` are read as `lon`, `latitude` as `lat`; `x` and `y` are pixels, never degrees. Texts are
stripped; empty ones count as absent. `lon`, `lat`, `x` and `y` are numbers in every kind of file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import TypeAlias

from fig2mesh.errors import InputError

Value: TypeAlias = "str | int | float | bool | tuple[Value, ...]"

FIGURE = "figure"

SYNONYMS = {"longitude": "lon", "lng": "lon", "latitude": "lat"}

NUMBERS = ("lon", "lat", "x", "y")
"""Columns that are numbers in every kind of file, even where they are written as text."""

PATHS = ("figure", "map")
"""Columns that must be texts if present."""

PLACES = ("lon", "lat", "map")
"""Columns of a place. A row that has one of them does not use its geometry."""

MAX_ROWS = 1_000_000
"""More figures than one tileset or index is useful for: a year of work at thirty seconds each."""

MAX_COLUMNS = 1_000
"""Half of the number that SQLite allows in a table; real tables have far fewer."""

MAX_TEXT = 1 << 16
"""Characters of a value: paths, names, attributions and descriptions are far shorter."""

MAX_RECORD = 1 << 20
"""Characters of all values of a row: a few of the longest texts."""

MAX_NESTING = 8
"""Depth of nested lists; options need one level, coordinates of any geometry five."""

MAX_ITEMS = 1_000
"""Items of a list, including those of nested lists; options need four."""

MAX_INTEGER = 1 << 64
"""Identifiers of 64 bits are the largest integers that programs write."""

SHOWN = 40
"""Characters of a value in messages."""

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?", re.ASCII)
_SURROGATE = re.compile("[\ud800-\udfff]")


@dataclass(frozen=True, slots=True)
class Row:
    """One figure of a collection.

    number : counted from 1 as the user counts rows of data
    where : location in the file: "line 12" (on which it starts), "feature 3", "fid 7"
    values : by column; absent, empty and null ones are left out
    problem : why it cannot be used, "finding; remedy" in one line; None if it is valid. With a problem, the values are
        those that could be read
    """

    number: int
    where: str
    values: Mapping[str, Value]
    problem: str | None = None


@dataclass(frozen=True, slots=True)
class Point:
    """Location of a geometry: WGS 84 degrees; altitude in metres, None where it has none."""

    lon: float
    lat: float
    altitude: float | None = None


@dataclass(frozen=True, slots=True)
class InvalidValue:
    """Stands in for a value, geometry or row that cannot be used."""

    finding: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.finding}; {self.remedy}"

    def in_column(self, name: str) -> InvalidValue:
        """The same problem, with the name of its column."""
        return InvalidValue(f"{shown(name)}: {self.finding}", self.remedy)


def shown(value: object, most: int = SHOWN) -> str:
    """A value as text for messages: short, and always in one line."""
    text = value if isinstance(value, str) else repr(value)
    text = text if len(text) <= most else text[: most - 1] + "…"
    return text if text.isprintable() else repr(text)[1:-1]


def column_name(text: str) -> str:
    """Name of a column, normalised as in `Row.values`."""
    name = text.strip().lower().replace("-", "_")
    return SYNONYMS.get(name, name)


def check_columns(source: object, names: Sequence[str]) -> None:
    """Raise InputError for invalid columns; names : from `column_name`, "" for a column without a name."""
    if len(names) > MAX_COLUMNS:
        raise InputError(source, f"{len(names):,} columns", f"give at most {MAX_COLUMNS:,}")
    for name in names:
        if "\0" in name:
            raise InputError(source, "NUL character in the first line", "give a text file, as CSV UTF-8")
    if FIGURE not in names:
        listed = shown(", ".join(filter(None, names)), 200)
        raise InputError(source, f"no column {FIGURE} among {listed}", f"name the column with the pictures {FIGURE}")
    known = set()
    for name in filter(None, names):
        if name in known:
            raise InputError(source, f"two columns named {shown(name)}", "remove or rename one of them")
        known.add(name)


def fit_text(text: str) -> str | InvalidValue | None:
    """A text, stripped; None if nothing is left of it."""
    if len(text) > MAX_TEXT:
        return InvalidValue(f"more than {MAX_TEXT:,} characters", "give a shorter text")
    text = text.strip()
    if not text.isascii() and _SURROGATE.search(text):
        return InvalidValue("bytes that are not UTF-8", "save the text as UTF-8")
    if "\0" in text:
        return InvalidValue("NUL character", "remove it")
    return text or None


def fit(value: object) -> Value | InvalidValue | None:
    """A value, checked: finite, not too long, without objects in it."""
    if isinstance(value, str):
        return fit_text(value)
    if value is None or isinstance(value, bool) or isinstance(value, InvalidValue):  # noqa: SIM101 (twice as fast)
        return value
    if isinstance(value, int):
        return value if abs(value) <= MAX_INTEGER else InvalidValue("integer of more than 64 bits", "write it as text")
    if isinstance(value, float | Decimal):
        number = float(value)
        return number if math.isfinite(number) else InvalidValue("not a finite number", "leave it empty")
    if isinstance(value, tuple):
        items = []
        for item in map(fit, value):
            if item is None:
                return InvalidValue("empty item in a list", "fill the list, or leave it out")
            if isinstance(item, InvalidValue):
                return item
            items.append(item)
        return tuple(items) or None
    return InvalidValue(f"value of type {type(value).__name__}", "give text or a number")


def _number(value: Value) -> float | InvalidValue:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if isinstance(value, str):
        if _NUMBER.fullmatch(value):
            number = float(value)
            return number if math.isfinite(number) else InvalidValue("not a finite number", "leave it empty")
        if _NUMBER.fullmatch(value.replace(",", ".")):
            return InvalidValue(f"{shown(value)!r} has a comma", "write a decimal point")
    return InvalidValue(f"{shown(value)!r} is not a number", "give a number with a decimal point")


def make_row(
    number: int,
    where: str,
    found: Iterable[tuple[str, object]],
    problem: InvalidValue | None = None,
    point: Callable[[], Point | InvalidValue | None] = lambda: None,
) -> Row:
    """Make a row from the values that a reader found in a file.

    found : values with the names of their columns, from `column_name`
    problem : found by the reader itself; of several problems the first is reported
    point : returns the location of its geometry; called only if the values name no place
    """
    values: dict[str, Value] = {}
    for name, raw in found:
        value = fit(raw)
        if value is None:
            continue
        if name in NUMBERS and not isinstance(value, InvalidValue):
            value = _number(value)
        elif name in PATHS and not isinstance(value, str | InvalidValue):
            value = InvalidValue(f"{shown(value)} is not a path", "give the path of a file as text")
        if isinstance(value, InvalidValue):
            problem = problem or value.in_column(name)
        else:
            values[name] = value
    if problem is None and not any(name in values for name in PLACES):
        place = point()
        if isinstance(place, InvalidValue):
            problem = place
        elif place is not None:
            values.update(lon=place.lon, lat=place.lat)
            if place.altitude is not None:
                values.setdefault("altitude", place.altitude)
    if problem is None and FIGURE not in values:
        problem = InvalidValue(f"no {FIGURE}", f"give the path of its picture as {FIGURE}")
    return Row(number, where, values, None if problem is None else str(problem))
