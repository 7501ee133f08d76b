"""Placement of a figure: position and heading."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from georef.bearing import normalized_bearing
from georef.errors import PlacementError

AltitudeMode = Literal["absolute", "clamp"]


def check_lonlat(lon_deg: float, lat_deg: float, source: str = "--lonlat") -> None:
    """Raise PlacementError unless both are finite, longitude in [-180, 180] and latitude in [-90, 90] degrees.

    source : origin of the numbers, for the error message
    """
    if not (math.isfinite(lon_deg) and math.isfinite(lat_deg)):
        raise PlacementError(source, f"not a finite number in {(lon_deg, lat_deg)}", "give finite numbers")
    if abs(lat_deg) > 90:
        swapped = abs(lon_deg) <= 90 and abs(lat_deg) <= 180
        remedy = "give longitude first, then latitude" if swapped else "latitudes lie in -90..90"
        raise PlacementError(source, f"latitude {lat_deg:.15g} is outside -90..90", remedy)
    if abs(lon_deg) > 180:
        raise PlacementError(source, f"longitude {lon_deg:.15g} is outside -180..180", "longitudes lie in -180..180")


@dataclass(frozen=True)
class GeoPlacement:
    """Position and heading of a figure on the WGS 84 ellipsoid.

    lon_deg, lat_deg : GEODETIC, degrees; longitude in [-180, 180], latitude in [-90, 90]
    height_m : height of the feet above the ellipsoid, metres
    height_datum : datum in which the height was given before conversion: "ellipsoid", "egm96" or a grid's file name
    heading_deg : compass bearing the nose points to, degrees clockwise from north, in [0, 360)
    figure_height_m : height of the drawn figure, metres
    altitude_mode : "absolute", the feet are at `height_m`; "clamp", they are `height_m` above the terrain that
        the client shows there, where the format supports it (CZML)
    """

    lon_deg: float
    lat_deg: float
    height_m: float = 0.0
    height_datum: str = "ellipsoid"
    heading_deg: float = 180.0
    figure_height_m: float = 1.79
    altitude_mode: AltitudeMode = "absolute"

    def __post_init__(self) -> None:
        values = (self.lon_deg, self.lat_deg, self.height_m, self.heading_deg, self.figure_height_m)
        if not all(math.isfinite(value) for value in values):
            raise PlacementError("placement", f"not a finite number in {values}", "give finite numbers")
        check_lonlat(self.lon_deg, self.lat_deg)
        if self.figure_height_m <= 0:
            raise PlacementError(
                "--height-m", f"{self.figure_height_m:g} m is not positive", "give a positive height in metres"
            )
        if self.altitude_mode not in get_args(AltitudeMode):
            raise PlacementError("--altitude-mode", f"unknown mode {self.altitude_mode!r}", "give absolute or clamp")
        object.__setattr__(self, "heading_deg", normalized_bearing(self.heading_deg))
