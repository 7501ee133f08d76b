"""Placement of a figure as plain data for formats without a field for it, and parsing of such records."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from georef.errors import PlacementError
from georef.frames import ECEF, TILE
from georef.geodesy import geodetic_from_ecef, nose_bearing_deg
from georef.placement import GeoPlacement
from georef.transform import Transform
from georef.untrusted.damage import DamagedFile, decoding
from georef.untrusted.json_shape import NUMBER, Numbers, Required, check_shape

RECORD = {
    "crs": Required(str),
    "lon_deg": Required(NUMBER),
    "lat_deg": Required(NUMBER),
    "height_m": NUMBER,
    "height_datum": str,
    "heading_deg": NUMBER,
    "figure_height_m": NUMBER,
    "altitude_mode": str,
}
"""Shape of the record of a placement."""


def georeference(placement: GeoPlacement) -> dict[str, Any]:
    """Return a JSON-serialisable record of a placement; `height_m` is above the ellipsoid of WGS 84 (EPSG:4979)."""
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
    """Parse the record of a placement that `georeference` made.

    Raises DamagedFile for a record of another kind or with invalid values.
    """
    check_shape(record, RECORD, "georeference: ")
    if record["crs"] != "EPSG:4979":
        raise DamagedFile(f"georeference: crs is {record['crs']!r}, expected EPSG:4979")
    if unknown := record.keys() - RECORD.keys():
        raise DamagedFile(f"georeference: {sorted(unknown)[0][:40]} is not a member of the record of a place")
    try:
        return GeoPlacement(**{name: value for name, value in record.items() if name != "crs"})
    except PlacementError as error:
        raise DamagedFile(f"georeference: {error}") from error


def placement_of_tile(transform: list[float]) -> dict[str, float]:
    """Longitude, latitude, ellipsoidal height and nose bearing of a figure from its tile transform.

    transform : 16 numbers, column by column, ECEF from TILE, as in a tileset
    Raises DamagedFile for any other transform.
    """
    check_shape(transform, Numbers(16), "transform")
    matrix = np.asarray(transform, dtype=np.float64).reshape(4, 4).T
    with decoding("transform", PlacementError, ValueError):  # for matrices that are not affine, or not upright
        ecef_from_tile = Transform(ECEF, TILE, matrix)
        lon, lat, height = geodetic_from_ecef(matrix[:3, 3]).tolist()
        bearing = nose_bearing_deg(ecef_from_tile)
    return {"lon_deg": lon, "lat_deg": lat, "height_m": height, "heading_deg": bearing}
