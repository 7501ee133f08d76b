"""A GeoJSON feature (RFC 7946), from the events of a streaming parser.

Geometries other than points, and foreign members, are skipped without being stored.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import ijson

from fig2mesh.batch.collections.rows import (
    MAX_COLUMNS,
    MAX_ITEMS,
    MAX_NESTING,
    MAX_RECORD,
    MAX_TEXT,
    Row,
    column_name,
    fit,
    make_row,
    unnamed_value,
)
from fig2mesh.batch.collections.values import InvalidValue, Point, shown

Event = tuple[str, Any]
Events = Iterator[Event]

MAX_QUIET = 1 << 20
"""Maximum number of bytes without a new value: more is a longer text than any row may have, or blanks."""

MAX_DIGITS = 640
"""Maximum number of consecutive digits: the lowest limit that `sys.set_int_max_str_digits` accepts. Integers over
Python's limit must not reach the C parser of ijson (3.6), which continues with a null pointer after them."""

CHUNK = 1 << 16

OPEN = ("start_map", "start_array")
CLOSE = ("end_map", "end_array")

OBJECT = InvalidValue("an object as a value", "give text, a number, or a list of these")
DEEP = InvalidValue(f"lists nested deeper than {MAX_NESTING}", "flatten them")
LONG = InvalidValue(f"a list of more than {MAX_ITEMS:,} items", "shorten it")
TEXT = InvalidValue(f"more than {MAX_TEXT:,} characters", "give a shorter text")
TWICE = InvalidValue("given twice", "give it once")

BROKEN = (ijson.JSONError, ValueError, ArithmeticError)
"""Exceptions of the parsers of ijson for invalid JSON: ValueError for texts that are not Unicode, ArithmeticError for
exponents that are too large."""

_DIGITS = bytes(ord("0") if chr(code).isdecimal() and code < 128 else ord(" ") for code in range(256))
_TOO_MANY = b"0" * (MAX_DIGITS + 1)


class NotJson(Exception):
    """Invalid JSON; the message is the parser's finding, in one line."""


def events_of(stream: BinaryIO) -> Events:
    """Events of ijson, with limits on the size of values. Raises NotJson after the events before the error."""
    found = ijson.sendable_list()
    parser = ijson.basic_parse_coro(found)
    quiet, digits = 0, b""
    try:
        while data := stream.read(CHUNK):
            quiet += len(data)
            if quiet > MAX_QUIET + CHUNK:
                raise NotJson(f"more than {MAX_QUIET:,} bytes without a new value")
            digits += data.translate(_DIGITS)
            if _TOO_MANY in digits:
                raise NotJson(f"a number of more than {MAX_DIGITS} digits")
            digits = digits[-MAX_DIGITS:]
            fault = _fault(lambda data=data: parser.send(data))  # type: ignore[misc]
            if found:
                quiet = 0
                yield from found
                found.clear()
            if fault:
                raise NotJson(fault)
        fault = _fault(parser.close)
        yield from found
        if fault:
            raise NotJson(fault)
    finally:
        # A parser abandoned in the middle of a document reports an error, on stderr unless it is closed here.
        _fault(parser.close)


def _fault(act: Callable[[], object]) -> str | None:
    """Error of a call of a parser, in one line, or None."""
    try:
        act()
    except BROKEN as error:
        found = error.args[0] if error.args else type(error).__name__
        text = found.decode("utf-8", "replace") if isinstance(found, bytes) else str(found)
        return shown(text.partition("\n")[0].strip(), 100) or type(error).__name__
    except StopIteration:
        pass
    return None


@dataclass(slots=True)
class Feature:
    """Members of a GeoJSON object that are used, and the first problem with them."""

    kind: object = None
    properties: dict[str, object] = field(default_factory=dict)
    geometry: Point | InvalidValue | None = None
    problem: InvalidValue | None = None
    members: set[str] = field(default_factory=set)

    def row(self, number: int, where: str) -> Row:
        problem = self.problem
        if self.kind != "Feature" and problem is None:
            kind = "no type" if self.kind is None else f"type {shown(self.kind)}"
            problem = InvalidValue(f"{kind} where a Feature is expected", "give features")
        return make_row(number, where, self.properties.items(), problem, lambda: self.geometry)

    def member(self, key: str, events: Events) -> None:
        """Read the value of a member; unused members are skipped."""
        event, value = next(events)
        if key not in ("type", "properties", "geometry"):
            skip(events, event in OPEN)
            return
        if key in self.members:
            self.problem = self.problem or TWICE.in_column(key)
        self.members.add(key)
        if key == "type":
            self.kind = value if event == "string" else event
            skip(events, event in OPEN)
        elif event == "start_map" and key == "properties":
            self.problem = _properties(events, self.properties) or self.problem
        elif event == "start_map":
            self.geometry = _geometry(events)
        elif event != "null":
            self.problem = self.problem or InvalidValue("not an object", "give an object, or null").in_column(key)
            skip(events, event in OPEN)


def read_feature(events: Events, first: Event) -> Feature:
    """Read a feature; first : first event of its value."""
    feature = Feature()
    event, value = first
    if event != "start_map":
        skip(events, event in OPEN)
        feature.problem = InvalidValue("not an object where a Feature is expected", "give features")
        return feature
    for event, value in events:
        if event == "end_map":
            break
        feature.member(value, events)
    return feature


def _properties(events: Events, found: dict[str, object]) -> InvalidValue | None:
    """Read the members of an object into `found`, by column; return the problem of the whole object, or None."""
    problem: InvalidValue | None = None
    room = MAX_RECORD
    for event, key in events:
        if event == "end_map":
            break
        event, value = next(events)
        room -= len(key)
        if problem is not None or room < 0 or len(found) >= MAX_COLUMNS:
            if problem is None:
                much = f"{MAX_COLUMNS:,} properties" if room >= 0 else f"{MAX_RECORD:,} characters in its properties"
                problem = InvalidValue(f"more than {much}", "leave some out")
            skip(events, event in OPEN)
            continue
        if event == "start_map":
            skip(events, True)
            value = OBJECT
        elif event == "start_array":
            value = _list(events, room)
            room -= sum(_length(item) for item in value) if isinstance(value, tuple) else 0
        elif event == "string":
            room -= len(value)
            value = value if len(value) <= MAX_TEXT else TEXT
        name = column_name(key)
        if not name:
            unnamed = value is not None and not (key.strip() and unnamed_value(value) is None)
            value = InvalidValue("property without a name", "name it") if unnamed else None
        found[name] = TWICE if name in found else value
    return problem


def _length(value: object) -> int:
    if isinstance(value, tuple):
        return sum(map(_length, value))
    return len(value) if isinstance(value, str) else 0


def _list(events: Events, room: int = MAX_RECORD) -> tuple[object, ...] | InvalidValue:
    """Read the rest of a list, with nested lists; room : maximum number of characters of its texts."""
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
            skip(events, len(stack) + (event in OPEN))
            return bad
        if event == "start_array":
            stack.append([])
        else:
            stack[-1].append(value)
    raise AssertionError("the parser must report lists that do not end")


def skip(events: Events, depth: int) -> None:
    """Skip the rest of `depth` nested lists and objects."""
    if depth:
        for event, _ in events:
            depth += (event in OPEN) - (event in CLOSE)
            if not depth:
                return


def _geometry(events: Events) -> Point | InvalidValue | None:
    """Point of a geometry object; None if it is empty."""
    kind: object = None
    coordinates: object = None
    for event, key in events:
        if event == "end_map":
            break
        event, value = next(events)
        if key == "coordinates" and event == "start_array":
            coordinates = _list(events)
        else:
            skip(events, event in OPEN)
            if key == "type":
                kind = value
    if kind == "MultiPoint" and isinstance(coordinates, tuple) and len(coordinates) == 1:
        coordinates = coordinates[0]
    elif kind != "Point":
        return InvalidValue(f"its geometry is a {shown(kind)}", "give a Point, or columns lon and lat")
    if coordinates == ():
        return None
    if not isinstance(coordinates, tuple) or len(coordinates) < 2:
        return InvalidValue("point with fewer than two coordinates", "give longitude and latitude")
    numbers = [fit(each) for each in coordinates[:3]]
    if not all(isinstance(each, int | float) and not isinstance(each, bool) for each in numbers):
        return InvalidValue(f"point at {shown(coordinates)}", "give finite numbers")
    return Point(*(float(each) for each in numbers))  # type: ignore[arg-type]
