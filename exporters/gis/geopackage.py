"""GeoPackage: figures as a layer of points with attributes, for GIS; the same as `index.geojson`, with an index.

https://www.geopackage.org/spec120/
https://gdal.org/en/stable/drivers/vector/gpkg.html
"""

from __future__ import annotations

import shutil
import sqlite3
import struct
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from exporters.errors import ExportError
from exporters.gis.geojson import OWN_PROPERTIES, feature, free_names
from exporters.gis.table_spool import TableSpool, column_arrays
from exporters.placed_figure import PlacedFigure

FIGURES_LAYER, FAILED_TABLE = "figures", "failed"

FAILED_COLUMNS: dict[str, type] = {"row": int, "name": str, "error": str}

VERSION = "1.2"
"""Of GeoPackage; GDAL before 3.7 (QGIS of 2022) warns about later ones, which have nothing that is needed here."""

GDAL_OPTIONS = {"OGR_CURRENT_DATE": "1970-01-01T00:00:00.000Z", "OGR_SQLITE_SYNCHRONOUS": "OFF"}
"""GDAL's settings for writing: a fixed date, so that the same figures give the same bytes; and no synchronous writes,
as an incomplete file is discarded anyway."""

Failure = tuple[int, str, str]
"""Row of the table, name of the figure, error message."""


def write_geopackage(
    figures: Iterable[PlacedFigure],
    path: Path,
    *,
    models: bool = True,
    failed: Iterable[Failure] | None = None,
) -> int:
    """Write the layer `figures`, one point each in order, with the attributes of `exporters.gis.geojson.feature`.

    figures : `contents` relative to the file; read once, in chunks, so they may exceed memory
    path : replaced if it exists; its folder needs space for a temporary file as large as the result
    models : whether to name the finest of the contents
    failed : if given, also write the table `failed`, without geometry, with columns `row`, `name` and `error`

    Returns the number of figures. Their ids (`fid`) are 1, 2, 3, ...

    Coordinates are longitude, latitude and height above the ellipsoid, EPSG:4979. A figure that is clamped to the
    terrain has a point of two coordinates, as in GeoJSON; a layer of only such points is in EPSG:4326.
    Columns are booleans, integers, floats or text, the narrowest type that holds all their values exactly, see
    `exporters.gis.table_spool.TableSpool`. Text is written unchanged, also if it begins with =, +, - or @: a database
    does not evaluate formulas. Take care when exporting it to a spreadsheet.

    Raises ExportError where the file cannot be written.
    """
    from pyogrio.errors import DataLayerError, DataSourceError

    try:
        with TableSpool(path.parent, OWN_PROPERTIES) as table, _for_gdal(path) as target, _settings():
            heights = 0
            for figure in figures:
                document = feature(figure, figure.contents[0] if models else None)
                point = document["geometry"]["coordinates"]
                heights += len(point) == 3
                table.add(_point_wkb(point), document["properties"])
            _write_table(target, FIGURES_LAYER, table, 3 if heights or not table.rows else 2)
            if 0 < heights < table.rows:
                _declare_optional_heights(target)
            if failed is not None:
                with TableSpool(path.parent, FAILED_COLUMNS) as failures:
                    for row in failed:
                        failures.add(None, dict(zip(FAILED_COLUMNS, row, strict=True)))
                    _write_table(target, FAILED_TABLE, failures, 0)
            return table.rows
    except (OSError, sqlite3.Error, DataLayerError, DataSourceError) as error:
        finding = f"cannot be written ({' '.join(str(error).split())[:200]})"
        raise ExportError(path, finding, "check the folder and the disk space") from error


def _write_table(path: Path, layer: str, table: TableSpool, dimensions: int) -> None:
    """Append all rows of a table as a new layer; dimensions : of its points, 0 without a geometry."""
    import pyogrio.raw

    columns = table.columns
    reserved = free_names(("fid", "geom"), tuple(columns))
    options: dict[str, Any] = {"layer": layer, "driver": "GPKG", "layer_options": {"FID": reserved[0]}}
    if dimensions:
        options |= {
            "crs": {2: "EPSG:4326", 3: "EPSG:4979"}[dimensions],
            "geometry_type": {2: "Point", 3: "Point Z"}[dimensions],
            "promote_to_multi": False,
        }
        options["layer_options"] |= {"GEOMETRY_NAME": reserved[1], "SPATIAL_INDEX": "YES"}
    if not path.exists():
        options["dataset_options"] = {"VERSION": VERSION}
    append = False
    for rows in table.chunks() if table.rows else iter([[]]):
        pairs = [column_arrays([row.get(name) for _, row in rows], kind) for name, kind in columns.items()]
        geometry = np.array([key for key, _ in rows], dtype=object) if dimensions else None
        data, masks = [values for values, _ in pairs], [mask for _, mask in pairs]
        pyogrio.raw.write(path, geometry, data, list(columns), field_mask=masks, append=append, **options)
        append = True
        options.pop("dataset_options", None)


def _point_wkb(coordinates: list[float]) -> bytes:
    """Encode a point as ISO well-known binary, little endian; its type is 1001 with a height."""
    kind = {2: 1, 3: 1001}[len(coordinates)]
    return struct.pack(f"<BI{len(coordinates)}d", 1, kind, *coordinates)


def _declare_optional_heights(path: Path) -> None:
    """Declare heights as optional, z = 2; GDAL can only declare that all points have one or none has."""
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("UPDATE gpkg_geometry_columns SET z = 2 WHERE table_name = ?", (FIGURES_LAYER,))


@contextmanager
def _for_gdal(path: Path) -> Iterator[Path]:
    """Give pyogrio an unused path, whose file is moved to `path` at the end, or removed on failure.

    Paths that pyogrio takes for archives, such as any with a `!`, are written elsewhere first.
    """
    from pyogrio.util import vsi_path

    path.unlink(missing_ok=True)
    try:
        if vsi_path(path) == str(path):
            yield path
        else:
            with tempfile.TemporaryDirectory(prefix="fig2mesh_") as folder:
                plain = Path(folder) / "figures.gpkg"
                yield plain
                shutil.move(plain, path)
    except BaseException:
        path.unlink(missing_ok=True)
        raise


@contextmanager
def _settings() -> Iterator[None]:
    from pyogrio import get_gdal_config_option, set_gdal_config_options

    before = {name: get_gdal_config_option(name) for name in GDAL_OPTIONS}
    set_gdal_config_options(GDAL_OPTIONS)
    try:
        yield
    finally:
        set_gdal_config_options(before)
