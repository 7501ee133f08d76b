"""The same table of figures as every kind of collection; GeoPackages are written by GDAL."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio.raw

Table = Sequence[Mapping[str, Any]]


def write_csv(path: Path, table: Table, separator: str = ",", encoding: str = "utf-8") -> None:
    names = list(dict.fromkeys(name for row in table for name in row))
    with path.open("w", encoding=encoding, newline="") as stream:
        writer = csv.writer(stream, delimiter=separator)
        writer.writerow(names)
        for row in table:
            writer.writerow([row.get(name) for name in names])


def feature(row: Mapping[str, Any]) -> dict[str, Any]:
    """lon, lat and altitude as the geometry, the rest as properties."""
    place = [row[name] for name in ("lon", "lat", "altitude") if row.get(name) is not None]
    properties = {name: value for name, value in row.items() if name not in ("lon", "lat", "altitude")}
    geometry = {"type": "Point", "coordinates": place} if place else None
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def write_geojson(path: Path, table: Table) -> None:
    document = {"type": "FeatureCollection", "features": [feature(row) for row in table]}
    path.write_text(json.dumps(document, ensure_ascii=False, indent=1), encoding="utf-8")


def write_sequence(path: Path, table: Table, separator: str = "") -> None:
    lines = [separator + json.dumps(feature(row)) + "\n" for row in table]
    path.write_text("".join(lines), encoding="utf-8")


def wkb(*coordinates: float) -> bytes:
    """A point, of ISO well-known binary."""
    kind = 1 if len(coordinates) == 2 else 1001
    return b"\1" + kind.to_bytes(4, "little") + np.array(coordinates, "<f8").tobytes()


def write_layer(
    path: Path, columns: Mapping[str, Any], points: Any, crs: str | None = "EPSG:4326", **more: Any
) -> None:
    """A layer of a GeoPackage, from arrays by column and well-known binary of each row."""
    more = {"layer": "figures", "driver": "GPKG", **more}
    values = [np.asarray(value) for value in columns.values()]
    if points is None:
        pyogrio.raw.write(path, None, values, list(columns), **more)
    else:
        kind = more.pop("geometry_type", "Point Z" if any(each and len(each) > 21 for each in points) else "Point")
        shapes = np.array(list(points) + [None], object)[:-1]
        pyogrio.raw.write(path, shapes, values, list(columns), crs=crs, geometry_type=kind, **more)


def write_geopackage(path: Path, table: Table) -> None:
    names = list(dict.fromkeys(name for row in table for name in row if name not in ("lon", "lat", "altitude")))
    columns = {}
    for name in names:
        values = [row.get(name) for row in table]
        kind = object if any(isinstance(each, str) or each is None for each in values) else type(values[0])
        columns[name] = np.array(values + [None], object)[:-1].astype(kind)
    points = []
    for row in table:
        place = [row[name] for name in ("lon", "lat", "altitude") if row.get(name) is not None]
        points.append(wkb(*place) if place else None)
    path.unlink(missing_ok=True)
    write_layer(path, columns, points)


WRITERS: dict[str, Callable[[Path, Table], None]] = {
    "a.csv": write_csv,
    "b.tsv": lambda path, table: write_csv(path, table, "\t"),
    "c.txt": lambda path, table: write_csv(path, table, ";", "utf-8-sig"),
    "d.csv": lambda path, table: write_csv(path, table, ",", "utf-16"),
    "e.geojson": write_geojson,
    "f.geojsonl": write_sequence,
    "g.json": lambda path, table: write_sequence(path, table, "\x1e"),
    "h.gpkg": write_geopackage,
}
