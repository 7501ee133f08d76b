"""Placement of a request's figure: at --lonlat, or where a georeferenced map shows it.

`open_map` checks what can be checked before the figure is read; `place` needs the figure.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from exporters.text import plain_text
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
    """Placement of a figure.

    placement : None where no place was requested; height_m : of the figure; map : facts of the map for the report,
        None without a map
    notes : for the user, one line each; summary : of the map, one line, may be empty
    """

    placement: GeoPlacement | None
    height_m: float
    map: dict[str, Any] | None = None
    notes: tuple[str, ...] = ()
    summary: str = ""

    @property
    def metadata(self) -> dict[str, Any]:
        """Facts of the map for the metadata of the outputs; empty without a map."""
        if self.map is None:
            return {}
        return {"map": {key: self.map[key] for key in ("sheet", "pixel", "method", "rmse_m")}}


def log_place(placed: Placed, *more: str | None) -> None:
    """Log the summary of a place, and its notes as warnings."""
    if placed.summary:
        log.info("%s", placed.summary)
    for note in (*placed.notes, *more):
        if note:
            log.warning("%s", note)


def open_map(request: PlaceRequest) -> MapSheet | None:
    """Check the options of a place, and read the map sheet that they name, if any."""
    if request.map is None:
        for name, given in (("--at", request.at), ("--map-crs", request.map_crs)):
            if given is not None:
                raise InputError(name, "requires --map", "add --map SHEET")
        if request.size_from == "map" or request.map_transform != "auto":
            name = "--size-from map" if request.size_from == "map" else "--map-transform"
            raise InputError(name, "requires --map", "add --map SHEET")
        placement_of(request)
        return None
    if request.lonlat is not None:
        raise InputError("--map", "cannot be combined with --lonlat", "give one of the two")
    if request.size_from == "map" and request.height_m is not None:
        raise InputError("--size-from map", "cannot be combined with --height-m", "give one of the two")
    # Everything but the place itself is checked as for a place that is known.
    placement_of(request, (0.0, 0.0), dry=True)
    from georef.mapsheet import read_sheet

    return read_sheet(request.map, transform=request.map_transform, map_crs=request.map_crs)


def place(request: PlaceRequest, sheet: MapSheet | None, figure: Figure, path: Path) -> Placed:
    """Place and size of a figure.

    sheet : from `open_map`
    path : the picture of the figure
    """
    if sheet is None:
        return Placed(placement_of(request), FIGURE_HEIGHT if request.height_m is None else request.height_m)
    from fig2mesh.asset_frame import foot_on_picture, height_on_picture

    drawn_on_it = is_drawn_on(sheet, request.at, path)
    notes = list(sheet.notes)
    if request.at is not None:
        pixel, source = request.at, "--at"
    else:
        pixel, source = foot_on_picture(figure), f"{path}: the feet"
    location = sheet.place(*pixel, source=source)
    notes += location.notes
    height = FIGURE_HEIGHT if request.height_m is None else request.height_m
    if request.size_from == "map":
        height = height_on_picture(figure) * location.up_m
        if not drawn_on_it:
            name = plain_text(path.name)
            notes.append(f"--size-from map: a pixel of {name} is assumed to be as large as a pixel of the sheet")
    lonlat = location.lon_deg, location.lat_deg
    placement = placement_of(request, lonlat, height=height, viewer_deg=location.down_bearing_deg)
    record = _record(request, sheet, location, pixel)
    return Placed(placement, height, record, tuple(notes), _summary(sheet, location))


def is_drawn_on(sheet: MapSheet, at: tuple[float, float] | None, path: Path) -> bool:
    """Whether a figure's picture is the sheet itself. Raises InputError if it is not, and --at is missing."""
    drawn_on_it = sheet.picture is not None and path.exists() and path.samefile(sheet.picture)
    if at is None and not drawn_on_it:
        found = f"{path.name} is not the picture of {sheet.file.name}"
        raise InputError("--map", found, "give --at X Y, the pixel of the sheet where the feet are")
    return drawn_on_it


def clamp_note(request: PlaceRequest, targets: Sequence[str]) -> str | None:
    """Warning about outputs that cannot follow terrain, in one line, for --altitude-mode clamp; else None."""
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
    """Placement at `lonlat`, by default --lonlat; None without either. dry : do not convert heights."""
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
            raise InputError(option, "requires a place", "add --lonlat LON LAT or --map SHEET")
        return None
    if not -12_000 <= altitude <= 1e7:
        raise InputError("--altitude", f"{altitude:g} m", "give metres above the datum, at most 10,000 km")
    if request.altitude_mode == "clamp" and datum != "ellipsoid":
        raise InputError(
            "--altitude-mode clamp", f"cannot be combined with --altitude-datum {datum}", "leave out the datum"
        )
    place = GeoPlacement(*lonlat, altitude, "ellipsoid", heading, height_m, request.altitude_mode)
    if dry:
        return place
    metres = ellipsoidal_height(*lonlat, altitude, datum)
    name = datum if datum in ("ellipsoid", "egm96") else Path(datum).name
    return GeoPlacement(place.lon_deg, place.lat_deg, metres, name, heading, height_m, request.altitude_mode)


def _record(request: PlaceRequest, sheet: MapSheet, location: SheetPlace, pixel: tuple[float, float]) -> dict[str, Any]:
    """Facts of the map for the report; lengths in metres on the ground."""
    quality = sheet.quality
    assert request.map is not None
    return {
        "sheet": plain_text((sheet.picture or sheet.file).name),
        "georeference": plain_text(sheet.file.name),
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
        "lonlat": [location.lon_deg, location.lat_deg],
        "metres_per_pixel": {"up": location.up_m, "across": location.across_m},
        "up_bearing_deg": location.up_bearing_deg,
        "stretch": location.stretch,
        "mirrored": location.mirrored,
        "inside_hull": None if location.outside_m is None else location.outside_m == 0.0,
        "outside_m": location.outside_m,
        "size_from": request.size_from,
        "notes": [*sheet.notes, *location.notes],
    }


def _summary(sheet: MapSheet, location: SheetPlace) -> str:
    where = (
        f"{location.lon_deg:.6f} {location.lat_deg:.6f}, {location.up_m:.4g} m per pixel, "
        f"up is {location.up_bearing_deg:.1f}°"
    )
    if sheet.quality is None:
        return f"{sheet.file}: {where}"
    quality, count = sheet.quality, len(sheet.pixels)
    if quality.leave_one_out_rmse_m is not None:
        fit = f"RMSE {quality.leave_one_out_rmse_m:.3g} m of points left out one by one"
    elif quality.degrees_of_freedom == 0:
        fit = "the minimum, so the fit cannot be checked"
    else:
        fit = f"RMSE {quality.rmse_m:.3g} m"
    return f"{sheet.file}: {where}; {sheet.method} fitted to {count} control points, {fit}"
