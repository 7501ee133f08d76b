"""Transformation of points to WGS 84 from any reference system known to pyproj."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError, ProjError

from fig2mesh.batch.collections.values import LON_LAT, InvalidValue, Point, shown


def to_wgs84(
    authority: object, code: object, definitions: Iterable[object]
) -> Callable[[Sequence[Point]], Sequence[Point | InvalidValue]]:
    """Transformation from a reference system, given by its code (EPSG, 2056) or else by its WKT definitions.

    Without a vertical datum heights are metres above the ellipsoid, unchanged; with one they are converted, and
    rejected if that needs a missing grid. Points that cannot be transformed become an InvalidValue.
    """
    crs = _crs(authority, code, definitions)
    if crs is None:
        unknown = InvalidValue("unknown reference system of its layer", f"reproject it to WGS 84, or {LON_LAT}")
        return lambda points: [unknown] * len(points)
    flat = _transformer(crs.to_2d(), "EPSG:4326")
    solid = _transformer(crs, "EPSG:4979") if len(crs.axis_info) == 3 else None

    def transform(points: Sequence[Point]) -> list[Point | InvalidValue]:
        if flat is None:
            nothing = InvalidValue(f"no known transformation from {shown(crs.name)} to WGS 84", LON_LAT)
            return [nothing] * len(points)
        x, y = [each.lon for each in points], [each.lat for each in points]
        lon, lat = flat.transform(x, y)
        heights: Sequence[float | None] = [each.altitude for each in points]
        if len(crs.axis_info) == 3:
            z = [each.altitude or 0.0 for each in points]
            above = [math.inf] * len(points) if solid is None else solid.transform(x, y, z)[2]
            heights = [None if each is None else new for each, new in zip(heights, above, strict=True)]
        return [_checked(crs, *place) for place in zip(lon, lat, heights, strict=True)]

    return transform


def _checked(crs: CRS, lon: float, lat: float, height: float | None) -> Point | InvalidValue:
    if not (math.isfinite(lon) and math.isfinite(lat)):
        return InvalidValue(f"point outside the area of {shown(crs.name)}", "check the reference system of its layer")
    if height is not None and not math.isfinite(height):
        finding = f"no available conversion of heights from {shown(crs.name)} to the ellipsoid"
        return InvalidValue(finding, "drop z, and give columns altitude and altitude_datum")
    return Point(lon, lat, height)


def _crs(authority: object, code: object, definitions: Iterable[object]) -> CRS | None:
    if isinstance(authority, str) and isinstance(code, int | str):
        try:
            return CRS.from_authority(authority, code)
        except (CRSError, ValueError):
            pass
    for definition in definitions:
        if isinstance(definition, str):
            try:
                return CRS.from_wkt(definition)
            except (CRSError, ValueError):
                continue
    return None


def _transformer(crs: CRS, target: str) -> Transformer | None:
    try:
        return Transformer.from_crs(crs, target, always_xy=True, allow_ballpark=False)
    except ProjError:
        return None
