"""Rows of GeoJSON (RFC 7946): a FeatureCollection, or features one a line or record (RFC 8142), as a stream.

What is not needed is skipped without being kept: geometries other than points, members that the format does not know.
Coordinates are WGS 84 longitude, latitude and height above the ellipsoid; a `crs` member of the format of 2008 that
says otherwise is refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import ijson

from fig2mesh.batch.rows import (
    MAX_COLUMNS,
    MAX_ITEMS,
    MAX_NESTING,
    MAX_RECORD,
    MAX_TEXT,
    Point,
    Row,
    Unfit,
    column_name,
    fit,
    make_row,
    shown,
)
from fig2mesh.errors import InputError

Event = tuple[str, Any]
Events = Iterator[Event]

MAX_QUIET = 1 << 20
"""Bytes of a file without a new value in them: a longer text than any row may have, or blanks."""

MAX_LINE = 1 << 24
"""Bytes of a feature on a line of its own, with an outline of hundreds of thousands of vertices."""

MAX_DIGITS = 640
"""Digits in a row: the fewest that Python can be told to refuse (`sys.set_int_max_str_digits`). What it refuses is
not only no number: the parser of ijson in C (3.6) goes on with a null pointer after it."""

CHUNK = 1 << 16

BOM = b"\xef\xbb\xbf"
RECORD = b"\x1e"

SEQUENCES = (".geojsonl", ".geojsons", ".jsonl", ".ndjson")

OPEN = ("start_map", "start_array")
CLOSE = ("end_map", "end_array")

WGS84 = re.compile(
    r"(urn:ogc:def:crs:|https?://www\.opengis\.net/def/crs/)?(OGC[:/0-9.]+CRS84h?|EPSG[:/0-9.]+[:/]4326|EPSG:4326)",
    re.IGNORECASE,
)

OBJECT = Unfit("a value that is an object", "give text, a number, or a list of them")
DEEP = Unfit(f"lists nested deeper than {MAX_NESTING}", "flatten them")
LONG = Unfit(f"a list of more than {MAX_ITEMS:,} items", "shorten it")
TEXT = Unfit(f"more than {MAX_TEXT:,} characters", "give a shorter text")
TWICE = Unfit("given twice", "give it once")

JSON = "give valid JSON in UTF-8, with null for NaN"

BROKEN = (ijson.JSONError, ValueError, ArithmeticError)
"""What the parsers of ijson raise for bytes that are not JSON: ValueError for texts that are not Unicode,
ArithmeticError for exponents beyond all measure."""

_DIGITS = bytes(ord("0") if chr(code).isdecimal() and code < 128 else ord(" ") for code in range(256))
_TOO_MANY = b"0" * (MAX_DIGITS + 1)


class _NotJson(Exception):
    """The parser's finding, in one line."""


class _Source:
    """A file for ijson that stops where a single value would fill the memory."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._quiet = 0
        self._digits = b""

    def read(self, size: int = -1) -> bytes:
        data = self._stream.read(size)
        self._quiet += len(data)
        if self._quiet > MAX_QUIET + CHUNK:
            raise _NotJson(f"more than {MAX_QUIET:,} bytes without a new value")
        digits = self._digits + data.translate(_DIGITS)
        if _TOO_MANY in digits:
            raise _NotJson(f"a number of more than {MAX_DIGITS} digits")
        self._digits = digits[-MAX_DIGITS:]
        return data

    def events(self) -> Events:
        """Events of `ijson.basic_parse`; raises _NotJson."""
        try:
            for event in ijson.basic_parse(self, buf_size=CHUNK):
                self._quiet = 0
                yield event
        except BROKEN as error:
            found = error.args[0] if error.args else type(error).__name__
            text = found.decode("utf-8", "replace") if isinstance(found, bytes) else str(found)
            raise _NotJson(shown(text.partition("\n")[0].strip(), 100)) from None


@dataclass(slots=True)
class _Feature:
    """Members of a GeoJSON object that are of use, and what was wrong with them."""

    kind: object = None
    properties: dict[str, object] = field(default_factory=dict)
    geometry: Point | Unfit | None = None
    problem: Unfit | None = None
    seen: set[str] = field(default_factory=set)

    def row(self, number: int, where: str) -> Row:
        problem = self.problem
        if self.kind != "Feature" and problem is None:
            kind = "no type" if self.kind is None else f"type {shown(self.kind)}"
            problem = Unfit(f"{kind} where a Feature is expected", "give features")
        return make_row(number, where, self.properties.items(), problem, lambda: self.geometry)

    def member(self, key: str, events: Events) -> None:
        """Read the value of a member; those that are of no use are skipped."""
        event, value = next(events)
        if key not in ("type", "properties", "geometry"):
            _skip(events, event in OPEN)
            return
        if key in self.seen:
            self.problem = self.problem or TWICE.of(key)
        self.seen.add(key)
        if key == "type":
            self.kind = value if event == "string" else event
            _skip(events, event in OPEN)
        elif event == "start_map" and key == "properties":
            self.problem = _properties(events, self.properties) or self.problem
        elif event == "start_map":
            self.geometry = _geometry(events)
        elif event != "null":
            self.problem = self.problem or Unfit("no object", "give an object, or null").of(key)
            _skip(events, event in OPEN)


def geojson_rows(path: Path) -> Iterator[Row]:
    """The rows of a GeoJSON file: one a feature, its properties as columns.

    Broken JSON ends a FeatureCollection; where each feature has its own line or record, it is the problem of that row.

    Raises InputError for what is no GeoJSON, naming the feature.
    """
    try:
        with path.open("rb") as stream:
            head = stream.read(1 << 12)
            start = len(BOM) if head.startswith(BOM) else 0
            if head[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" in head:
                raise InputError(path, "UTF-16, or no text", "save it as UTF-8")
            stream.seek(start)
            if head[start:].lstrip().startswith(RECORD):
                yield from _sequence(_records(stream))
            elif _by_lines(path, stream, head):
                stream.seek(start)
                yield from _sequence(_lines(stream))
            else:
                stream.seek(start)
                yield from _document(path, stream, start)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the file and its disk") from None


def _by_lines(path: Path, stream: BinaryIO, head: bytes) -> bool:
    """Whether each line is a feature of its own: the first one is, or the suffix says so."""
    line = b""
    while line.isspace() or not line:
        line = stream.readline(MAX_LINE)
        if not line:
            break
    kind = None
    try:
        events = _Source(BytesIO(line)).events()
        if next(events, None) == ("start_map", None):
            feature = _Feature()
            for event, key in events:
                if event == "map_key":
                    feature.member(key, events)
                    if feature.kind not in (None, "Feature"):
                        break
            else:
                kind = feature.kind
    except (_NotJson, StopIteration):
        pass
    return kind == "Feature" or (path.suffix.lower() in SEQUENCES and b'"FeatureCollection"' not in head)


def _lines(stream: BinaryIO) -> Iterator[tuple[str, bytes | None]]:
    """Lines that are not blank, with their names; None for one that is too long."""
    number = 0
    while line := stream.readline(MAX_LINE):
        number += 1
        if len(line) == MAX_LINE and not line.endswith(b"\n"):
            while line and not line.endswith(b"\n"):
                line = stream.readline(CHUNK)
            yield f"line {number}", None
        elif not line.isspace():
            yield f"line {number}", line


def _records(stream: BinaryIO) -> Iterator[tuple[str, bytes | None]]:
    """Records, each after a record separator, with their names; None for one that is too long."""
    number = 0
    record = bytearray()
    while True:
        chunk = stream.read(CHUNK)
        parts = chunk.split(RECORD) if chunk else [b"", b""]
        for index, part in enumerate(parts):
            if index and (record and not record.isspace()):
                number += 1
                yield f"record {number}", bytes(record) if len(record) <= MAX_LINE else None
            if index:
                record.clear()
            # One byte too many is kept as the sign of it.
            record += part[: MAX_LINE + 1 - len(record)]
        if not chunk:
            return


def _sequence(records: Iterator[tuple[str, bytes | None]]) -> Iterator[Row]:
    for number, (where, record) in enumerate(records, start=1):
        if record is None:
            yield make_row(number, where, (), Unfit(f"more than {MAX_LINE:,} bytes", "simplify its geometry"))
            continue
        try:
            events = _Source(BytesIO(record)).events()
            feature = _item(events, next(events))
            for _ in events:
                pass
            row = feature.row(number, where)
        except _NotJson as error:
            row = make_row(number, where, (), Unfit(f"not JSON ({error})", JSON))
        yield row


def _document(path: Path, stream: BinaryIO, start: int) -> Iterator[Row]:
    """The features of a FeatureCollection, or the one that is the whole document."""
    events = _Source(stream).events()
    top = _Feature()
    number = 0
    try:
        if next(events) != ("start_map", None):
            raise InputError(path, "no JSON object", "give a GeoJSON FeatureCollection")
        for event, key in events:
            if event != "map_key":
                continue
            if key == "crs":
                _check_crs(path, _crs(events))
            elif key == "features" and key in top.seen:
                raise InputError(path, "two members features", "give one FeatureCollection")
            elif key == "features":
                if "crs" not in top.seen:
                    _check_crs(path, _later_crs(path, start))
                if next(events)[0] != "start_array":
                    raise InputError(path, "its features are no list", "give a GeoJSON FeatureCollection")
                for event, value in events:
                    if event == "end_array":
                        break
                    feature = _item(events, (event, value))
                    number += 1
                    yield feature.row(number, f"feature {number}")
            else:
                top.member(key, events)
                if key == "type" and top.kind not in ("FeatureCollection", "Feature"):
                    raise InputError(path, f"type {shown(top.kind)}", "give a GeoJSON FeatureCollection")
            if key in ("crs", "features"):
                top.seen.add(key)
    except _NotJson as error:
        raise InputError(path, f"{f'after feature {number}, ' if number else ''}not JSON ({error})", JSON) from None
    if "features" not in top.seen:
        if top.kind != "Feature":
            raise InputError(path, "no features", "give a GeoJSON FeatureCollection")
        yield top.row(1, "feature 1")


def _item(events: Events, first: Event) -> _Feature:
    """A feature, from the first event of a value."""
    feature = _Feature()
    event, value = first
    if event != "start_map":
        _skip(events, event in OPEN)
        feature.problem = Unfit("no object where a Feature is expected", "give features")
        return feature
    for event, value in events:
        if event == "end_map":
            break
        feature.member(value, events)
    return feature


def _properties(events: Events, found: dict[str, object]) -> Unfit | None:
    """Read the members of an object into values by column; what is wrong with it as a whole, or None."""
    problem: Unfit | None = None
    room = MAX_RECORD
    for event, key in events:
        if event == "end_map":
            break
        event, value = next(events)
        room -= len(key)
        if problem is not None or room < 0 or len(found) >= MAX_COLUMNS:
            if problem is None:
                much = f"{MAX_COLUMNS:,} properties" if room >= 0 else f"{MAX_RECORD:,} characters in its properties"
                problem = Unfit(f"more than {much}", "leave some out")
            _skip(events, event in OPEN)
            continue
        if event == "start_map":
            _skip(events, True)
            value = OBJECT
        elif event == "start_array":
            value = _list(events, room)
            room -= sum(_length(item) for item in value) if isinstance(value, tuple) else 0
        elif event == "string":
            room -= len(value)
            value = value if len(value) <= MAX_TEXT else TEXT
        name = column_name(key)
        if not name:
            value = Unfit("a property without a name", "name it") if value is not None else None
        found[name] = TWICE if name in found else value
    return problem


def _length(value: object) -> int:
    if isinstance(value, tuple):
        return sum(map(_length, value))
    return len(value) if isinstance(value, str) else 0


def _list(events: Events, room: int = MAX_RECORD) -> tuple[object, ...] | Unfit:
    """The rest of a list with the lists in it; room: characters that its texts may have."""
    stack: list[list[object]] = [[]]
    count = 0
    for event, value in events:
        if event == "end_array":
            done = tuple(stack.pop())
            if not stack:
                return done
            stack[-1].append(done)
            continue
        count += 1
        bad = OBJECT if event == "start_map" else LONG if count > MAX_ITEMS else None
        if event == "start_array":
            bad = bad or (DEEP if len(stack) >= MAX_NESTING else None)
        elif event == "string":
            room -= len(value)
            bad = bad or (TEXT if len(value) > MAX_TEXT or room < 0 else None)
        if bad is not None:
            _skip(events, len(stack) + (event in OPEN))
            return bad
        if event == "start_array":
            stack.append([])
        else:
            stack[-1].append(value)
    raise AssertionError("a list that does not end is an error of the parser")


def _skip(events: Events, depth: int) -> None:
    """Leave as many lists and objects, with all that is in them."""
    if depth:
        for event, _ in events:
            depth += (event in OPEN) - (event in CLOSE)
            if not depth:
                return


def _geometry(events: Events) -> Point | Unfit | None:
    """The point of a geometry object; None: it is empty."""
    kind: object = None
    coordinates: object = None
    for event, key in events:
        if event == "end_map":
            break
        event, value = next(events)
        if key == "coordinates" and event == "start_array":
            coordinates = _list(events)
        else:
            _skip(events, event in OPEN)
            if key == "type":
                kind = value
    if kind == "MultiPoint" and isinstance(coordinates, tuple) and len(coordinates) == 1:
        coordinates = coordinates[0]
    elif kind != "Point":
        return Unfit(f"its geometry is a {shown(kind)}", "give a Point, or columns lon and lat")
    if coordinates == ():
        return None
    if not isinstance(coordinates, tuple) or len(coordinates) < 2:
        return Unfit("a point without two coordinates", "give longitude and latitude")
    numbers = [fit(each) for each in coordinates[:3]]
    if not all(isinstance(each, int | float) and not isinstance(each, bool) for each in numbers):
        return Unfit(f"a point at {shown(coordinates)}", "give finite numbers")
    return Point(*(float(each) for each in numbers))  # type: ignore[arg-type]


def _crs(events: Events) -> str | None:
    """Name in the value of a `crs` member (GeoJSON of 2008); "": there is none; None: the value is null."""
    event, _ = next(events)
    if event == "null":
        return None
    name = ""
    keys = [""] if event in OPEN else []
    while keys:
        event, value = next(events)
        if event == "map_key":
            keys[-1] = value
        elif event in OPEN:
            keys.append("")
            if len(keys) > MAX_NESTING:
                _skip(events, len(keys))
                break
        elif event in CLOSE:
            keys.pop()
        elif keys == ["properties", "name"]:
            name = str(value)
    return name


def _later_crs(path: Path, start: int) -> str | None:
    """The same, of a member that may come after the features, whose places it changes; None: there is none."""
    with path.open("rb") as stream:
        tail = b""
        while chunk := stream.read(CHUNK):
            if b'"crs"' in tail + chunk:
                break
            tail = chunk[-8:]
        else:
            return None
        stream.seek(start)
        events = _Source(stream).events()
        next(events)
        for event, key in events:
            if event == "map_key" and key == "crs":
                return _crs(events)
            if event == "map_key":
                _skip(events, next(events)[0] in OPEN)
    return None


def _check_crs(path: Path, name: str | None) -> None:
    if name is not None and not WGS84.fullmatch(name):
        finding = f"its crs is {shown(name, 60) or 'unknown'}, not WGS 84"
        raise InputError(path, finding, "export it in WGS 84 (RFC 7946)")
