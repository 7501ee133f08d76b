"""Geodesy against pyproj and the geodesic, poles and antimeridian included."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pyproj
import pytest
from hypothesis import example, given

from georef.errors import PlacementError
from georef.frames import ASSET, ECEF, ENU, MAP, TILE
from georef.geodesy import (
    cesium_entity_heading_deg,
    ecef_from_asset,
    ecef_from_geodetic,
    ecef_from_tile,
    enu_at,
    enu_from_tile,
    geodetic_from_ecef,
    nose_bearing_deg,
    tile_from_asset,
)
from georef.placement import GeoPlacement
from georef.transform import Transform, column_major
from tests.georef.strategies import heights, latitudes, longitudes, placements

# A float64 step at the earth's radius is 9e-10 m; conversions there and back make a handful of them.
STEP_M = 1e-8
# The same steps, and the 1.5e-8 m of Karney's geodesics, at a distance of 1 m: 2.5e-8 rad. The goal is 0.01 degrees.
BEARING_DEG = 1.5e-6


def angle_between(a: float, b: float) -> float:
    return abs((a - b + 180.0) % 360.0 - 180.0)


@given(longitudes, latitudes, heights)
@example(180.0, 90.0, 0.0)
def test_geodetic_round_trip(lon, lat, height):
    ecef = ecef_from_geodetic((lon, lat, height))
    lon_back, lat_back, height_back = geodetic_from_ecef(ecef)
    # Degrees are compared through metres on the ground: near a pole a longitude is worth little, on it nothing.
    np.testing.assert_allclose(ecef_from_geodetic((lon_back, lat_back, height_back)), ecef, rtol=0, atol=STEP_M)
    metres_per_degree = np.radians(1.0) * 6_478_137.0
    assert abs(lat_back - lat) * metres_per_degree < STEP_M
    assert abs(height_back - height) < STEP_M
    assert angle_between(lon_back, lon) * metres_per_degree * np.cos(np.radians(lat)) < STEP_M


def test_known_places():
    # EPSG Guidance Note 7-2, section 4.1.1: 53°48'33.820"N 2°07'46.380"E, 73.0 m; given there to the millimetre,
    # from angles given to 0.001" (0.03 m).
    lon, lat = 2 + 7 / 60 + 46.380 / 3600, 53 + 48 / 60 + 33.820 / 3600
    np.testing.assert_allclose(
        ecef_from_geodetic((lon, lat, 73.0)), (3771793.968, 140253.342, 5124304.349), rtol=0, atol=0.03
    )
    # The axes of the WGS 84 ellipsoid: a = 6378137 m, 1/f = 298.257223563.
    b = 6378137.0 * (1 - 1 / 298.257223563)
    axes = ecef_from_geodetic([(0, 0, 0), (90, 0, 0), (0, 90, 0), (0, -90, 0)])
    np.testing.assert_allclose(axes, np.array([(6378137, 0, 0), (0, 6378137, 0), (0, 0, b), (0, 0, -b)]), atol=STEP_M)


@given(longitudes, latitudes, heights)
def test_enu_agrees_with_projs_topocentric(lon, lat, height):
    own = enu_at(lon, lat, height)
    theirs = pyproj.Transformer.from_pipeline(
        f"+proj=topocentric +ellps=WGS84 +lon_0={lon!r} +lat_0={lat!r} +h_0={height!r}"
    )
    local = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (-30, 200, 7)], np.float64)
    np.testing.assert_allclose(np.transpose(theirs.transform(*own.apply(local).T)), local, rtol=0, atol=2 * STEP_M)


@given(longitudes, latitudes, heights)
def test_enu_is_a_rotation_whose_up_is_height(lon, lat, height):
    ecef_from_enu = enu_at(lon, lat, height)
    rotation = ecef_from_enu.matrix[:3, :3]
    # Nine products of numbers below 1: a few units in the last place, 2e-16 each.
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=2e-15)
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=2e-15)
    above = geodetic_from_ecef(ecef_from_enu.apply((0.0, 0.0, 100.0)))
    assert above[2] == pytest.approx(height + 100.0, abs=STEP_M)


@given(latitudes, heights)
def test_both_names_of_the_antimeridian_are_one_place(lat, height):
    east, west = enu_at(180.0, lat, height), enu_at(-180.0, lat, height)
    np.testing.assert_array_equal(east.matrix[:3, :3], west.matrix[:3, :3])
    np.testing.assert_allclose(east.matrix, west.matrix, rtol=0, atol=STEP_M)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_poles_follow_the_longitude_exactly(sign):
    pole = enu_at(90.0, sign * 90.0, 0.0)
    np.testing.assert_array_equal(pole.matrix[:3, :3], [[-1, 0, 0], [0, -sign, 0], [0, 0, sign]])
    np.testing.assert_allclose(pole.matrix[:3, 3], [0, 0, sign * 6356752.314245179], atol=STEP_M)


def test_tile_from_asset_puts_the_front_south_and_the_figures_left_east():
    p = np.array([[1.0, 2.0, 3.0]])
    np.testing.assert_array_equal(tile_from_asset().apply(p), [[1.0, -3.0, 2.0]])
    south = enu_from_tile(GeoPlacement(8.5, 47.4, heading_deg=180.0))
    np.testing.assert_array_equal(south.matrix, np.eye(4))
    assert ((south @ tile_from_asset()).target, (south @ tile_from_asset()).source) == (ENU, ASSET)


@pytest.mark.parametrize(
    ("heading", "front", "left"),
    [
        (0, (0, 1, 0), (-1, 0, 0)),
        (90, (1, 0, 0), (0, 1, 0)),
        (180, (0, -1, 0), (1, 0, 0)),
        (270, (-1, 0, 0), (0, -1, 0)),
    ],
)
def test_main_directions_are_exact(heading, front, left):
    enu_from_asset = enu_from_tile(GeoPlacement(8.5, 47.4, heading_deg=heading)) @ tile_from_asset()
    np.testing.assert_array_equal(
        enu_from_asset.apply_vectors([(0, 0, 1), (1, 0, 0), (0, 1, 0)]), [front, left, (0, 0, 1)]
    )


@given(placements)
@example(GeoPlacement(13.0, 90.0, 0.0, heading_deg=90.0))
@example(GeoPlacement(180.0, -90.0, 0.0, heading_deg=33.0))
def test_the_nose_points_along_the_geodesic(placement):
    """Feet and a point 1 m in front of the nose, through geodetic coordinates, independent of our rotations."""
    height = 0.9 * placement.figure_height_m
    feet, ahead = geodetic_from_ecef(ecef_from_asset(placement).apply([(0.0, 0.0, 0.0), (0.0, height, 1.0)]))
    np.testing.assert_allclose(
        ecef_from_geodetic(feet),
        ecef_from_geodetic((placement.lon_deg, placement.lat_deg, placement.height_m)),
        atol=STEP_M,
    )
    # Starts at the given longitude: on the earth's axis the one read back is undefined.
    azimuth, _, distance = pyproj.Geod(ellps="WGS84").inv(placement.lon_deg, placement.lat_deg, ahead[0], ahead[1])
    # At height h a metre along the meridian shrinks on its way down to the ellipsoid as R / (R + h) with another R
    # than a metre along the parallel: that turns the bearing by up to h/2 times the difference of 1/R, 0.0068 / R.
    turned = np.degrees(0.5 * (abs(placement.height_m) + height) * 0.0068 / 6_335_439.0)
    assert angle_between(azimuth, placement.heading_deg) < BEARING_DEG + turned
    # On the ground the metre shrinks with height, at most by 100 km in the radius: 1.6 %.
    assert distance == pytest.approx(1.0, abs=0.02)
    assert ahead[2] == pytest.approx(placement.height_m + height, abs=1e-6)  # 1 m along the tangent rises 8e-8 m


@given(placements)
def test_nose_bearing_reads_back_the_heading(placement):
    local = enu_from_tile(placement)
    # The rotation alone: rounding of sine and cosine, 1e-16 rad, in degrees and a few times over.
    assert angle_between(nose_bearing_deg(local), placement.heading_deg) < 1e-12
    assert angle_between(nose_bearing_deg(local @ tile_from_asset()), placement.heading_deg) < 1e-12
    distance_to_axis = np.hypot(*ecef_from_tile(placement).matrix[:2, 3])
    if distance_to_axis > 1e3:  # nearer, longitudes read back from a step of 1e-9 m cost more than BEARING_DEG
        assert angle_between(nose_bearing_deg(ecef_from_tile(placement)), placement.heading_deg) < BEARING_DEG
        assert angle_between(nose_bearing_deg(ecef_from_asset(placement)), placement.heading_deg) < BEARING_DEG


def test_nose_bearing_refuses_what_has_no_bearing():
    with pytest.raises(ValueError, match="ECEF_from_ENU: expected"):
        nose_bearing_deg(enu_at(0.0, 0.0))
    with pytest.raises(ValueError, match="MAP_from_TILE: expected"):
        nose_bearing_deg(Transform(MAP, TILE, np.eye(4)))
    with pytest.raises(ValueError, match="along the vertical"):
        nose_bearing_deg(Transform(ENU, ASSET, np.eye(4)))


@given(placements)
def test_the_tile_transform_read_back_from_its_numbers(placement):
    """As a 3D Tiles client does it: y-up to z-up, then the column-major matrix."""
    numbers = np.array(column_major(ecef_from_tile(placement)))
    x, y, z = 0.3, 1.7, -0.2
    client = numbers.reshape(4, 4).T @ (x, -z, y, 1.0)
    np.testing.assert_allclose(client[:3], ecef_from_asset(placement).apply((x, y, z)), rtol=0, atol=STEP_M)
    assert client[3] == 1.0


@pytest.mark.parametrize(("bearing", "entity"), [(90, 0), (180, 90), (0, 270), (270, 180)])
def test_cesium_entities_face_east_at_heading_zero(bearing, entity):
    assert cesium_entity_heading_deg(GeoPlacement(0, 0, heading_deg=bearing)) == entity


def test_shapes_pass_through():
    assert ecef_from_geodetic(np.zeros((0, 3))).shape == (0, 3)
    assert ecef_from_geodetic((0, 0, 0)).shape == (3,)
    with pytest.raises(ValueError, match=r"shape is \(2,\)"):
        ecef_from_geodetic((0, 0))


@pytest.mark.parametrize("bad", [(0, 90.1, 0), (0, np.nan, 0), (np.inf, 0, 0)])
def test_places_that_do_not_exist(bad):
    with pytest.raises(PlacementError, match="is not on the earth"):
        ecef_from_geodetic([(0, 0, 0), bad])
    with pytest.raises(PlacementError):
        enu_at(*bad)


def test_importing_is_cheap():
    code = "import sys, georef.geodesy, georef.heights; sys.exit('pyproj' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_float32_would_not_do():
    """Why ECEF stays float64: its float32 neighbours are half a metre apart."""
    assert np.spacing(np.float32(6378137.0)) == 0.5
    assert ECEF.notes.find("float64") > 0
