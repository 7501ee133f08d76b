"""Reference systems of sheets, and the planes in which transformations are fitted, from and to WGS 84.

Every conversion excludes pyproj's ballpark transformations: where no accurate one is known, that is an error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from georef.errors import PlacementError
from georef.sheets.controls import FloatArray
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import parse_json

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

OPTION = "--map-crs"

MAX_LOCAL_PLANE_DEG = 60.0
"""Largest distance of control points from their centre in a local plane. Beyond it the sheet is a map of the world, and
no local plane comes close to its projection."""

MAX_TEXT = 100_000
"""Limit of the text of a reference system; the longest WKT of the EPSG registry has 20,000 characters."""

MAX_SEAMS = 24
"""Limit of gaps between longitudes that are tried as the seam of a map of the world."""


@dataclass(frozen=True)
class Plane:
    """Plane of a sheet's coordinates, or a plane to fit in.

    name : for reports
    to_lonlat : (N, 2) coordinates → (N, 2) WGS 84 longitude and latitude, degrees, longitude in [-180, 180]
    from_lonlat : the inverse
    accuracy_m : accuracy of the transformation, known only after use; None: exact, or unknown
    geographic : coordinates are angles
    area : west, south, east, north of the area that its reference system is for, degrees; None: anywhere, or unknown
    """

    name: str
    to_lonlat: Callable[[FloatArray], FloatArray]
    from_lonlat: Callable[[FloatArray], FloatArray]
    accuracy_m: Callable[[], float | None]
    geographic: bool = False
    area: tuple[float, float, float, float] | None = None


def crs_of(text: str, source: object = OPTION) -> CRS:
    """The horizontal part of a reference system named by a code (EPSG:2056), WKT, PROJ string or PROJJSON.

    Raises PlacementError for unknown ones and those without coordinates on the earth.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    shown = " ".join(text[:200].split())[:60]
    try:
        if len(text) > MAX_TEXT:
            raise DamagedFile("the text is too long")
        if text.lstrip().startswith("{"):
            parse_json(text)
        crs = CRS.from_user_input(text.strip())
    except (
        CRSError,
        DamagedFile,
        RecursionError,
        UnicodeError,
        ValueError,
    ):  # pyproj parses text after a brace as JSON
        raise PlacementError(source, f"{shown!r} is not a reference system", "give a code such as EPSG:2056") from None
    if crs.is_compound:
        crs = crs.sub_crs_list[0]
    if crs.is_geocentric or not (crs.is_projected or crs.is_geographic):
        finding = f"{shown!r} is neither a projected nor a geographic reference system on the earth"
        raise PlacementError(source, finding, "give the sheet's projected or geographic reference system")
    return crs


def plane_of(crs: CRS, source: object = OPTION) -> Plane:
    """Return the plane of a reference system."""
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    try:
        transformer = Transformer.from_crs(crs, "EPSG:4326", always_xy=True, allow_ballpark=False)
    except ProjError:
        finding = f"no transformation from {crs.name} to WGS 84 is known"
        raise PlacementError(source, finding, "give a reference system that pyproj can transform to WGS 84") from None
    area = crs.area_of_use
    bounds = None if area is None else (area.west, area.south, area.east, area.north)
    return replace(_plane(crs.name, transformer, crs.is_geographic, source), area=bounds)


def fitting_plane(crs: CRS, source: object = OPTION) -> Plane:
    """Return the plane of a reference system's projection, in which points in longitude and latitude are fitted.

    The datum is ignored in both directions: a fit needs only the shape of the projection, so that it can be inverted
    exactly, and the projections of old maps are often defined on a sphere that has no transformation to WGS 84.
    """
    from pyproj import CRS, Transformer
    from pyproj.exceptions import CRSError, ProjError

    try:
        # Degrees from Greenwich on its ellipsoid: some systems count grads from Paris.
        ellipsoid = crs.ellipsoid
        radii = f"+a={ellipsoid.semi_major_metre!r} +b={ellipsoid.semi_minor_metre!r}"
        transformer = Transformer.from_crs(crs, CRS.from_proj4(f"+proj=longlat {radii} +no_defs"), always_xy=True)
    except (ProjError, CRSError, AttributeError):
        raise PlacementError(
            source, f"the projection of {crs.name} cannot be computed", "give another projection"
        ) from None
    return _plane(f"{crs.name}, its projection alone", transformer, False, source)


def local_plane(lonlat: FloatArray, pixels: FloatArray) -> Plane:
    """Return a plane for control points in longitude and latitude, (N, 2) each, degrees and IMAGE.

    A stereographic projection about their centre: conformal, so that a similarity of the sheet stays one, and without
    special cases at the poles and the antimeridian. For points farther than `MAX_LOCAL_PLANE_DEG` from their centre,
    plate carrée, with the seam inferred from the pixels.
    """
    from pyproj import Transformer

    lon, lat = np.radians(lonlat.T)
    points = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=1)
    middle = points.mean(axis=0)
    length = float(np.linalg.norm(middle))
    farthest = 180.0
    if length > 1e-3:
        farthest = float(np.degrees(np.arccos(np.clip(points @ middle / length, -1.0, 1.0)).max()))
    if farthest > MAX_LOCAL_PLANE_DEG:
        return _plate_carree(lonlat, pixels)
    lon_0 = float(np.degrees(np.arctan2(middle[1], middle[0])))
    lat_0 = float(np.degrees(np.arcsin(np.clip(middle[2] / length, -1.0, 1.0))))
    transformer = Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        f"+step +proj=stere +lat_0={lat_0:.9f} +lon_0={lon_0:.9f} +k=1 +ellps=WGS84"
    )
    return _plane(f"stereographic about {lon_0:.4f} {lat_0:.4f}", transformer, False, "control points", inverse=True)


def _plate_carree(lonlat: FloatArray, pixels: FloatArray) -> Plane:
    # The seam is in the gap between longitudes whose linear fit to the pixels has the smallest residual.
    ordered = np.sort(lonlat[:, 0])
    gaps = np.diff(np.append(ordered, ordered[0] + 360.0))
    basis = np.concatenate([pixels - pixels.mean(axis=0), np.ones((len(pixels), 1))], axis=1)
    best, middle = np.inf, 0.0
    for index in np.argsort(-gaps)[:MAX_SEAMS]:
        opposite = float(ordered[index] + gaps[index] / 2 + 180.0)
        turned = (lonlat[:, 0] - opposite + 180.0) % 360.0 - 180.0
        residual = turned - basis @ np.linalg.lstsq(basis, turned, rcond=None)[0]
        if (square := float(residual @ residual)) < best:
            best, middle = square, (opposite + 180.0) % 360.0 - 180.0

    def to_lonlat(points: FloatArray) -> FloatArray:
        return _checked(np.stack([points[:, 0] + middle, points[:, 1]], axis=1), "control points")

    def from_lonlat(points: FloatArray) -> FloatArray:
        return np.stack([(points[:, 0] - middle + 180.0) % 360.0 - 180.0, points[:, 1]], axis=1)

    return Plane(f"longitude and latitude about {middle:.4f}", to_lonlat, from_lonlat, lambda: None)


def _plane(name: str, transformer: Transformer, geographic: bool, source: object, inverse: bool = False) -> Plane:
    def convert(points: FloatArray, back: bool) -> FloatArray:
        direction = "INVERSE" if back != inverse else "FORWARD"
        return np.stack(transformer.transform(points[:, 0], points[:, 1], direction=direction), axis=1)

    def from_lonlat(points: FloatArray) -> FloatArray:
        result = convert(points, back=True)
        if not np.isfinite(result).all():
            finding = f"{points[~np.isfinite(result).all(axis=1)][0].tolist()} is outside the area of {name}"
            raise PlacementError(source, finding, "give the reference system of this sheet")
        return result

    def accuracy() -> float | None:
        from pyproj.exceptions import ProjError

        try:
            accuracy = float(transformer.get_last_used_operation().accuracy)
        except ProjError:
            return None
        return accuracy if accuracy > 0 else None

    def to_lonlat(points: FloatArray) -> FloatArray:
        return _checked(convert(points, back=False), source, name)

    return Plane(name, to_lonlat, from_lonlat, accuracy, geographic)


def _checked(lonlat: FloatArray, source: object, name: str = "the map") -> FloatArray:
    """Wrap longitudes into [-180, 180]; PlacementError for coordinates without a place on the earth."""
    # Up to two turns: some files continue beyond the antimeridian.
    bad = ~np.isfinite(lonlat).all(axis=1) | (np.abs(lonlat[:, 1]) > 90.0 + 1e-9) | (np.abs(lonlat[:, 0]) > 720.0)
    if bad.any():
        finding = f"a point of the sheet is outside the area of {name}"
        raise PlacementError(source, finding, f"check the reference system, or give another one with {OPTION}")
    lon = np.where(np.abs(lonlat[:, 0]) > 180.0, (lonlat[:, 0] + 180.0) % 360.0 - 180.0, lonlat[:, 0])
    return np.stack([lon, np.clip(lonlat[:, 1], -90.0, 90.0)], axis=1)
