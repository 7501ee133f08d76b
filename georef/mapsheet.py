"""Georeferenced map sheets: conversion of pixels to places on the earth.

The transformation runs from IMAGE to a plane (MAP, or one fitted about the control points), the plane's projection
from there to GEODETIC. Scale, bearing and distortion at a pixel are measured on the ellipsoid itself, by finite
differences of one pixel, so they include the convergence of the meridians.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from georef.bearing import normalized_bearing
from georef.errors import PlacementError
from georef.geodesy import ecef_from_geodetic, enu_at
from georef.sheets.agreement import MAX_STRETCH, area_notes, check_controls
from georef.sheets.controls import Affine, Controls, FloatArray, on_picture
from georef.sheets.find import OPTION, SheetFiles, find_georeference
from georef.sheets.fit import METHODS, Map, fit
from georef.sheets.hull import convex_hull, nearest_in
from georef.sheets.quality import FitQuality, distances_m, fit_quality
from georef.sheets.reference import Plane, crs_of, fitting_plane, local_plane, plane_of

if TYPE_CHECKING:
    from pyproj import CRS

TRANSFORMS = ("auto", *METHODS)

MAX_RESIDUAL_SHARE = 0.03
"""Warning threshold: root mean square residual as a share of the control points' extent. Above it, the points or the
reference system probably do not belong to this sheet: pictorial maps are drawn freely, but not that freely."""

MAX_LON, MAX_LAT = 800.0, 100.0
"""Larger numbers cannot be angles in degrees or grads, in any reference system."""

MAX_SILENT_ACCURACY_M = 1.0
"""Threshold above which the accuracy of a datum transformation is reported."""


@dataclass(frozen=True)
class SheetPlace:
    """Place on the earth of a pixel of a sheet.

    lon_deg, lat_deg : GEODETIC
    up_bearing_deg : compass bearing of the sheet's "up", degrees clockwise from north, in [0, 360)
    down_bearing_deg : of its "down", towards the reader
    up_m, across_m : size of a pixel on the ground along and across "up", metres
    stretch : ratio of the largest to the smallest local scale; 1 where the map is conformal
    mirrored : the sheet shows the ground mirrored
    outside_m : distance on the ground to the hull of the control points; 0 inside; None where there are none
    notes : warnings about this place, one line each
    """

    lon_deg: float
    lat_deg: float
    up_bearing_deg: float
    down_bearing_deg: float
    up_m: float
    across_m: float
    stretch: float
    mirrored: bool
    outside_m: float | None
    notes: tuple[str, ...]


@dataclass(frozen=True)
class MapSheet:
    """Picture of a map with a known georeference.

    file : the file that the georeference was read from; picture : None where it is not available
    size : of the picture, px; None if unknown
    method : of the transformation; "given" where the file has the map itself
    crs : of the file's coordinates; plane : target of the transformation
    pixels : (N, 2) control points, IMAGE; none where the map is given
    notes : warnings about the sheet, one line each
    """

    file: Path
    picture: Path | None
    size: tuple[float, float] | None
    method: str
    crs: str
    plane: Plane
    to_plane: Map
    pixels: FloatArray
    quality: FitQuality | None
    notes: tuple[str, ...]

    def lonlat(self, pixels: FloatArray) -> FloatArray:
        """(N, 2) GEODETIC longitude and latitude, degrees, of (N, 2) IMAGE pixels.

        Raises PlacementError for pixels without a place on the earth.
        """
        return self.plane.to_lonlat(self.to_plane(np.asarray(pixels, np.float64).reshape(-1, 2)))

    def place(self, x: float, y: float, source: str = "--at") -> SheetPlace:
        """Place of a pixel of the sheet, with the scale and bearing of the sheet there.

        x, y : IMAGE, px
        Raises PlacementError for pixels off the sheet or off the earth, and where the map folds.
        """
        if not (math.isfinite(x) and math.isfinite(y)):
            raise PlacementError(source, f"{x:g} {y:g} is not a pixel", "give finite numbers")
        if self.size is not None and not (0 <= x <= self.size[0] and 0 <= y <= self.size[1]):
            finding = f"{x:g} {y:g} is not on the sheet of {self.size[0]:g}×{self.size[1]:g} px"
            raise PlacementError(source, finding, "give X from the left and Y from the top, in pixels")
        around = np.array([[x, y], [x - 0.5, y], [x + 0.5, y], [x, y - 0.5], [x, y + 0.5]])
        lonlat = self.lonlat(around)
        lon, lat = lonlat[0].tolist()
        ground = _on_ground(lonlat, lon, lat)
        right, down = ground[2] - ground[1], ground[4] - ground[3]
        matrix = np.stack([right, down], axis=1)
        scales = np.linalg.svd(matrix, compute_uv=False)
        if not np.isfinite(scales).all() or scales[1] <= 1e-9 * scales[0] or scales[1] == 0:
            raise PlacementError(source, f"the map folds or ends at {x:g} {y:g}", "check the georeference of the sheet")
        mirrored = bool(np.linalg.det(matrix) > 0)
        notes = []
        if mirrored:
            notes.append(f"{self.file}: at {x:g} {y:g} the map is mirrored; check the control points")
        stretch = float(scales[0] / scales[1])
        if stretch > MAX_STRETCH and not self.plane.geographic and self.method in ("given", "affine", "poly1"):
            notes.append(f"{self.file}: the map is stretched {stretch:.3g} times; check that it is of this picture")
        outside = self._outside(np.array([x, y]), lonlat[:1])
        if outside:
            notes.append(f"{self.file}: {x:g} {y:g} lies {_metres(outside)} outside the control points' hull")
        accuracy = self.plane.accuracy_m()
        if accuracy is not None and accuracy > MAX_SILENT_ACCURACY_M:
            notes.append(f"{self.crs}: known to {accuracy:g} m against WGS 84 without grids that are not available")
        up = _bearing(-down)
        return SheetPlace(
            lon,
            lat,
            up,
            normalized_bearing(up + 180.0),
            float(np.linalg.norm(down)),
            float(np.linalg.norm(right)),
            stretch,
            mirrored,
            outside,
            tuple(notes),
        )

    def _outside(self, pixel: FloatArray, lonlat: FloatArray) -> float | None:
        if not len(self.pixels):
            return None
        nearest = nearest_in(convex_hull(self.pixels), pixel)
        if np.array_equal(nearest, pixel):
            return 0.0
        return float(distances_m(self.lonlat(nearest[None]), lonlat)[0])


def read_sheet(sheet: Path, *, transform: str = "auto", map_crs: str | None = None) -> MapSheet:
    """Read the georeference of a sheet.

    sheet : the picture, or a .points file, annotation or world file; see `georef.sheets.find`
    transform : one of `TRANSFORMS`; auto: that requested by the file, else affine, helmert for two points
    map_crs : reference system of the sheet's coordinates, where its files give none or a wrong one; for control
        points in longitude and latitude, the projection in which the transformation is fitted

    Raises PlacementError where the georeference is missing, ambiguous, damaged or insufficient.
    """
    found = find_georeference(sheet)
    notes: list[str] = list(found.notes)
    if isinstance(found.georeference, Affine):
        return _affine_sheet(found.georeference, found, transform, map_crs)
    controls = found.georeference
    if found.size is not None:
        controls = on_picture(controls, found.size, found.file)
    notes += check_controls(controls, found.size or controls.size, found.file)
    if controls.disabled:
        notes.append(f"{found.file}: {controls.disabled} control points are disabled")
    method = _choose_method(controls, transform, found.file, notes)
    crs, plane, coordinates = _plane_for(controls, found.crs, map_crs, found.file, notes)
    fitted = fit(method, controls.pixels, coordinates, found.file)
    quality = fit_quality(fitted, plane, controls.pixels, coordinates)
    given = plane.to_lonlat(coordinates)
    notes += area_notes(found.file, crs, plane, plane.to_lonlat(coordinates.mean(axis=0)[None]))
    extent = float(distances_m(given, np.broadcast_to(given[:1], given.shape)).max())
    worst = max(quality.rmse_m, quality.leave_one_out_rmse_m or 0.0)
    if worst > MAX_RESIDUAL_SHARE * extent:
        notes.append(
            f"{found.file}: control point residuals are {_metres(worst)}, {worst / extent:.0%} of their extent; "
            "check the points and the reference system"
        )
    size = found.size if found.size is not None else controls.size
    return MapSheet(
        found.file, found.picture, size, method, crs, plane, fitted.apply, controls.pixels, quality, tuple(notes)
    )


def _affine_sheet(affine: Affine, found: SheetFiles, transform: str, map_crs: str | None) -> MapSheet:
    file, matrix = found.file, affine.matrix
    if transform != "auto":
        finding = f"{file.name} gives the affine map itself, without control points"
        raise PlacementError(f"--map-transform {transform}", finding, "omit --map-transform")
    notes: list[str] = list(found.notes)
    crs = _choose_crs(found.crs, map_crs, file, notes)
    plane = plane_of(crs, file)

    def to_plane(points: FloatArray) -> FloatArray:
        return np.asarray(points @ matrix[:, :2].T + matrix[:, 2])

    with suppress(PlacementError):  # the place itself reports it
        middle = np.array([found.size or (0.0, 0.0)]) / 2
        notes += area_notes(file, crs.name, plane, plane.to_lonlat(to_plane(middle)))
    return MapSheet(
        file,
        found.picture,
        found.size,
        "given",
        crs.name,
        plane,
        to_plane,
        np.empty((0, 2)),
        None,
        tuple(notes),
    )


def _choose_crs(named: str | None, map_crs: str | None, file: Path, notes: list[str]) -> CRS:
    """Reference system of the coordinates: --map-crs, or the one named in the files."""
    if map_crs is None and named is None:
        finding = "no reference system in the file or in a .prj file"
        raise PlacementError(f"{OPTION} {file}", finding, "give --map-crs, such as EPSG:2056, or add a .prj file")
    if map_crs is None:
        return crs_of(str(named), file)
    crs = crs_of(map_crs)
    own = _named_crs(named, file)
    if own is not None and own != crs:
        notes.append(f"{file}: reference system {own.name} is overridden by --map-crs")
    return crs


def _named_crs(named: str | None, file: Path) -> CRS | None:
    """Reference system named in the files; None where they name none or an unknown one."""
    with suppress(PlacementError):
        return None if named is None else crs_of(named, file)
    return None


def _choose_method(controls: Controls, transform: str, file: Path, notes: list[str]) -> str:
    if transform != "auto":
        return transform
    if controls.method in METHODS:
        return controls.method
    if controls.method is not None:
        notes.append(f"{file}: unknown transformation {controls.method}; affine is used")
    return "helmert" if len(controls.pixels) == 2 else "affine"


def _plane_for(
    controls: Controls, named: str | None, map_crs: str | None, file: Path, notes: list[str]
) -> tuple[str, Plane, FloatArray]:
    """Name of the points' reference system, the plane to fit in, and the points in it."""
    own = None if map_crs is None else _named_crs(named, file)
    if own is not None and own.is_geographic and (np.abs(controls.coordinates) <= (MAX_LON, MAX_LAT)).all():
        crs, wanted, source = own, map_crs, "--map-crs"
    else:
        crs, wanted, source = _choose_crs(named, map_crs, file, notes), controls.plane, str(file)
    plane = plane_of(crs, file)
    if not plane.geographic:
        return crs.name, plane, controls.coordinates
    lonlat = plane.to_lonlat(controls.coordinates)
    target = None if wanted is None else crs_of(wanted, source)
    fitted = local_plane(lonlat, controls.pixels) if target is None or target.is_geographic else fitting_plane(target)
    return crs.name, fitted, fitted.from_lonlat(lonlat)


def _on_ground(lonlat: FloatArray, lon: float, lat: float) -> FloatArray:
    """(N, 2) metres east and north of a place, in the tangent plane of the ellipsoid there."""
    ecef = ecef_from_geodetic(np.concatenate([lonlat, np.zeros((len(lonlat), 1))], axis=1))
    return enu_at(lon, lat).inverse().apply(ecef)[:, :2]


def _bearing(vector: FloatArray) -> float:
    return normalized_bearing(math.degrees(math.atan2(vector[0], vector[1])))


def _metres(value: float) -> str:
    return f"{value / 1000:.3g} km" if value >= 1000 else f"{value:.3g} m"
