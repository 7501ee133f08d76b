"""Points as well-known text in a cell, as GDAL, QGIS and PostGIS write them.

https://www.ogc.org/standards/sfa/; EWKT: https://postgis.net/docs/ST_AsEWKT.html
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from functools import lru_cache

from fig2mesh.batch.collections.values import LON_LAT, TO_DEGREES, InvalidValue, Point, shown

WKT_COLUMNS = ("wkt", "wkt_geom", "geometry", "geom", "the_geom", "shape")
"""Names of columns of geometries: of GDAL, of QGIS's clipboard, of geopandas, and of databases."""

_GEOMETRY = re.compile(r"(?:SRID\s*=\s*([0-9]+)\s*;)?\s*([A-Z]+?)\s*(ZM|Z|M)?\s*(\(.*\)|EMPTY)", re.I | re.S | re.ASCII)
_NUMBERS = re.compile(r"[^()\s,]+")


def is_geometry(text: str) -> bool:
    """Whether a text is a geometry in any of the encodings that tables hold: WKT, hexadecimal WKB, GeoJSON."""
    return bool(_GEOMETRY.fullmatch(text) or re.fullmatch(r"(0x)?0[01][0-9A-Fa-f]{40,}", text) or text[:1] == "{")


def wkt_point(text: str) -> Point | InvalidValue | None:
    """Point of a text such as `POINT (8.54 47.37)`; None if it is empty.

    `POINT Z` gives the altitude. With `SRID=2056;` before it, it is transformed to WGS 84; without, it has to be
    longitude and latitude. A MULTIPOINT of one point is that point.
    """
    match = _GEOMETRY.fullmatch(text)
    if match is None:
        return InvalidValue(f"{shown(text)!r} is not a point as WKT", f"write POINT (LON LAT), or {LON_LAT}")
    srid, kind, flag, rest = match[1], match[2].upper(), (match[3] or "").upper(), match[4]
    if kind not in ("POINT", "MULTIPOINT"):
        return InvalidValue(f"its geometry is a {kind.title()}", f"give a Point, or {LON_LAT}")
    if rest.upper() == "EMPTY":
        return None
    if "," in rest:
        return InvalidValue(f"its geometry is a MultiPoint of {rest.count(',') + 1:,}", f"give a Point, or {LON_LAT}")
    try:
        numbers = [float(each) for each in _NUMBERS.findall(rest)]
    except ValueError:
        numbers = []
    if not 2 + len(flag) <= len(numbers) <= (2 + len(flag) if flag else 4):
        return InvalidValue(f"{shown(text)!r} is not a point as WKT", f"write POINT (LON LAT), or {LON_LAT}")
    if any(map(math.isnan, numbers[:2])):
        return None
    if not all(map(math.isfinite, numbers[:2])):
        return InvalidValue(f"point at {shown(rest)}", "give finite numbers")
    z = numbers[2] if len(numbers) > 2 and flag != "M" and math.isfinite(numbers[2]) else None
    point = Point(numbers[0], numbers[1], z)
    if srid is not None and int(srid) not in (0, 4326, 4979):
        (moved,) = _transform(int(srid))([point])
        return moved
    if abs(point.lon) > 180 or abs(point.lat) > 180:
        remedy = f"put SRID=2056; or the like before it, or transform it ({TO_DEGREES}), or {LON_LAT}"
        return InvalidValue(f"{shown(text)!r} is not in degrees", remedy)
    return point


@lru_cache(maxsize=16)
def _transform(srid: int) -> Callable[[Sequence[Point]], Sequence[Point | InvalidValue]]:
    from fig2mesh.batch.collections.reference import to_wgs84

    return to_wgs84("EPSG", srid, ())
