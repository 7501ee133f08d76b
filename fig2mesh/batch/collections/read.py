"""Read a collection of figures: CSV, GeoJSON or GeoPackage, one row per figure.

Rows are streamed, so that a collection may be larger than memory. An unusable row is returned with its problem, and
does not stop the others. For the meaning of the columns see `rows`.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from fig2mesh.batch.collections.csv_rows import csv_columns, csv_rows
from fig2mesh.batch.collections.geojson_rows import geojson_rows
from fig2mesh.batch.collections.rows import MAX_ROWS, Row
from fig2mesh.errors import InputError

TABLES = (".csv", ".tsv", ".txt")
GEOJSON = (".geojson", ".json", ".geojsonl", ".geojsons", ".jsonl", ".ndjson")
GEOPACKAGE = (".gpkg",)

OFFICE = (".xls", ".xlsx", ".ods")

SQLITE_MAGIC = b"SQLite format 3\0"


def read_rows(path: Path, layer: str | None = None) -> Iterator[Row]:
    """Rows of a collection, in the order of the file.

    path : CSV with commas, semicolons or tabs (.csv, .tsv, .txt); GeoJSON, a FeatureCollection or one feature per
        line (.geojson, .json, .geojsonl, .ndjson); GeoPackage (.gpkg). With other suffixes the content decides
    layer : of a GeoPackage; default: the only one with a column `figure`

    Points give `lon` and `lat` of rows without a place in their columns, and `altitude` where they have a third
    coordinate.

    Raises InputError for a file that can't be read, also after some rows, and for one of more than `MAX_ROWS`.
    """
    kind = _kind(path, layer)
    if kind == "gpkg":
        from fig2mesh.batch.collections.geopackage_rows import geopackage_rows

        rows = geopackage_rows(path, layer)
    else:
        rows = csv_rows(path) if kind == "csv" else geojson_rows(path)
    yield from islice(rows, MAX_ROWS)
    if next(rows, None) is not None:
        raise InputError(path, f"more than {MAX_ROWS:,} rows", "split the collection")


def columns(path: Path, layer: str | None = None) -> tuple[str, ...] | None:
    """Names of the columns, as in `Row.values`; None for GeoJSON, where each feature has its own."""
    kind = _kind(path, layer)
    if kind == "gpkg":
        from fig2mesh.batch.collections.geopackage_rows import geopackage_columns

        return geopackage_columns(path, layer)
    return csv_columns(path) if kind == "csv" else None


def _kind(path: Path, layer: str | None) -> str:
    """Kind of a collection: csv, geojson or gpkg."""
    try:
        if not path.exists():
            raise InputError(path, "no such file", "give a collection as CSV, GeoJSON or GeoPackage")
        # Not a pipe either: some kinds are read twice.
        if not path.is_file():
            raise InputError(path, "not a file", "give a collection as CSV, GeoJSON or GeoPackage")
        with path.open("rb") as stream:
            head = stream.read(64)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check its name and permissions") from None
    suffix = path.suffix.lower()
    start = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if head.startswith(SQLITE_MAGIC):
        kind = "gpkg"
    elif suffix in GEOPACKAGE:
        raise InputError(path, "not a GeoPackage", "give a file written by QGIS or GDAL")
    elif not start:
        raise InputError(path, "empty", f"give a table with a column {'figure'!r}")
    elif suffix in OFFICE or head.startswith(b"PK\3\4"):
        raise InputError(path, "is a workbook or archive", "save the table as CSV UTF-8")
    elif suffix in GEOJSON or (suffix not in TABLES and start[:1] in (b"{", b"\x1e")):
        kind = "geojson"
    elif suffix in TABLES:
        kind = "csv"
    else:
        raise InputError(
            path,
            f"unknown suffix {suffix}" if suffix else "no suffix",
            "give a collection as CSV, GeoJSON or GeoPackage",
        )
    if layer is not None and kind != "gpkg":
        raise InputError(path, f"--layer {layer!r} requires a GeoPackage", "leave it out, or give a GeoPackage")
    return kind
