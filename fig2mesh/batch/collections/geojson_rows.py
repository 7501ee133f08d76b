"""Rows of GeoJSON (RFC 7946): a FeatureCollection, or one feature per line or record (RFC 8142), as a stream.

Geometries other than points, and foreign members, are skipped without being stored. Coordinates are WGS 84 longitude,
latitude and height above the ellipsoid; files with another `crs` member (GeoJSON of 2008) are rejected.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from fig2mesh.batch.collections.geojson_feature import (
    CHUNK,
    CLOSE,
    OPEN,
    Events,
    Feature,
    NotJson,
    events_of,
    read_feature,
    skip,
)
from fig2mesh.batch.collections.rows import MAX_NESTING, Row, make_row
from fig2mesh.batch.collections.values import InvalidValue, shown
from fig2mesh.errors import InputError

MAX_LINE = 1 << 24
"""Maximum bytes of a feature on a line of its own: enough for an outline of hundreds of thousands of vertices."""

BOM = b"\xef\xbb\xbf"
RECORD = b"\x1e"

SEQUENCES = (".geojsonl", ".geojsons", ".jsonl", ".ndjson")

WGS84 = re.compile(
    r"(urn:ogc:def:crs:|https?://www\.opengis\.net/def/crs/)?(OGC[:/0-9.]+CRS84h?|EPSG[:/0-9.]+[:/]4326|EPSG:4326)",
    re.IGNORECASE,
)

JSON = "give valid JSON in UTF-8, with null for NaN"


def geojson_rows(path: Path) -> Iterator[Row]:
    """Rows of a GeoJSON file: one per feature, with its properties as columns.

    Broken JSON ends a FeatureCollection; where each feature has its own line or record, it is the problem of that row.

    Raises InputError for invalid GeoJSON, naming the feature.
    """
    try:
        with path.open("rb") as stream:
            head = stream.read(1 << 12)
            start = len(BOM) if head.startswith(BOM) else 0
            if head[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" in head:
                raise InputError(path, "UTF-16, or not a text file", "save it as UTF-8")
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
    """Whether each line is a feature of its own: the first two are not parts of one document, or by the suffix."""
    lines: list[bytes] = []
    while len(lines) < 2 and (line := stream.readline(MAX_LINE)):
        if line := line.strip():
            lines.append(line)
    if len(lines) == 2 and lines[0][:1] == b"{" and lines[0][-1:] == b"}" and lines[1][:1] not in (b",", b"]", b"}"):
        return True
    return path.suffix.lower() in SEQUENCES and b'"FeatureCollection"' not in head


def _lines(stream: BinaryIO) -> Iterator[tuple[str, bytes | None]]:
    """Lines that are not blank, with their names; None for a line that is too long."""
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
    """Records, each after a record separator, with their names; None for a record that is too long."""
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
            # One excess byte is kept, to mark a record that is too long.
            record += part[: MAX_LINE + 1 - len(record)]
        if not chunk:
            return


def _sequence(records: Iterator[tuple[str, bytes | None]]) -> Iterator[Row]:
    for number, (where, record) in enumerate(records, start=1):
        if record is None:
            yield make_row(number, where, (), InvalidValue(f"more than {MAX_LINE:,} bytes", "simplify its geometry"))
            continue
        try:
            events = events_of(BytesIO(record))
            feature = read_feature(events, next(events))
            for _ in events:
                pass
            row = feature.row(number, where)
        except NotJson as error:
            row = make_row(number, where, (), InvalidValue(f"not JSON ({error})", JSON))
        yield row


def _document(path: Path, stream: BinaryIO, start: int) -> Iterator[Row]:
    """Rows of a FeatureCollection, or of a single Feature."""
    events = events_of(stream)
    top = Feature()
    number = 0
    try:
        if next(events) != ("start_map", None):
            raise InputError(path, "not a JSON object", "give a GeoJSON FeatureCollection")
        for event, key in events:
            if event != "map_key":
                continue
            if key == "crs":
                _check_crs(path, _crs(events))
            elif key == "features" and key in top.members:
                raise InputError(path, "two members named features", "give one FeatureCollection")
            elif key == "features":
                if "crs" not in top.members:
                    _check_crs(path, _later_crs(path, start))
                if next(events)[0] != "start_array":
                    raise InputError(path, "features is not a list", "give a GeoJSON FeatureCollection")
                for event, value in events:
                    if event == "end_array":
                        break
                    feature = read_feature(events, (event, value))
                    number += 1
                    yield feature.row(number, f"feature {number}")
            else:
                top.member(key, events)
                if key == "type" and top.kind not in ("FeatureCollection", "Feature"):
                    raise InputError(path, f"type {shown(top.kind)}", "give a GeoJSON FeatureCollection")
            if key in ("crs", "features", "annotations"):
                top.members.add(key)
    except NotJson as error:
        raise InputError(path, f"{f'after feature {number}, ' if number else ''}not JSON ({error})", JSON) from None
    if "features" not in top.members:
        if "annotations" in top.members:
            raise InputError(path, "is a COCO file of annotations, not a collection", _instead_of_coco(path))
        if top.kind != "Feature":
            raise InputError(path, "no features", "give a GeoJSON FeatureCollection")
        yield top.row(1, "feature 1")


def _instead_of_coco(path: Path) -> str:
    beside = path.with_name("figures.csv")
    if beside.is_file():
        return f"give {beside.name}, the table beside it"
    return "give a table; fig2mesh parse --all writes one, figures.csv"


def _crs(events: Events) -> str | None:
    """Name in the value of a `crs` member (GeoJSON of 2008); "" if it has none; None if the value is null."""
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
                skip(events, len(keys))
                break
        elif event in CLOSE:
            keys.pop()
        elif keys == ["properties", "name"]:
            name = str(value)
    return name


def _later_crs(path: Path, start: int) -> str | None:
    """Name of the `crs` member where it comes after the features that it applies to; None without one."""
    with path.open("rb") as stream:
        tail = b""
        while chunk := stream.read(CHUNK):
            if b'"crs"' in tail + chunk:
                break
            tail = chunk[-8:]
        else:
            return None
        stream.seek(start)
        events = events_of(stream)
        next(events)
        for event, key in events:
            if event == "map_key" and key == "crs":
                return _crs(events)
            if event == "map_key":
                skip(events, next(events)[0] in OPEN)
    return None


def _check_crs(path: Path, name: str | None) -> None:
    if name is not None and not WGS84.fullmatch(name):
        finding = f"its crs is {shown(name, 60) or 'unknown'}, not WGS 84"
        raise InputError(path, finding, "export it in WGS 84 (RFC 7946)")
