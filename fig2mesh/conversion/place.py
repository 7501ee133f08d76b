"""Where the figure of a request stands: at --lonlat, or where a georeferenced map shows it.

`open_map` refuses what can be refused before the figure is read; `place` is for a figure that has been read.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fig2mesh.conversion.request import PlaceRequest
from fig2mesh.errors import InputError
from fig2mesh.skeleton import FIGURE_HEIGHT
from georef.bearing import parse_facing
from georef.heights import ellipsoidal_height
from georef.placement import GeoPlacement

if TYPE_CHECKING:
    from fig2mesh.records import Figure
    from georef.mapsheet import MapSheet, SheetPlace


log = logging.getLogger("fig2mesh")


@dataclass(frozen=True)
class Placed:
    """placement : None where no place was asked for; height_m : of the figure; map : what the report says of the map,
    None without; notes : what the user is to be told, one line each; summary : the map in one line, may be empty."""

    placement: GeoPlacement | None
    height_m: float
    map: dict[str, Any] | None = None
    notes: tuple[str, ...] = ()
    summary: str = ""

    @property
    def metadata(self) -> dict[str, Any]:
        """What is kept in the outputs of the map that a place is from."""
        if self.map is None:
            return {}
        return {"map": {key: self.map[key] for key in ("sheet", "pixel", "method", "rmse_m")}}


def log_place(placed: Placed, *more: str | None) -> None:
    """Log what the user is to know of a place."""
    if placed.summary:
        log.info("%s", placed.summary)
    for note in (*placed.notes, *more):
        if note:
            log.warning("%s", note)


def open_map(request: PlaceRequest) -> MapSheet | None:
    """Check the options of a place, and read the sheet that they name, if any."""
    if request.map is None:
        for name, given in (("--at", request.at), ("--map-crs", request.map_crs)):
            if given is not None:
                raise InputError(name, "given without a map", "pass --map SHEET as well")
        if request.size_from == "map" or request.map_transform != "auto":
            name = "--size-from map" if request.size_from == "map" else "--map-transform"
            raise InputError(name, "given without a map", "pass --map SHEET as well")
        placement_of(request)
        return None
    if request.lonlat is not None:
        raise InputError("--map", "beside --lonlat", "give the place once")
    if request.size_from == "map" and request.height_m is not None:
        raise InputError("--size-from map", "beside --height-m", "give the size once")
    # Everything but the place itself is checked as for a place that is known.
    placement_of(request, (0.0, 0.0), dry=True)
    from georef.mapsheet import read_sheet

    return read_sheet(request.map, transform=request.map_transform, map_crs=request.map_crs)


def place(request: PlaceRequest, sheet: MapSheet | None, figure: Figure, path: Path) -> Placed:
    """The place and size of a figure.

    sheet : from `open_map`
    path : the picture of the figure
    """
    if sheet is None:
        return Placed(placement_of(request), FIGURE_HEIGHT if request.height_m is None else request.height_m)
    from fig2mesh.asset_frame import foot_on_picture, height_on_picture

    drawn_on_it = sheet.picture is not None and path.exists() and path.samefile(sheet.picture)
    notes = list(sheet.notes)
    if request.at is not None:
        pixel, source = request.at, "--at"
    elif drawn_on_it:
        pixel, source = foot_on_picture(figure), f"{path}: the feet"
    else:
        found = f"{path.name} is not the picture of {sheet.file.name}"
        raise InputError("--map", found, "pass --at X Y, the pixel of the sheet where the feet are")
    spot = sheet.place(*pixel, source=source)
    notes += spot.notes
    height = FIGURE_HEIGHT if request.height_m is None else request.height_m
    if request.size_from == "map":
        height = height_on_picture(figure) * spot.up_m
        if not drawn_on_it:
            notes.append(f"--size-from map: a pixel of {path.name} is taken for a pixel of the sheet")
    placement = placement_of(request, (spot.lon_deg, spot.lat_deg), height=height, viewer_deg=spot.down_bearing_deg)
    record = _record(request, sheet, spot, pixel)
    return Placed(placement, height, record, tuple(notes), _summary(sheet, spot))


def clamp_note(request: PlaceRequest, targets: Sequence[str]) -> str | None:
    """One line on outputs that cannot follow terrain, where that is asked for."""
    if request.altitude_mode != "clamp":
        return None
    others = [target for target in targets if not target.lower().endswith(".czml")]
    if not others:
        return None
    return f"--altitude-mode clamp: only CZML follows terrain; --altitude is above the ellipsoid in {', '.join(others)}"


def placement_of(
    request: PlaceRequest,
    lonlat: tuple[float, float] | None = None,
    *,
    height: float | None = None,
    viewer_deg: float = 180.0,
    dry: bool = False,
) -> GeoPlacement | None:
    """The placement at a place, by default --lonlat; None without one. dry: heights are not converted."""
    heading = parse_facing(request.facing, viewer_deg=viewer_deg)
    height_m = height if height is not None else FIGURE_HEIGHT if request.height_m is None else request.height_m
    if not 0.001 <= height_m <= 1e6:
        option = "--height-m" if request.size_from == "height" else "--size-from map"
        raise InputError(option, f"{height_m:g} m", "give a height between 1 mm and 1000 km")
    lonlat = request.lonlat if lonlat is None else lonlat
    datum, altitude = request.altitude_datum, request.altitude
    if lonlat is None:
        if altitude or datum != "ellipsoid" or request.altitude_mode != "absolute":
            option = "--altitude" if altitude or datum != "ellipsoid" else "--altitude-mode"
            raise InputError(option, "given without a place", "pass --lonlat LON LAT as well, or --map SHEET")
        return None
    if not -12_000 <= altitude <= 1e7:
        raise InputError("--altitude", f"{altitude:g} m", "give metres above the datum, at most 10,000 km")
    if request.altitude_mode == "clamp" and datum != "ellipsoid":
        raise InputError("--altitude-mode clamp", f"beside --altitude-datum {datum}", "heights above terrain have none")
    place = GeoPlacement(*lonlat, altitude, "ellipsoid", heading, height_m, request.altitude_mode)
    if dry:
        return place
    metres = ellipsoidal_height(*lonlat, altitude, datum)
    name = datum if datum in ("ellipsoid", "egm96") else Path(datum).name
    return GeoPlacement(place.lon_deg, place.lat_deg, metres, name, heading, height_m, request.altitude_mode)


def _record(request: PlaceRequest, sheet: MapSheet, spot: SheetPlace, pixel: tuple[float, float]) -> dict[str, Any]:
    """What the report says of the map; lengths in metres on the ground."""
    quality = sheet.quality
    assert request.map is not None
    return {
        "sheet": (sheet.picture or sheet.file).name,
        "georeference": sheet.file.name,
        "crs": sheet.crs,
        "method": sheet.method,
        "fitted_in": sheet.plane.name,
        "control_points": len(sheet.pixels),
        "degrees_of_freedom": None if quality is None else quality.degrees_of_freedom,
        "rmse_m": None if quality is None else quality.rmse_m,
        "sigma_m": None if quality is None else quality.sigma_m,
        "left_out_rmse_m": None if quality is None else quality.leave_one_out_rmse_m,
        "residuals_m": [] if quality is None else list(quality.residuals_m),
        "left_out_m": [] if quality is None else list(quality.leave_one_out_m),
        "pixel": list(pixel),
        "lonlat": [spot.lon_deg, spot.lat_deg],
        "metres_per_pixel": {"up": spot.up_m, "across": spot.across_m},
        "up_bearing_deg": spot.up_bearing_deg,
        "stretch": spot.stretch,
        "mirrored": spot.mirrored,
        "inside_hull": None if spot.outside_m is None else spot.outside_m == 0.0,
        "outside_m": spot.outside_m,
        "size_from": request.size_from,
        "notes": [*sheet.notes, *spot.notes],
    }


def _summary(sheet: MapSheet, spot: SheetPlace) -> str:
    where = f"{spot.lon_deg:.6f} {spot.lat_deg:.6f}, {spot.up_m:.4g} m a pixel, up is {spot.up_bearing_deg:.1f}°"
    if sheet.quality is None:
        return f"{sheet.file}: {where}"
    quality, count = sheet.quality, len(sheet.pixels)
    if quality.leave_one_out_rmse_m is not None:
        fit = f"each missed by {quality.leave_one_out_rmse_m:.3g} m (RMS) when left out"
    elif quality.degrees_of_freedom == 0:
        fit = "no more than it needs, so nothing checks it"
    else:
        fit = f"missed by {quality.rmse_m:.3g} m (RMS)"
    return f"{sheet.file}: {where}; {sheet.method} of {count} control points, {fit}"
