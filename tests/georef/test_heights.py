"""Altitudes to ellipsoidal heights: h = H + N, or an error, never H unchanged."""

from __future__ import annotations

import os
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from georef import heights
from georef.errors import PlacementError
from georef.heights import ellipsoidal_height, grid_path, undulation_m

# Undulations are stored as float32, whose step at 50 m is 4e-6 m.
FLOAT32_M = 1e-5


def write_gtx(path: Path, south: float, west: float, step: float, values: np.ndarray) -> Path:
    """https://vdatum.noaa.gov/docs/gtx_info.html: rows run from south to north, all big-endian."""
    rows, columns = values.shape
    header = struct.pack(">4d2i", south, west, step, step, rows, columns)
    path.write_bytes(header + values.astype(">f4").tobytes())
    return path


def plane(south: float, west: float, step: float, rows: int, columns: int) -> np.ndarray:
    """N = 40 + (lon - 8) + 2 (lat - 47): bilinear interpolation must return it everywhere."""
    lat = south + step * np.arange(rows)[:, None]
    lon = west + step * np.arange(columns)[None, :]
    return 40.0 + (lon - 8.0) + 2.0 * (lat - 47.0)


@pytest.fixture(scope="module")
def grid(tmp_path_factory):
    # A space and an umlaut in the path: PROJ strings split at spaces.
    folder = tmp_path_factory.mktemp("höhen daten")
    return write_gtx(folder / "local geoid.gtx", 46.0, 7.0, 0.5, plane(46.0, 7.0, 0.5, 5, 7))


@given(
    lon=st.floats(7.0, 9.999),
    lat=st.floats(46.0, 47.999),
    altitude=st.floats(-500.0, 100_000.0),
)
def test_height_is_altitude_plus_undulation(grid, lon, lat, altitude):
    expected = 40.0 + (lon - 8.0) + 2.0 * (lat - 47.0)
    assert undulation_m(lon, lat, grid) == pytest.approx(expected, abs=FLOAT32_M)
    assert ellipsoidal_height(lon, lat, altitude, grid) == pytest.approx(altitude + expected, abs=FLOAT32_M)


@given(st.floats(-180, 180), st.floats(-90, 90), st.floats(allow_nan=False, allow_infinity=False))
def test_the_ellipsoid_is_the_identity(lon, lat, altitude):
    assert ellipsoidal_height(lon, lat, altitude) == altitude
    assert ellipsoidal_height(lon, lat, altitude, " Ellipsoid") == altitude


def test_text_paths_and_path_objects_agree(grid):
    assert ellipsoidal_height(8, 47, 100.0, str(grid)) == ellipsoidal_height(8, 47, 100.0, grid) == 140.0


def test_a_world_grid_closes_at_the_antimeridian_and_holds_at_the_poles(tmp_path):
    lon = np.radians(-180.0 + 15.0 * np.arange(24))
    values = np.tile(10.0 * np.cos(lon), (13, 1)).astype(np.float64)
    values[[0, -1]] = 3.0
    world = write_gtx(tmp_path / "world.gtx", -90.0, -180.0, 15.0, values)
    assert undulation_m(180.0, 0.0, world) == undulation_m(-180.0, 0.0, world) == -10.0
    # Half-way over the seam: between the columns of -180 (cos = -1) and 165 degrees.
    seam = 10.0 * (np.cos(np.radians(165.0)) - 1.0) / 2.0
    assert undulation_m(172.5, 0.0, world) == pytest.approx(seam, abs=FLOAT32_M)
    for at_pole in (-180.0, 0.0, 77.0, 180.0):
        assert undulation_m(at_pole, 90.0, world) == undulation_m(at_pole, -90.0, world) == 3.0


def test_a_grid_counted_from_0_to_360_serves_western_longitudes(tmp_path):
    values = np.full((3, 4), 5.0)
    grid = write_gtx(tmp_path / "west.gtx", 40.0, 250.0, 1.0, values)
    assert undulation_m(-108.5, 41.0, grid) == pytest.approx(5.0, abs=FLOAT32_M)


@pytest.mark.parametrize(("lon", "lat"), [(6.9, 47.0), (10.1, 47.0), (8.0, 45.9), (8.0, 48.1), (-172.0, 47.0)])
def test_places_off_the_grid_are_errors(grid, lon, lat):
    with pytest.raises(PlacementError, match=f"has no value at longitude {lon:g}, latitude {lat:g}"):
        ellipsoidal_height(lon, lat, 400.0, grid)


def test_nodata_is_an_error(tmp_path):
    values = np.full((4, 4), 5.0)
    values[:2, :2] = -88.8888
    holed = write_gtx(tmp_path / "holed.gtx", 46.0, 7.0, 1.0, values)
    with pytest.raises(PlacementError, match="has no value"):
        ellipsoidal_height(7.5, 46.5, 400.0, holed)
    assert ellipsoidal_height(9.5, 48.5, 400.0, holed) == pytest.approx(405.0, abs=FLOAT32_M)


def test_a_terrain_model_is_not_a_geoid(tmp_path):
    terrain = write_gtx(tmp_path / "dem.gtx", 46.0, 7.0, 1.0, np.full((3, 3), 408.0))
    with pytest.raises(PlacementError, match="408 m at the location is not a plausible geoid height"):
        ellipsoidal_height(8.0, 47.0, 400.0, terrain)


def test_a_rewritten_grid_is_read_again(tmp_path):
    path = write_gtx(tmp_path / "g.gtx", 46.0, 7.0, 1.0, np.full((3, 3), 5.0))
    assert undulation_m(8.0, 47.0, path) == pytest.approx(5.0, abs=FLOAT32_M)
    write_gtx(path, 46.0, 7.0, 1.0, np.full((3, 3), 6.0))
    os.utime(path, ns=(1, 1))  # some file systems count in seconds
    assert undulation_m(8.0, 47.0, path) == pytest.approx(6.0, abs=FLOAT32_M)


@pytest.mark.parametrize("name", ["junk.gtx", "junk.tif", "empty.gtx", "empty.tif", "cut.gtx"])
def test_files_that_only_look_like_grids(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(
        {"junk": b"not a grid " * 50, "empty": b""}.get(path.stem, struct.pack(">4d2i", 46, 7, 1, 1, 3, 3))
    )
    with pytest.raises(PlacementError, match=name):
        ellipsoidal_height(8.0, 47.0, 400.0, path)


def test_other_findings_name_the_datum_and_the_remedy(tmp_path):
    with pytest.raises(PlacementError, match=r"--altitude-datum egm2008: no such file; give ellipsoid, egm96 or"):
        ellipsoidal_height(8.0, 47.0, 400.0, "egm2008")
    text = tmp_path / "grid.txt"
    text.write_text("1 2 3")
    with pytest.raises(PlacementError, match=r"unknown suffix '.txt'; give a geoid grid"):
        grid_path(text)
    comma = tmp_path / "a,b.gtx"
    comma.write_bytes(b"")
    with pytest.raises(PlacementError, match="comma"):
        grid_path(comma)
    with pytest.raises(PlacementError, match="--altitude: nan is not a finite number"):
        ellipsoidal_height(8.0, 47.0, float("nan"))
    with pytest.raises(PlacementError, match="longitude first"):
        ellipsoidal_height(47.0, 97.0, 0.0)


def test_a_missing_egm96_grid_is_reported(tmp_path, monkeypatch):
    monkeypatch.setattr(heights, "EGM96_GRID", tmp_path / "egm96_15.tif")
    with pytest.raises(PlacementError, match=r"--altitude-datum egm96: .*egm96_15\.tif is missing; reinstall"):
        ellipsoidal_height(8.5, 47.4, 400.0, "egm96")


NGA_TEST_POINTS = (
    (38.6281550, 269.7791550, -31.628),
    (-14.6212170, 305.0211140, -2.969),
    (46.8743190, 102.4487290, -43.575),
    (-23.6174460, 133.8747120, 15.871),
    (38.6254730, 359.9995000, 50.066),
    (-0.4667440, 0.0023000, 17.329),
)
"""Latitude, longitude and N as NIMA published them with the model (OUTINTPT.DAT, readme of WW15MGH.GRD)."""


@pytest.mark.parametrize(("lat", "lon", "published"), NGA_TEST_POINTS)
def test_egm96_agrees_with_its_publisher(lat, lon, published):
    # The publisher's program lays splines through the nodes. Bilinear interpolation between nodes 28 km apart misses
    # them by the geoid's curvature: 6 cm at the most of these points.
    assert undulation_m((lon + 180) % 360 - 180, lat, "egm96") == pytest.approx(published, abs=0.06)


def test_egm96_at_the_poles_on_every_meridian():
    for lon in (-180.0, -77.3, 0.0, 12.125, 180.0):
        assert undulation_m(lon, 90.0, "egm96") == pytest.approx(13.606, abs=5e-4)
        assert undulation_m(lon, -90.0, "egm96") == pytest.approx(-29.534, abs=5e-4)


@pytest.mark.parametrize("lat", [-77.1, -20.0, 0.0, 12.4, 66.6])
def test_egm96_is_continuous_over_the_antimeridian(lat):
    assert undulation_m(180.0, lat, "egm96") == undulation_m(-180.0, lat, "egm96")
    across = [undulation_m(lon, lat, "egm96") for lon in (179.9999, 180.0, -179.9999)]
    # 1e-4 degrees are 11 m, over which no geoid rises by a centimetre.
    assert np.ptp(across) < 0.01


def test_egm96_in_zurich_and_at_its_extremes():
    # 47.34 m is known to the centimetre.
    assert ellipsoidal_height(8.5417, 47.3769, 408.0, "EGM96") == pytest.approx(455.34, abs=0.005)
    # South of India and in New Guinea: -107 m and 85.4 m.
    assert undulation_m(78.75, 4.75, "egm96") == pytest.approx(-107.0, abs=1.0)
    assert undulation_m(147.25, -8.25, "egm96") == pytest.approx(85.4, abs=1.0)
