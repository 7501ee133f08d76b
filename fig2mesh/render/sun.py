"""Position of the sun, and direction of its light on a figure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime

from fig2mesh.errors import InputError


@dataclass(frozen=True)
class Sun:
    """azimuth_deg : compass bearing of the sun; elevation_deg : above the horizon, with refraction."""

    azimuth_deg: float
    elevation_deg: float

    @property
    def up(self) -> bool:
        """Whether its centre is above the horizon."""
        return self.elevation_deg > 0.0


def parse_time(text: str, source: str = "--time") -> datetime:
    """Parse an ISO 8601 time to UTC. Raises InputError for invalid times, and for times without a UTC offset."""
    try:
        time = datetime.fromisoformat(text.strip())
    except ValueError:
        raise InputError(source, f"{text!r} is not an ISO 8601 time", "write 2026-06-21T14:00+02:00") from None
    if time.utcoffset() is None:
        raise InputError(source, f"{text!r} has no time zone", "end it with Z or with an offset such as +02:00")
    try:
        return time.astimezone(UTC)
    except OverflowError:
        raise InputError(source, f"{text!r} is out of range", "give a year between 2 and 9998") from None


def sun_at(lon_deg: float, lat_deg: float, time: datetime) -> Sun:
    """Position of the sun at a place on WGS 84 and a time in UTC.

    By `astral`, after the NOAA solar calculator (Meeus): within 0.01 degrees of NREL's SPA from 1900 to 2100, and
    0.2 degrees at the very poles.
    """
    from astral import Observer
    from astral.sun import zenith_and_azimuth

    zenith, azimuth = zenith_and_azimuth(Observer(lat_deg, lon_deg, 0.0), time)
    return Sun(azimuth % 360.0, 90.0 - zenith)


def towards_sun(sun: Sun, facing_deg: float) -> tuple[float, float, float]:
    """Unit vector towards the sun in FIGURE's (and ASSET's) axes: left of the figure, up, where its nose points.

    facing_deg : compass bearing of the nose
    """
    turn, rise = math.radians(sun.azimuth_deg - facing_deg), math.radians(sun.elevation_deg)
    # The figure's left is 90 degrees before its nose on the compass.
    return -math.cos(rise) * math.sin(turn), math.sin(rise), math.cos(rise) * math.cos(turn)
