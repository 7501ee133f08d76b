"""Rows of a collection, whatever kind of file they come from, and their permitted values.

Names of columns are lower case and stripped, and `-` counts as `_`: `height-m` and `Height_M` are one name.
Synonyms of `lon` and `lat` are those of `SYNONYMS`; `x` and `y` are pixels, never degrees. Texts are stripped; empty
ones count as absent, and in CSV so do `nan`, `NULL` and the like, see `fig2mesh.conversion.cells.ABSENT`. `lon`, `lat`,
`x` and `y` are numbers in every kind of file. A column of WKT is the place of a row that has no other.
"""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import TypeAlias

from exporters.text import LONE_SURROGATE
from fig2mesh.batch.collections.values import InvalidValue, Point, shown
from fig2mesh.batch.collections.wkt import WKT_COLUMNS, is_geometry, wkt_point
from fig2mesh.conversion.cells import NotNumber, number_of
from fig2mesh.errors import InputError

Value: TypeAlias = "str | int | float | bool | tuple[Value, ...]"

log = logging.getLogger(__name__)

FIGURE = "figure"

SYNONYMS = {
    "longitude": "lon",
    "lng": "lon",
    "lon_deg": "lon",
    "decimallongitude": "lon",
    "latitude": "lat",
    "lat_deg": "lat",
    "decimallatitude": "lat",
}

NUMBERS = ("lon", "lat", "x", "y")
"""Columns that are numbers in every kind of file, even where they are written as text."""

NOT_AVAILABLE = ("NA", "N/A", "#N/A", "n/a", "-", "?")
"""Texts that count as absent in `NUMBERS`; in other columns they may have a meaning, as the country NA has."""

PATHS = ("figure", "map")
"""Columns that must be texts if present."""

PLACES = ("lon", "lat", "lonlat", "map")
"""Columns of a place. A row that has one of them does not use its geometry."""

MAX_APART_DEG = 0.01
"""Difference of the columns `lon` and `lat` from a geometry that rounded columns may have."""

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

_UNNAMED = re.compile(r"unnamed: [0-9]+([._][0-9]+)*(_level_[0-9]+)?")


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


def column_name(text: str) -> str:
    """Name of a column, normalised as in `Row.values`."""
    name = text.strip().lower().replace("-", "_")
    # What pandas calls a column that had no name when it read it.
    return "" if _UNNAMED.fullmatch(name) else SYNONYMS.get(name, name)


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
    if not text.isascii() and LONE_SURROGATE.search(text):
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
    try:
        return number_of(str(value), shown(value))
    except NotNumber as error:
        return InvalidValue(error.finding, error.remedy)


def unnamed_value(value: object) -> InvalidValue | None:
    """Problem of a value without the name of a column; none with row numbers, which pandas and R write by default."""
    if value is None or re.fullmatch(r"\s*[0-9]*(\.0)?\s*", str(value)):
        return None
    return InvalidValue(f"{shown(value)!r} under an empty heading", "name the column")


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
    point : returns the location of its geometry; columns of a place come before it, with a warning where they
        contradict it
    """
    values: dict[str, Value] = {}
    for name, raw in _with_long(found):
        value = fit(raw)
        if value is None or (name in NUMBERS and value in NOT_AVAILABLE):
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
        place = point() or _geometry_in(values)
        if isinstance(place, InvalidValue):
            problem = place
        elif place is not None:
            values.update(lon=place.lon, lat=place.lat)
            if place.altitude is not None:
                values.setdefault("altitude", place.altitude)
    elif problem is None and "lon" in values and "lat" in values and (apart := _contradiction(values, point())):
        log.warning("%s: %s; the columns count", where, apart)
    if problem is None and FIGURE not in values:
        problem = InvalidValue(f"no {FIGURE}", f"give the path of its picture as {FIGURE}")
    return Row(number, where, values, None if problem is None else str(problem))


def _contradiction(values: dict[str, Value], place: Point | InvalidValue | None) -> str | None:
    """Finding about a geometry that was moved while the columns `lon` and `lat` were not, or the reverse."""
    columns = values["lon"], values["lat"]
    if not isinstance(place, Point) or not all(isinstance(each, int | float) for each in columns):
        return None
    lon, lat = (float(each) for each in columns if isinstance(each, int | float))
    if abs((lon - place.lon + 180) % 360 - 180) <= MAX_APART_DEG and abs(lat - place.lat) <= MAX_APART_DEG:
        return None
    return f"columns lon and lat say {lon:g} {lat:g}, but its geometry is at {place.lon:g} {place.lat:g}"


def _with_long(found: Iterable[tuple[str, object]]) -> Iterable[tuple[str, object]]:
    """Values of a row; `long` beside `lat` is its longitude, and by itself a column like any other."""
    pairs = list(found)
    names = {name for name, _ in pairs}
    beside = "lat" in names and "lon" not in names
    return [("lon" if beside and name == "long" else name, value) for name, value in pairs]


def _geometry_in(values: dict[str, Value]) -> Point | InvalidValue | None:
    """Point of the first column of geometries in a row, which is removed from its values; None without one."""
    for name in WKT_COLUMNS:
        text = values.get(name)
        if isinstance(text, str) and (name == "wkt" or is_geometry(text)):
            place = wkt_point(text)
            if isinstance(place, InvalidValue):
                return place.in_column(name)
            del values[name]
            return place
    return None
