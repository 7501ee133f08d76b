"""Geodetic and earth-centred coordinates, the local ENU frame at a place, and the transforms of a placed figure.

All computations are in float64. pyproj does the geodesy and is imported on first use, so that importing this module is
cheap.

Orientation convention: ASSET (glTF) has its front along +Z; 3D Tiles rotates y-up content by (x, y, z) to
(x, -z, y), which puts the front along -y of the TILE frame: an unrotated tile in an ENU frame faces south, bearing
180. Bearings run clockwise, rotations about the up axis counter-clockwise, so a nose bearing B needs the rotation
by 180 - B (clockwise: by B - 180).
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from georef.bearing import normalized_bearing
from georef.errors import PlacementError
from georef.frames import ASSET, ECEF, ENU, TILE
from georef.placement import GeoPlacement, check_lonlat
from georef.transform import FloatArray, Transform

if TYPE_CHECKING:
    from pyproj import Transformer

WGS84_A_M = 6378137.0
WGS84_F = 1.0 / 298.257223563
"""Semi-major axis and flattening of the WGS 84 ellipsoid (EPSG:7030)."""

_E2 = WGS84_F * (2.0 - WGS84_F)


@functools.cache
def _ecef_from_geodetic() -> Transformer:
    from pyproj import Transformer

    # A conversion on one datum, with no grid in it: allow_ballpark=False makes sure of that.
    return Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True, allow_ballpark=False)


def _converted(points: ArrayLike, direction: str, name: str) -> FloatArray:
    array = np.asarray(points, dtype=np.float64)
    if array.ndim not in (1, 2) or array.shape[-1] != 3:
        raise ValueError(f"{name}: shape is {array.shape}, expected (N, 3) or (3,)")
    rows = array.reshape(-1, 3)
    result = np.stack(_ecef_from_geodetic().transform(*rows.T, direction=direction), axis=-1)
    bad = ~np.isfinite(result).all(axis=-1)
    if bad.any():
        first = rows[bad][0].tolist()
        raise PlacementError(name, f"{first} is not on the earth", "give finite coordinates with latitudes in -90..90")
    if direction == "INVERSE":
        result = _refined(result, rows)
    shaped: FloatArray = result.reshape(array.shape)
    return shaped


def _refined(geodetic: FloatArray, ecef: FloatArray) -> FloatArray:
    # PROJ inverts with one step of Bowring's method. Measured with PROJ 9.5.1: off by 3e-6 m near the poles,
    # 7e-7 m at 9 km of height, 1.3e-4 m at 100 km. One Newton step, from the residual in the local meridian plane,
    # reduces that to a few float64 steps; the longitude is already exact.
    residual = ecef - np.stack(_ecef_from_geodetic().transform(*geodetic.T), axis=-1)
    lon, lat = np.radians(geodetic[:, :2].T)
    outward = np.cos(lon) * residual[:, 0] + np.sin(lon) * residual[:, 1]
    north = np.cos(lat) * residual[:, 2] - np.sin(lat) * outward
    up = np.sin(lat) * residual[:, 2] + np.cos(lat) * outward
    meridian_radius = WGS84_A_M * (1.0 - _E2) / (1.0 - _E2 * np.sin(lat) ** 2) ** 1.5
    refined = geodetic.copy()
    refined[:, 1] = np.clip(refined[:, 1] + np.degrees(north / (meridian_radius + geodetic[:, 2])), -90.0, 90.0)
    refined[:, 2] += up
    return refined


def ecef_from_geodetic(points: ArrayLike) -> FloatArray:
    """Earth-centred coordinates of geodetic ones.

    points : (N, 3) or (3,), GEODETIC: longitude and latitude in degrees, ellipsoidal height in metres
    returns : same shape, float64, ECEF, metres (EPSG:4979 to EPSG:4978)

    Raises PlacementError for latitudes beyond the poles and numbers that are not finite.
    """
    return _converted(points, "FORWARD", "geodetic coordinates")


def geodetic_from_ecef(points: ArrayLike) -> FloatArray:
    """Geodetic coordinates of earth-centred ones.

    points : (N, 3) or (3,), ECEF, metres
    returns : same shape, float64, GEODETIC: longitude in [-180, 180] and latitude in degrees, ellipsoidal height in
        metres (EPSG:4978 to EPSG:4979); on the earth's axis the longitude is undefined

    Accurate to float64 rounding from far below sea level to satellite orbits; not meant for the earth's core.
    Raises PlacementError for numbers that are not finite.
    """
    return _converted(points, "INVERSE", "ECEF coordinates")


def _sin_cos_deg(angle_deg: float) -> tuple[float, float]:
    # Exact at multiples of 90 degrees, where sin(pi) is 1e-16: the poles, the antimeridian and the cardinal
    # directions give clean matrices, and -180 and 180 the same one.
    rest = math.remainder(angle_deg, 90.0)
    quarter = round((angle_deg - rest) / 90.0) % 4
    sin, cos = math.sin(math.radians(rest)), math.cos(math.radians(rest))
    return ((sin, cos), (cos, -sin), (-sin, -cos), (-cos, sin))[quarter]


def enu_at(lon_deg: float, lat_deg: float, height_m: float = 0.0) -> Transform:
    """Transform ECEF from ENU at a place: a rotation and a translation.

    lon_deg, lat_deg : GEODETIC, degrees, in [-180, 180] and [-90, 90]
    height_m : above the ellipsoid, metres

    At a pole, east and north follow the given longitude: north is the limit along that meridian.
    Raises PlacementError for a place that does not exist.
    https://proj.org/en/stable/operations/conversions/topocentric.html
    """
    check_lonlat(lon_deg, lat_deg)
    sin_lon, cos_lon = _sin_cos_deg(lon_deg)
    sin_lat, cos_lat = _sin_cos_deg(lat_deg)
    matrix = np.eye(4)
    matrix[:3, 0] = (-sin_lon, cos_lon, 0.0)
    matrix[:3, 1] = (-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat)
    matrix[:3, 2] = (cos_lat * cos_lon, cos_lat * sin_lon, sin_lat)
    matrix[:3, 3] = ecef_from_geodetic((lon_deg, lat_deg, height_m))
    return Transform(ECEF, ENU, matrix)


def tile_from_asset() -> Transform:
    """Rotation from y-up to z-up, (x, y, z) to (x, -z, y), that 3D Tiles applies to glTF content.

    https://docs.ogc.org/cs/22-025r4/22-025r4.html#core-gltf-transforms
    """
    return Transform(TILE, ASSET, np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], np.float64))


def enu_from_tile(placement: GeoPlacement) -> Transform:
    """Rotation about the up axis after which the nose points to `placement.heading_deg`."""
    sin, cos = _sin_cos_deg(180.0 - placement.heading_deg)
    matrix = np.eye(4)
    matrix[:2, :2] = ((cos, -sin), (sin, cos))
    return Transform(ENU, TILE, matrix)


def ecef_from_tile(placement: GeoPlacement) -> Transform:
    """Transform of a 3D Tiles root tile whose content is in the ASSET frame; `column_major` serialises it."""
    return enu_at(placement.lon_deg, placement.lat_deg, placement.height_m) @ enu_from_tile(placement)


def ecef_from_asset(placement: GeoPlacement) -> Transform:
    """Transform of the asset's vertices to ECEF: `ecef_from_tile` after `tile_from_asset`."""
    return ecef_from_tile(placement) @ tile_from_asset()


def nose_bearing_deg(transform: Transform) -> float:
    """Compass bearing of the figure's front, read back from a transform.

    transform : target ENU or ECEF, source ASSET or TILE
    returns : degrees clockwise from north in [0, 360). From ECEF the place is taken from the transform's origin,
        so within a micrometre of the earth's axis the bearing is as undefined as the longitude.

    Raises ValueError for other frames, and where the front points straight up or down.
    """
    if transform.source not in (ASSET, TILE) or transform.target not in (ENU, ECEF):
        raise ValueError(f"{transform.target}_from_{transform.source}: expected ENU or ECEF from ASSET or TILE")
    front = transform.apply_vectors((0.0, 0.0, 1.0) if transform.source == ASSET else (0.0, -1.0, 0.0))
    if transform.target == ECEF:
        lon, lat, height = geodetic_from_ecef(transform.matrix[:3, 3]).tolist()
        front = enu_at(lon, lat, height).inverse().apply_vectors(front)
    east, north, up = front.tolist()
    # 1e-9 of the length: below that rounding of an ECEF rotation, not the figure, decides the direction.
    if math.hypot(east, north) <= 1e-9 * math.hypot(east, north, up):
        raise ValueError(f"{transform.target}_from_{transform.source}: the front points along the vertical")
    return normalized_bearing(math.degrees(math.atan2(east, north)))


def cesium_entity_heading_deg(placement: GeoPlacement) -> float:
    """Heading of a CesiumJS Entity or Model of the asset, degrees in [0, 360): it faces east at heading 0.

    Not for tilesets, which face south unrotated: use `ecef_from_tile` there.
    """
    return normalized_bearing(placement.heading_deg - 90.0)
