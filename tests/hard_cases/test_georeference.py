"""Figures at the poles, on the antimeridian, a billionth of a degree apart, under the sea and in the sky."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from exporters.asset import Asset
from exporters.gltf.glb import write_glb
from exporters.gltf.part_borders import split_at_parts
from exporters.gltf.reader import read_gltf
from exporters.tiles.tileset import write_tileset
from fig2mesh.conversion.place import placement_of
from fig2mesh.conversion.request import PlaceRequest
from georef.errors import InputError
from georef.geodesy import ecef_from_asset, ecef_from_geodetic, geodetic_from_ecef, tile_from_asset
from georef.placement import GeoPlacement
from tests.exporters.analytic import HEIGHT, asset
from tests.georef.strategies import heights, latitudes, longitudes, placements
from tests.hard_cases.case import Worst, drawn, hard_case

hard_latitudes = st.one_of(latitudes, st.sampled_from([89.9999, -89.9999]))
STEP = "a float64 step at the earth's radius is 9e-10 m; the chain of conversions makes about ten of them"


@given(placements, st.tuples(st.floats(-50, 50), st.floats(0, 100), st.floats(-50, 50)))
@example(GeoPlacement(180.0, 90.0, -500.0, heading_deg=359.999), (0.3, 1.79, 0.1))
@example(GeoPlacement(-180.0, -89.9999, 100_000.0, heading_deg=1e-9), (0.3, 1.79, 0.1))
@drawn(60)
@hard_case(
    "points within 100 m of a figure, at any place (poles, ±180°, ±1e-9° of both), height −500 m to 100 km and heading",
    "ASSET → ECEF → longitude, latitude, height → ECEF → ASSET",
    STEP,
    2e-8,
    "m",
)
def test_asset_to_geodetic_and_back(worst: Worst, placement: GeoPlacement, point: tuple[float, float, float]) -> None:
    ecef = ecef_from_asset(placement).apply(point)
    back = ecef_from_asset(placement).inverse().apply(ecef_from_geodetic(geodetic_from_ecef(ecef)))
    worst(np.abs(back - point).max())


@given(longitudes, hard_latitudes, heights, st.sampled_from([1e-9, -1e-9]))
@drawn(60)
@hard_case(
    "places 1e-9° apart in longitude and in latitude, anywhere",
    "they stay apart by the length of that arc: 0.11 mm at the equator",
    "float64 steps of ECEF, 9e-10 m, and of 180°, 3e-14° or 3e-9 m",
    1e-8,
    "m",
)
def test_a_billionth_of_a_degree(worst: Worst, lon: float, lat: float, height: float, step: float) -> None:
    lon, lat = min(max(lon, -179.999), 179.999), min(max(lat, -89.999), 89.999)
    here = ecef_from_asset(GeoPlacement(lon, lat, height)).apply((0.0, 0.0, 0.0))
    e2 = 0.0066943799901413165
    curvature = 1 - e2 * np.sin(np.radians(lat)) ** 2
    across = (6378137.0 / np.sqrt(curvature) + height) * np.cos(np.radians(lat))
    along = 6378137.0 * (1 - e2) / curvature**1.5 + height
    for moved, radius in (((lon + step, lat), across), ((lon, lat + step), along)):
        there = ecef_from_asset(GeoPlacement(*moved, height)).apply((0.0, 0.0, 0.0))
        worst(abs(np.linalg.norm(there - here) - radius * np.radians(1e-9)))


@given(hard_latitudes, heights, st.floats(0, 360, exclude_max=True))
@drawn(40)
@hard_case(
    "a figure 100 m wide that stands across the antimeridian, or beside it, named 180° or −180°",
    "its points are as far from each other on the globe as in the model, and the same under both names",
    STEP,
    2e-8,
    "m",
)
def test_a_figure_across_the_antimeridian(worst: Worst, lat: float, height: float, heading: float) -> None:
    points = np.array([(-50.0, 0, 0), (50, 0, 0), (0, 30, 50), (0, 0, -50)])
    east, west, near = (
        ecef_from_asset(GeoPlacement(lon, lat, height, heading_deg=heading)).apply(points)
        for lon in (180.0, -180.0, 180.0 - 1e-9)
    )
    worst(np.abs(east - west).max())
    for there in (east, near):
        worst(np.abs(np.linalg.norm(there - there[0], axis=1) - np.linalg.norm(points - points[0], axis=1)).max())


def exact_and_scaled(size: float, placement: GeoPlacement) -> tuple[Asset, np.ndarray]:
    """The capsule `size` metres high, and its vertices before they were rounded to float32."""
    plain = asset(placement)
    # Split at parts as the writer does it, so that vertices read back are those written, one by one.
    mesh = split_at_parts(plain.mesh)
    exact = mesh.vertices.astype(np.float64) * (size / HEIGHT)
    return replace(plain, lods=(replace(mesh, vertices=exact),)), exact


@given(placements, st.sampled_from([0.01, 1.79, 100.0, 1000.0]))
@example(GeoPlacement(180.0, -90.0, -500.0, heading_deg=12.3), 1000.0)
@example(GeoPlacement(-180.0, 89.9999, 100_000.0, heading_deg=359.9), 1.79)
@drawn(25)
@hard_case(
    "figures 1 cm to 1 km high as GLB and as 3D Tiles, at any place, read back as a client reads them",
    "every vertex, in ECEF, where it is in float64",
    "float32 steps of coordinates up to 1 km are 6e-5 m, halved by rounding; ECEF in float32 would be off by 0.3 m. "
    "The goal is 1 mm",
    1e-3,
    "m",
)
def test_vertices_at_the_scale_of_the_earth(
    worst: Worst, tmp_path_factory: pytest.TempPathFactory, placement: GeoPlacement, size: float
) -> None:
    folder = tmp_path_factory.mktemp("earth")
    made, exact = exact_and_scaled(size, placement)
    expected = ecef_from_asset(placement).apply(exact)
    write_glb(made, folder / "a.glb")
    placed = ecef_from_asset(placement).apply(read_gltf(folder / "a.glb").scene_vertices())
    worst(np.abs(placed - expected).max())
    write_tileset(made, folder / "tiles")
    tile = json.loads((folder / "tiles" / "tileset.json").read_text())["root"]
    local = read_gltf(folder / "tiles" / tile["content"]["uri"]).scene_vertices()
    matrix = np.array(tile["transform"]).reshape(4, 4).T
    worst(np.abs(tile_from_asset().apply(local) @ matrix[:3, :3].T + matrix[:3, 3] - expected).max())


@pytest.mark.parametrize(
    ("lonlat", "altitude", "finding"),
    [
        ((0.0, 90.0), 0.0, None),
        ((180.0, -90.0), -500.0, None),
        ((-180.0, 0.0), 1e5, None),
        ((0.0, 90.0000001), 0.0, "latitude"),
        ((180.0000001, 0.0), 0.0, "longitude"),
        ((0.0, 0.0), -12_001.0, "--altitude"),
        ((0.0, 0.0), float("nan"), "--altitude"),
        ((float("nan"), 0.0), 0.0, "finite"),
        ((0.0, float("inf")), 0.0, "finite"),
    ],
)
@hard_case(
    "--lonlat at and 1e-7° beyond poles and antimeridian, NaN and inf; --altitude down to −12 km, NaN",
    "accepted as given, or refused by the name of what is wrong",
    "places are not wrapped or clipped: 180.0000001 is more often a typing error than a place",
)
def test_places_that_are_hardly_there(lonlat: tuple[float, float], altitude: float, finding: str | None) -> None:
    request = PlaceRequest(lonlat=lonlat, facing="N", altitude=altitude)
    if finding is None:
        placed = placement_of(request)
        assert placed is not None
        assert (placed.lon_deg, placed.lat_deg, placed.height_m) == (*lonlat, altitude)
        return
    with pytest.raises(InputError, match=finding):
        placement_of(request)
