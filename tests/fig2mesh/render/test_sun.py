"""Position of the sun against published values and another library, and direction of its light on a figure."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest

from fig2mesh.errors import InputError
from fig2mesh.render.sun import Sun, parse_time, sun_at, towards_sun
from georef.geodesy import enu_from_tile, tile_from_asset
from georef.placement import GeoPlacement

SPA = (
    # NREL/TP-560-34302 (Reda and Andreas 2008), appendix A.5: zenith 50.11162, azimuth 194.34024, at 820 mbar.
    (-105.1786, 39.742476, "2003-10-17T12:30:30-07:00", 194.34024, 90 - 50.11162),
    # The same algorithm as pvlib 0.16.1 has it (solar_position_numpy, 1013.25 mbar, 15 °C, ΔT 69 s).
    (8.5417, 47.3769, "2026-06-21T11:30:00+00:00", 181.3305, 66.0628),
    (8.5417, 47.3769, "2026-12-21T08:30:00+00:00", 140.2735, 9.2051),
    (151.21, -33.87, "2026-03-20T23:00:00+00:00", 61.2676, 35.4334),
    (18.96, 69.65, "2026-06-21T22:45:00+00:00", 359.7530, 3.3053),
    (0.0, 0.0, "2000-01-01T06:30:00+00:00", 113.1925, 6.3008),
    (-179.99, 60.0, "2024-02-29T00:30:00+00:00", 184.6914, 22.0942),
    (8.0, 47.0, "1900-05-01T15:00:00+00:00", 252.8385, 35.4400),
    (-58.4, -34.6, "2099-10-10T20:15:00+00:00", 276.4727, 21.5512),
    (139.7, 35.7, "2026-09-23T03:00:00+00:00", 191.1590, 53.7432),
)
"""Longitude, latitude, time, azimuth, elevation with refraction."""


@pytest.mark.parametrize(("lon", "lat", "time", "azimuth", "elevation"), SPA)
def test_sun_agrees_with_spa(lon: float, lat: float, time: str, azimuth: float, elevation: float) -> None:
    sun = sun_at(lon, lat, parse_time(time))
    # A fiftieth of the sun's own width.
    assert sun.azimuth_deg == pytest.approx(azimuth, abs=0.01)
    assert sun.elevation_deg == pytest.approx(elevation, abs=0.01)
    assert sun.up


def test_night_is_below_the_horizon() -> None:
    assert not sun_at(8.5, 47.4, parse_time("2026-06-21T23:00Z")).up
    assert not sun_at(18.96, 69.65, parse_time("2026-12-21T11:00Z")).up


def test_a_moment_is_one_in_any_zone() -> None:
    moments = {parse_time(text) for text in ("2026-06-21T14:00+02:00", "2026-06-21T12:00Z", "2026-06-21T07:30-04:30")}
    assert moments == {datetime(2026, 6, 21, 12, tzinfo=UTC)}


@pytest.mark.parametrize(
    ("text", "expected"),
    [("noon", "ISO 8601"), ("2026-06-21T12:00", "zone"), ("2026-06-21", "zone"), ("0001-01-01T00:00+05:00", "range")],
)
def test_bad_times_are_rejected(text: str, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        parse_time(text)


@pytest.mark.parametrize("facing", [0.0, 33.0, 180.0, 271.5])
@pytest.mark.parametrize(("azimuth", "elevation"), [(90.0, 0.0), (12.0, 50.0), (250.0, 89.0), (180.0, -10.0)])
def test_direction_agrees_with_the_placement_on_the_globe(facing: float, azimuth: float, elevation: float) -> None:
    """The figure's frame, turned as tiles turn it, has the sun at its bearing and elevation."""
    vector = np.array(towards_sun(Sun(azimuth, elevation), facing))
    placement = GeoPlacement(8.5, 47.4, 0.0, "ellipsoid", facing, 1.79)
    east, north, up = (enu_from_tile(placement) @ tile_from_asset()).apply_vectors(vector[None])[0]
    a, e = np.deg2rad(azimuth), np.deg2rad(elevation)
    expected = (np.cos(e) * np.sin(a), np.cos(e) * np.cos(a), np.sin(e))
    assert (east, north, up) == pytest.approx(expected, abs=1e-12)


def test_morning_sun_lights_the_left_of_who_faces_south() -> None:
    x, y, z = towards_sun(Sun(90.0, 30.0), 180.0)
    assert x > 0.8
    assert y == pytest.approx(0.5)
    assert abs(z) < 1e-12
