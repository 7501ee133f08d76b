"""Places of a sheet: where, which way is up, how large a pixel is on the ground, how far from what is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st

from georef.errors import PlacementError
from georef.geodesy import ecef_from_geodetic, enu_at, geodetic_from_ecef
from georef.mapsheet import SheetPlace, read_sheet
from georef.sheets.controls import FloatArray
from georef.sheets.reference import crs_of, fitting_plane, local_plane, plane_of
from tests.georef.sheets import sheets
from tests.georef.sheets.sheets import (
    METRES_PX,
    SIZE,
    SWISS,
    annotation_file,
    controls,
    lonlat,
    matrix,
    points_file,
    swiss,
)

GEOD = pyproj.Geod(ellps="WGS84")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path


def given_map(folder: Path, affine: FloatArray, crs: str) -> Path:
    sheets.picture(folder / "map.png")
    sheets.world_file(folder / "map.pgw", affine)
    (folder / "map.prj").write_text(pyproj.CRS(crs).to_wkt())
    return folder / "map.png"


def test_bearing_and_scale_are_those_of_geodesics(folder: Path) -> None:
    """A pixel up and a pixel to the right, followed on the ellipsoid by pyproj's geodesics."""
    sheet = read_sheet(given_map(folder, matrix(), SWISS))
    spot = sheet.place(310.5, 44.25)
    here, up, right = lonlat(swiss(np.array([[310.5, 44.25], [310.5, 43.25], [311.5, 44.25]])))
    bearing, _, length = GEOD.inv(*here, *up)
    assert (spot.lon_deg, spot.lat_deg) == pytest.approx(tuple(here), abs=1e-10)
    # Differences of 5 m in float64 degrees: 1e-9 m in 5 m, 1e-8 degrees of bearing.
    assert spot.up_bearing_deg == pytest.approx(bearing % 360, abs=1e-5)
    assert spot.up_m == pytest.approx(length, rel=1e-7)
    assert spot.across_m == pytest.approx(GEOD.inv(*here, *right)[2], rel=1e-7)
    assert spot.down_bearing_deg == pytest.approx((bearing + 180) % 360, abs=1e-5)
    convergence = pyproj.Proj(SWISS).get_factors(*here).meridian_convergence
    assert spot.up_bearing_deg == pytest.approx(sheets.TURN_DEG + convergence, abs=1e-3), "grid north is not north"
    assert spot.up_m == pytest.approx(METRES_PX, rel=1e-3)
    assert spot.stretch == pytest.approx(1.0, abs=1e-6), "the grid is conformal"
    assert not spot.mirrored
    assert spot.outside_m is None


def test_convergence_far_from_the_central_meridian(folder: Path) -> None:
    """UTM zone 32 at 12° east and 60° north: grid north is 2.6 degrees east of north."""
    east, north = pyproj.Proj("EPSG:32632")(12.0, 60.0)
    affine = np.array([[10.0, 0, east - 2000], [0, -10.0, north + 1500]])
    spot = read_sheet(given_map(folder, affine, "EPSG:32632")).place(200, 150)
    assert spot.up_bearing_deg == pytest.approx((12 - 9) * np.sin(np.radians(60)), abs=0.01)
    assert (spot.lon_deg, spot.lat_deg) == pytest.approx((12, 60), abs=1e-9)


def test_web_mercator_is_larger_than_the_ground(folder: Path) -> None:
    affine = np.array([[100.0, 0, 950_000.0], [0, -100.0, 8_400_000.0]])
    spot = read_sheet(given_map(folder, affine, "EPSG:3857")).place(200, 150)
    assert spot.up_m == pytest.approx(100 * np.cos(np.radians(spot.lat_deg)), rel=0.01)
    assert spot.up_bearing_deg == pytest.approx(0, abs=1e-6) or spot.up_bearing_deg == pytest.approx(360, abs=1e-6)


def test_a_sheet_in_degrees_is_stretched(folder: Path) -> None:
    affine = np.array([[0.01, 0, 8.0], [0, -0.01, 61.5]])
    spot = read_sheet(given_map(folder, affine, "EPSG:4326")).place(200, 150)
    assert (spot.lon_deg, spot.lat_deg) == pytest.approx((10, 60))
    assert spot.stretch == pytest.approx(2.0, abs=0.01), "a degree of longitude at 60 degrees is half one of latitude"
    assert spot.up_m == pytest.approx(1114, abs=2)


def test_a_mirrored_sheet_is_reported(folder: Path) -> None:
    flipped = matrix() @ np.array([[-1.0, 0, SIZE[0]], [0, 1, 0], [0, 0, 1]])
    spot = read_sheet(given_map(folder, flipped, SWISS)).place(100, 100)
    assert spot.mirrored
    assert "the map is mirrored" in spot.notes[0]


@pytest.mark.parametrize("method", ["helmert", "affine", "poly2", "poly3", "tps", "projective"])
def test_control_points_give_the_same_as_the_map_itself(folder: Path, method: str) -> None:
    truth = read_sheet(given_map(folder, matrix(), SWISS)).place(123.5, 210)
    pixels = controls(20)
    sheet = read_sheet(points_file(folder / "gcps.points", pixels, swiss(pixels)), transform=method)
    spot = sheet.place(123.5, 210)
    assert (spot.lon_deg, spot.lat_deg) == pytest.approx((truth.lon_deg, truth.lat_deg), abs=1e-9)
    assert spot.up_bearing_deg == pytest.approx(truth.up_bearing_deg, abs=1e-5)
    assert spot.up_m == pytest.approx(truth.up_m, rel=1e-6)
    assert sheet.quality is not None
    assert sheet.quality.rmse_m < 1e-4


PLACES = {
    "the antimeridian": (179.999, -16.5),
    "the north pole": (25.0, 89.995),
    "the south pole": (-100.0, -89.999),
    "the equator": (0.0, 0.0),
    "Zurich": (8.54, 47.37),
}


@pytest.mark.parametrize("name", PLACES)
@pytest.mark.parametrize("method", ["helmert", "affine", "tps"])
def test_points_in_longitude_and_latitude_anywhere(folder: Path, name: str, method: str) -> None:
    """A sheet drawn in the tangent plane of a place, its control points given in degrees: no seam, no pole."""
    lon, lat = PLACES[name]
    turn = np.radians(33.0)
    enu = enu_at(lon, lat)

    def ground(pixels: FloatArray) -> FloatArray:
        offset = (np.atleast_2d(pixels) - np.array(SIZE) / 2) * 8.0
        right, down = (np.cos(turn), -np.sin(turn)), (-np.sin(turn), -np.cos(turn))
        plane = offset @ np.array([right, down])
        up = -(plane**2).sum(axis=1, keepdims=True) / (2 * 6.37e6)
        return geodetic_from_ecef(enu.apply(np.concatenate([plane, up], axis=1)))[:, :2]

    pixels = controls(12)
    sheet = read_sheet(annotation_file(folder / "map.json", pixels, ground(pixels)), transform=method)
    assert sheet.quality is not None
    assert sheet.quality.rmse_m < 0.01
    spot = sheet.place(SIZE[0] / 2, SIZE[1] / 2)
    missed = ecef_from_geodetic((spot.lon_deg, spot.lat_deg, 0.0)) - ecef_from_geodetic((lon, lat, 0.0))
    assert np.linalg.norm(missed) < 0.01
    assert spot.up_m == pytest.approx(8.0, rel=1e-5)
    # Bearings are about the meridian of the place found, which near a pole turns with the last micrometre.
    turned = spot.up_bearing_deg - 33.0 - (spot.lon_deg - lon) * np.sign(lat) * (abs(lat) > 89)
    assert (turned + 180) % 360 - 180 == pytest.approx(0.0, abs=2e-3)


@given(lon=st.floats(-180, 180), lat=st.floats(-90, 90), radius=st.floats(0.001, 50), seed=st.integers(0, 10))
def test_local_planes_are_undone_exactly(lon: float, lat: float, radius: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    azimuth, distance = rng.uniform(-180, 180, 8), rng.uniform(0, radius * 111e3, 8)
    lons, lats, _ = GEOD.fwd(np.full(8, lon), np.full(8, lat), azimuth, distance)
    points = np.stack([lons, lats], axis=1)
    plane = local_plane(points, points)
    back = plane.to_lonlat(plane.from_lonlat(points))
    # PROJ iterates latitudes to 1e-10 radians, 0.6 mm; within a kilometre of a pole that is what is left.
    assert np.abs(GEOD.inv(*back.T, *points.T)[2]).max() < 2e-3


def test_maps_of_the_world_are_fitted_in_degrees(folder: Path) -> None:
    """A plate carrée about 150° east, so that the antimeridian is on the sheet."""
    pixels = np.array([[x, y] for x in (20.0, 120, 200, 280, 380) for y in (30.0, 150, 270)])
    places = np.stack([(150 + (pixels[:, 0] - 200) * 0.9 + 180) % 360 - 180, (150 - pixels[:, 1]) * 0.6], axis=1)
    sheet = read_sheet(annotation_file(folder / "map.json", pixels, places))
    assert sheet.plane.name.startswith("longitude and latitude about 168"), "midway of the points, the seam in the gap"
    spot = sheet.place(250, 100)
    assert (spot.lon_deg, spot.lat_deg) == pytest.approx((-165, 30))


def test_a_projection_of_another_meridian_and_unit(folder: Path) -> None:
    """Lambert zone II counts grads from Paris; fitting in its projection changes nothing but the plane's name."""
    pixels = controls(8)
    paris = fitting_plane(crs_of("EPSG:27572"))
    centre = paris.from_lonlat(np.array([[2.35, 48.85]]))
    assert centre[0] == pytest.approx((600_000 + 1000, 2_428_000), abs=3000)
    places = paris.to_lonlat(centre + (pixels - 200) * (7.0, -7.0))
    path = annotation_file(folder / "map.json", pixels, places)
    plain, named = read_sheet(path).place(150, 150), read_sheet(path, map_crs="EPSG:27572").place(150, 150)
    assert (named.lon_deg, named.lat_deg) == pytest.approx((plain.lon_deg, plain.lat_deg), abs=1e-7)
    assert named.up_m == pytest.approx(plain.up_m, rel=1e-4)


def test_other_datums_are_not_guessed() -> None:
    """Coordinates on a sphere that nothing ties to WGS 84 are refused; ballpark transformations would take them."""
    with pytest.raises(PlacementError, match=r"no transformation from .* to WGS 84 is known"):
        plane_of(crs_of("+proj=merc +R=6371000 +units=m +type=crs"))


def test_residuals_are_metres_on_the_ground(folder: Path) -> None:
    """One point of a web mercator sheet at 60 degrees north moved by 30 m of the map: 15 m on the ground."""
    east, north = pyproj.Proj("EPSG:3857")(10.0, 60.0)
    pixels = np.concatenate([controls(40), [[200.0, 150.0]]])
    coordinates = (pixels - 200) * (5.0, -5.0) + (east, north)
    coordinates[-1, 0] += 30.0
    quality = read_sheet(points_file(folder / "map.points", pixels, coordinates, "EPSG:3857")).quality
    assert quality is not None
    assert quality.residuals_m[-1] == pytest.approx(15.0, rel=0.05)
    assert max(quality.residuals_m[:-1]) < 1.5
    squares = np.sum(np.square(quality.residuals_m))
    assert quality.rmse_m == pytest.approx(np.sqrt(squares / 41))
    assert quality.degrees_of_freedom == 2 * 41 - 6
    assert quality.sigma_m == pytest.approx(np.sqrt(squares / (2 * 41 - 6)))


def test_sigma_is_the_error_of_a_coordinate(folder: Path) -> None:
    """Noise of 4 m in each coordinate, over 60 sheets of 9 points: sigma² averages to 16 within chi-squared bounds."""
    from scipy import stats

    rng = np.random.default_rng(1)
    total, draws = 0.0, 60
    for _ in range(draws):
        pixels = controls(9)
        noisy = swiss(pixels) + rng.normal(0, 4.0, (9, 2))
        quality = read_sheet(points_file(folder / "map.points", pixels, noisy)).quality
        assert quality is not None
        assert quality.sigma_m is not None
        total += quality.sigma_m**2 * quality.degrees_of_freedom
    low, high = stats.chi2.ppf([5e-7, 1 - 5e-7], draws * 12)
    assert low < total / 16.0 < high


def test_exact_fits_do_not_pass_for_accurate_ones(folder: Path) -> None:
    rng = np.random.default_rng(4)
    pixels = controls(15)
    path = points_file(folder / "map.points", pixels, swiss(pixels) + rng.normal(0, 20.0, (15, 2)))
    spline = read_sheet(path, transform="tps").quality
    assert spline is not None
    assert spline.rmse_m < 1e-4
    assert spline.degrees_of_freedom == 0
    assert spline.sigma_m is None
    assert spline.leave_one_out_rmse_m is not None
    assert spline.leave_one_out_rmse_m > 20.0, "what a spline misses is at least the noise of its points"


def test_inconsistent_points_are_reported(folder: Path) -> None:
    pixels = controls(9)
    shuffled = swiss(pixels)[np.random.default_rng(0).permutation(9)]
    notes = read_sheet(points_file(folder / "map.points", pixels, shuffled)).notes
    assert "check the points and the reference system" in notes[0]
    assert read_sheet(points_file(folder / "map.points", pixels, swiss(pixels))).notes == ()


def test_outside_the_hull_the_distance_is_reported(folder: Path) -> None:
    pixels = np.array([[100.0, 100], [200, 100], [200, 200], [100, 200], [150, 150]])
    sheet = read_sheet(points_file(folder / "map.points", pixels, swiss(pixels)))
    assert sheet.place(150, 120).outside_m == 0.0
    assert sheet.place(150, 120).notes == ()
    outside = sheet.place(240, 150)
    assert outside.outside_m == pytest.approx(40 * METRES_PX, rel=1e-3)
    assert "240 150 lies 200 m outside the control points' hull" in outside.notes[0]
    assert sheet.place(230, 240).outside_m == pytest.approx(50 * METRES_PX, rel=1e-3), "from a corner"


def spot_of(folder: Path, x: float, y: float) -> SheetPlace:
    return read_sheet(given_map(folder, matrix(), SWISS)).place(x, y)


@pytest.mark.parametrize(("x", "y"), [(-1, 10), (10, 300.5), (400.1, 0)])
def test_pixels_off_the_sheet_are_refused(folder: Path, x: float, y: float) -> None:
    with pytest.raises(PlacementError, match=r"--at: .* is not on the sheet of 400×300 px"):
        spot_of(folder, x, y)


def test_pixels_that_are_none_are_refused(folder: Path) -> None:
    with pytest.raises(PlacementError, match="is not a pixel"):
        spot_of(folder, float("nan"), 5)


def test_places_off_the_earth_are_refused(folder: Path) -> None:
    sheet = read_sheet(given_map(folder, np.array([[0.5, 0, 0.0], [0, -0.5, 100.0]]), "EPSG:4326"))
    assert sheet.place(10, 100).lat_deg == pytest.approx(50)
    with pytest.raises(PlacementError, match="is outside the area of WGS 84"):
        sheet.place(10, 5)
    wrong = read_sheet(given_map(folder, matrix() * 1000, SWISS))
    with pytest.raises(PlacementError, match=r"check the (reference system|georeference)"):
        wrong.place(10, 5)


def test_longitudes_beyond_the_antimeridian_come_round(folder: Path) -> None:
    sheet = read_sheet(given_map(folder, np.array([[0.01, 0, 178.0], [0, -0.01, -15.0]]), "EPSG:4326"))
    spot = sheet.place(300, 100)
    assert (spot.lon_deg, spot.lat_deg) == pytest.approx((-179, -16))
    assert spot.across_m == pytest.approx(1070, abs=2)
