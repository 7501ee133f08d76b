"""The place of a figure as plain data, for formats that have no field for it, and back from what a file says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from georef.errors import PlacementError
from georef.frames import ECEF, TILE
from georef.geodesy import geodetic_from_ecef, nose_bearing_deg
from georef.placement import GeoPlacement
from georef.transform import Transform


def georeference(placement: GeoPlacement) -> dict[str, Any]:
    """JSON-serialisable record of a placement; `height_m` is above the ellipsoid of WGS 84 (EPSG:4979)."""
    return {
        "crs": "EPSG:4979",
        "lon_deg": placement.lon_deg,
        "lat_deg": placement.lat_deg,
        "height_m": placement.height_m,
        "height_datum": placement.height_datum,
        "heading_deg": placement.heading_deg,
        "figure_height_m": placement.figure_height_m,
        "altitude_mode": placement.altitude_mode,
    }


def placement_of_record(record: Mapping[str, Any]) -> GeoPlacement:
    """The placement that `georeference` made a record of, as read back from a file.

    Raises ValueError for a record of another kind or with values that no placement has.
    """
    if record.get("crs") != "EPSG:4979":
        raise ValueError(f"georeference: crs is {record.get('crs')!r}, expected EPSG:4979")
    fields = {name: value for name, value in record.items() if name != "crs"}
    try:
        return GeoPlacement(**fields)
    except (TypeError, PlacementError) as error:
        raise ValueError(f"georeference: {error}") from error


def placement_of_tile(transform: ArrayLike) -> dict[str, float]:
    """Longitude, latitude, ellipsoidal height and nose bearing that a tile transform gives a figure.

    transform : 16 numbers, column by column, ECEF from TILE, as in a tileset
    Raises ValueError for a matrix that is no such transform.
    """
    matrix = np.asarray(transform, dtype=np.float64).reshape(4, 4).T
    ecef_from_tile = Transform(ECEF, TILE, matrix)
    try:
        lon, lat, height = geodetic_from_ecef(matrix[:3, 3]).tolist()
    except PlacementError as error:
        raise ValueError(str(error)) from error
    bearing = nose_bearing_deg(ecef_from_tile)
    return {"lon_deg": lon, "lat_deg": lat, "height_m": height, "heading_deg": bearing}
