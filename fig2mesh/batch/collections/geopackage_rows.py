"""Rows of a layer of a GeoPackage (OGC 12-128), read with SQLite itself: as a stream, and without writing anything.

The file is opened as `immutable`, so that SQLite makes no files next to it and needs no write permission. Changes that
another program has not yet written back would be missed that way, so such files are rejected.
Pyproj transforms points of other reference systems to WGS 84, and is imported only if needed.
https://www.geopackage.org/spec/
"""

from __future__ import annotations

import math
import sqlite3
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from fig2mesh.batch.collections.rows import (
    FIGURE,
    MAX_RECORD,
    MAX_TEXT,
    Row,
    check_columns,
    column_name,
    make_row,
)
from fig2mesh.batch.collections.values import InvalidValue, Point, shown
from fig2mesh.errors import InputError

LAYERS = ("features", "attributes", "aspatial")
"""Data types of contents that are tables of rows; GDAL wrote `aspatial` before there was `attributes`."""

FIDS = ("fid", "ogc_fid")
"""Names of the feature id in views."""

JOURNAL_MAGIC = bytes.fromhex("d9d505f920a163d7")

MAX_VALUE = 1 << 26
"""Maximum bytes of a value in SQLite, geometries included: an outline of four million vertices."""

GEOMETRY_BYTES = 160
"""Bytes to read of a geometry; a point with its header takes at most 114."""

STEPS, MAX_WAITS = 1_000_000, 3_000
"""SQLite instructions between two calls of the progress handler, and number of calls without a row after which a view
is abandoned: about a minute. A table needs a few instructions per row."""

NOT_ONE = "give a file written by QGIS or GDAL"

Transform = Callable[[Sequence[Point]], Sequence[Point | InvalidValue]]


@dataclass(frozen=True, slots=True)
class _Layer:
    """Layer of a GeoPackage.

    table : its name; fid : column of the feature id, if any
    columns : of values: name in the file, name in `Row.values`, whether it is Boolean
    geometry : its column, if any; srs : number of its reference system
    """

    table: str
    fid: str | None
    columns: tuple[tuple[str, str, bool], ...]
    geometry: str | None
    srs: int | None


def geopackage_columns(path: Path, layer: str | None = None) -> tuple[str, ...]:
    """Names of the columns of a layer, as in `Row.values`."""
    with _opened(path) as connection:
        return tuple(name for _, name, _ in _choose(path, connection, layer).columns)


def geopackage_rows(path: Path, layer: str | None = None) -> Iterator[Row]:
    """Rows of a layer, a table or a view; by default of the only one with a column `figure`.

    Dates are texts as in the file (ISO 8601); columns of binary data are left out. Points give `lon` and `lat`, and
    `altitude` where they have z: above the ellipsoid, unless the reference system has a vertical datum.

    Raises InputError for damaged files, files that are not GeoPackages, and where the layer is ambiguous.
    """
    with _opened(path) as connection:
        chosen = _choose(path, connection, layer)
        to_wgs84: Transform | None = None
        number = 0
        for chunk in _chunks(connection, chosen):
            points = [_point(raw[1]) for raw in chunk]
            places = [each for each in points if isinstance(each, Point)]
            if places and to_wgs84 is None:
                to_wgs84 = _to_wgs84(connection, chosen.srs)
            moved = iter(to_wgs84(places)) if places and to_wgs84 is not None else iter(())
            points = [next(moved) if isinstance(each, Point) else each for each in points]
            for raw, point in zip(chunk, points, strict=True):
                number += 1
                yield _row(number, chosen, raw, point)


def _row(number: int, layer: _Layer, raw: Sequence[object], point: Point | InvalidValue | None) -> Row:
    where = f"row {number}" if layer.fid is None else f"fid {raw[0]}"
    found: list[tuple[str, object]] = []
    room = MAX_RECORD
    for (_, name, truth), value in zip(layer.columns, raw[2:], strict=True):
        if isinstance(value, bytes):
            value = InvalidValue(f"more than {MAX_TEXT:,} characters", "give a shorter text")
        elif truth and value in (0, 1):
            value = bool(value)
        room -= len(value) if isinstance(value, str) else 0
        found.append((name, value))
    problem = None if room >= 0 else InvalidValue(f"more than {MAX_RECORD:,} characters", "shorten it")
    return make_row(number, where, found if problem is None else (), problem, lambda: point)


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """Read-only connection to the database; its errors become InputError."""
    for suffix, magic in (("-wal", b""), ("-journal", JOURNAL_MAGIC)):
        beside = path.with_name(path.name + suffix)
        if beside.is_file() and beside.stat().st_size:
            with beside.open("rb") as stream:
                if stream.read(len(magic)) == magic:
                    finding = f"has changes in {beside.name} that are not yet written back"
                    raise InputError(path, finding, "save and close it in the program that edits it")
    try:
        uri = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
        # A generator may be closed by another thread than the one that reads it; two threads never read at once.
        with closing(sqlite3.connect(uri, uri=True, check_same_thread=False)) as connection:
            connection.text_factory = lambda raw: raw.decode("utf-8", "surrogateescape")
            connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_VALUE)
            connection.execute("PRAGMA trusted_schema = OFF")
            connection.execute("PRAGMA cell_size_check = ON")
            yield connection
    except UnicodeError:
        # In an error message of SQLite about names that are not UTF-8.
        raise InputError(path, "cannot be read (names that are not UTF-8)", NOT_ONE) from None
    except MemoryError:
        # Raised by SQLite for sizes in a damaged file.
        raise InputError(path, "cannot be read (requires more memory than available)", NOT_ONE) from None
    except sqlite3.Error as error:
        if "interrupted" in str(error):
            raise InputError(path, "view takes too long", "save the layer as a table") from None
        if "too big" in str(error):
            raise InputError(path, f"value of more than {MAX_VALUE >> 20} MB", "simplify its geometry") from None
        raise InputError(path, f"cannot be read ({shown(str(error), 100)})", NOT_ONE) from None


def _choose(path: Path, connection: sqlite3.Connection, layer: str | None) -> _Layer:
    try:
        entries = connection.execute("SELECT table_name, data_type FROM gpkg_contents ORDER BY rowid").fetchmany(1_000)
    except sqlite3.OperationalError as error:
        if "no such table" not in str(error):
            raise
        raise InputError(path, "an SQLite database, but not a GeoPackage", NOT_ONE) from None
    tables = [table for table, kind in entries if isinstance(table, str) and kind in LAYERS and _writable(table)]
    listed = shown(", ".join(tables), 200)
    if layer is not None and layer not in tables:
        raise InputError(path, f"no layer {layer!r} among {listed or 'none'}", "name one of them")
    found = []
    for table in tables if layer is None else [layer]:
        try:
            found.append(_describe(connection, table))
        except sqlite3.OperationalError:
            # A view of missing tables, or with functions that only a GIS provides.
            if layer is not None:
                raise
    if layer is None:
        found = [each for each in found if any(name == FIGURE for _, name, _ in each.columns)]
        if not found:
            finding = f"no layer with a column {FIGURE}, of {listed}" if tables else "no layers"
            raise InputError(path, finding, f"name the column with the pictures {FIGURE}")
        if len(found) > 1:
            names = shown(", ".join(each.table for each in found), 200)
            raise InputError(path, f"several layers with a column {FIGURE}: {names}", "name one with --layer")
    check_columns(path, [name for _, name, _ in found[0].columns])
    return found[0]


def _writable(name: str) -> bool:
    """Whether a name can be part of a statement: UTF-8 without NUL."""
    try:
        return bool(name) and b"\0" not in name.encode()
    except UnicodeEncodeError:
        return False


def _describe(connection: sqlite3.Connection, table: str) -> _Layer:
    listed = connection.execute("SELECT name, type, pk, hidden FROM pragma_table_xinfo(?)", (table,)).fetchall()
    geometry = srs = None
    try:
        row = connection.execute(
            "SELECT column_name, srs_id FROM gpkg_geometry_columns WHERE table_name = ? COLLATE NOCASE", (table,)
        ).fetchone()
        geometry, srs = row or (None, None)
    except sqlite3.OperationalError:
        pass  # A GeoPackage of attributes alone may lack that table.
    keys = [name for name, kind, key, _ in listed if key and str(kind).upper() == "INTEGER"]
    if sum(bool(key) for _, _, key, _ in listed) == 0:
        keys = [name for name, *_ in listed if name.lower() in FIDS]
    fid = keys[0] if len(keys) == 1 else None
    columns = []
    for name, kind, _, hidden in listed:
        if hidden != 1 and name not in (fid, geometry) and _writable(name) and column_name(name):
            columns.append((name, column_name(name), str(kind).upper() == "BOOLEAN"))
    if geometry not in [name for name, *_ in listed]:
        geometry = None
    return _Layer(table, fid, tuple(columns), geometry, srs if isinstance(srs, int) else None)


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


def _chunks(connection: sqlite3.Connection, layer: _Layer) -> Iterator[list[Sequence[object]]]:
    """Rows of id, start of the geometry, and values, a few hundred per chunk; texts that are too long are empty bytes.

    Transforming points one by one would take ten times as long.
    """
    picked = [
        _quoted(layer.fid) if layer.fid else "NULL",
        f"CASE typeof({{0}}) WHEN 'blob' THEN substr({{0}}, 1, {GEOMETRY_BYTES}) END".format(_quoted(layer.geometry))
        if layer.geometry
        else "NULL",
    ]
    for name, _, _ in layer.columns:
        column = _quoted(name)
        # Count bytes, at most four per character, because the length of a text ends at a NUL.
        short = f"CASE WHEN length(CAST({column} AS BLOB)) <= {4 * MAX_TEXT} THEN {column} ELSE zeroblob(0) END"
        picked.append(f"CASE typeof({column}) WHEN 'blob' THEN NULL WHEN 'text' THEN {short} ELSE {column} END")
    order = f" ORDER BY {_quoted(layer.fid)}" if layer.fid else ""
    waits = 0

    def timed_out() -> bool:
        nonlocal waits
        waits += 1
        return waits > MAX_WAITS

    connection.set_progress_handler(timed_out, STEPS)
    cursor = connection.execute(f"SELECT {', '.join(picked)} FROM {_quoted(layer.table)}{order}")
    chunk: list[Sequence[object]] = []
    size = 0
    for row in cursor:
        waits = 0
        chunk.append(row)
        size += sum(len(value) for value in row if isinstance(value, str))
        if len(chunk) >= 256 or size > MAX_RECORD:
            yield chunk
            chunk, size = [], 0
    if chunk:
        yield chunk


def _point(blob: object) -> Point | InvalidValue | None:
    """Point of a geometry, in its reference system; None if it is missing or empty.

    A header (GeoPackage 2.1.3) and well-known binary: ISO WKB, or EWKB with flags in the type.
    """
    if not isinstance(blob, bytes):
        return None
    broken = InvalidValue("invalid geometry", "save the layer again")
    if len(blob) < 8 or blob[:2] != b"GP" or blob[3] >> 1 & 7 > 4:
        return broken
    start = 8 + (0, 32, 48, 48, 64)[blob[3] >> 1 & 7]
    try:
        kind, order, has_z, start = _head(blob, start)
        if kind == 4:
            (count,) = struct.unpack_from(order + "I", blob, start)
            if count == 0:
                return None
            if count > 1:
                return InvalidValue(
                    f"its geometry is a MultiPoint of {count:,}", "give a Point, or columns lon and lat"
                )
            kind, order, has_z, start = _head(blob, start + 4)
        if kind != 1:
            name = ("geometry", "Point", "LineString", "Polygon", "MultiPoint", "MultiLineString", "MultiPolygon")
            what = name[kind] if kind < len(name) else name[0]
            return InvalidValue(f"its geometry is a {what}", "give a Point, or columns lon and lat")
        x, y = struct.unpack_from(order + "dd", blob, start)
        z = struct.unpack_from(order + "d", blob, start + 16)[0] if has_z else math.nan
    except struct.error:
        return broken
    if math.isnan(x) and math.isnan(y):
        return None
    if not (math.isfinite(x) and math.isfinite(y)) or math.isinf(z):
        return InvalidValue(f"point at {x} {y}", "give finite numbers")
    return Point(x, y, None if math.isnan(z) else z)


def _head(blob: bytes, start: int) -> tuple[int, str, bool, int]:
    """Type of a geometry, byte order, whether it has z, and start of its data."""
    order = "<" if blob[start : start + 1] == b"\1" else ">"
    (code,) = struct.unpack_from(order + "I", blob, start + 1)
    kind, has_z = code & 0x0FFFFFFF, bool(code & 0x80000000)
    start += 9 if code & 0x20000000 else 5
    return kind % 1000 if kind < 4000 else kind, order, has_z or kind // 1000 in (1, 3), start


def _to_wgs84(connection: sqlite3.Connection, srs: int | None) -> Transform:
    """Transformation from a layer's reference system, given by its number, to WGS 84."""
    if srs == 4326:
        return lambda points: points
    nothing = InvalidValue("its layer has no reference system", "assign one, or give columns lon and lat")
    if srs is None or srs in (0, -1):
        return lambda points: [nothing] * len(points)
    found = connection.execute("SELECT * FROM gpkg_spatial_ref_sys WHERE srs_id = ?", (srs,))
    names = [str(column[0]).lower() for column in found.description]
    facts = dict(zip(names, found.fetchone() or (), strict=False))
    from fig2mesh.batch.collections.reference import to_wgs84

    definitions = [facts.get("definition_12_063"), facts.get("definition")]
    return to_wgs84(facts.get("organization"), facts.get("organization_coordsys_id"), definitions)
