"""Rows of a layer of a GeoPackage (OGC 12-128), read with SQLite itself: as a stream, and without writing anything.

The file is opened as one that nobody changes (`immutable`): SQLite then makes no files beside it and needs no rights
to. Changes that another program has not written back yet would be missed so, and are refused.
Points of any reference system become WGS 84 by pyproj, which is imported only if there is another one.
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

from fig2mesh.batch.rows import (
    FIGURE,
    MAX_RECORD,
    MAX_TEXT,
    Point,
    Row,
    Unfit,
    check_columns,
    column_name,
    make_row,
    shown,
)
from fig2mesh.errors import InputError

LAYERS = ("features", "attributes", "aspatial")
"""Kinds of contents that are tables of rows; `aspatial` is what GDAL wrote before there were attributes."""

FIDS = ("fid", "ogc_fid")
"""Names that views give to the number of a feature."""

JOURNAL_MAGIC = bytes.fromhex("d9d505f920a163d7")

MAX_VALUE = 1 << 26
"""Bytes of a value, geometries too, that SQLite may hold at a time: outlines of four million vertices."""

GEOMETRY_BYTES = 160
"""Of a geometry; a point with its header takes at most 114."""

STEPS, MAX_WAITS = 1_000_000, 3_000
"""Instructions of SQLite's machine between two looks, and looks without a row after which a view is given up: about
a minute. A table takes a few for a row."""

NOT_ONE = "give a file as QGIS or GDAL writes it"

Transform = Callable[[Sequence[Point]], Sequence[Point | Unfit]]


@dataclass(frozen=True, slots=True)
class _Layer:
    """table : its name; fid : column that numbers its rows, if any; columns : of values, with the names that rows have
    and whether they are truth values; geometry : its column, if any; srs : number of its reference system."""

    table: str
    fid: str | None
    columns: tuple[tuple[str, str, bool], ...]
    geometry: str | None
    srs: int | None
