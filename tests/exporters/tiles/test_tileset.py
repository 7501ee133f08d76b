"""3D Tiles: structure, volumes, errors; where CesiumJS puts the figure is in test_clients.py."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from exporters.errors import ExportError
from exporters.georeference import placement_of_tile
from exporters.gltf.reader import read_gltf
from exporters.level_error import level_errors
from exporters.tiles.tileset import (
    VISIBLE_RANGE_PER_ERROR,
    root_tile,
    short_range_warning,
    tileset,
    visible_range,
    write_tileset,
)
from exporters.validate import validate
from georef.errors import InputError
from georef.geodesy import ecef_from_geodetic
from georef.placement import GeoPlacement
from tests.exporters.analytic import HEIGHT, ZURICH, asset, capsule, shrinking


def _tiles(document: dict) -> list[dict]:
    chain = [document["root"]]
    while "children" in chain[-1]:
        chain.append(chain[-1]["children"][0])
    return chain


@pytest.mark.parametrize("target", ["figure", "figure/tileset.json"])
def test_folder_holds_a_clean_tileset(tmp_path: Path, target: str) -> None:
    write_tileset(asset(ZURICH), tmp_path / target)
    names = {file.name for file in (tmp_path / "figure").iterdir()}
    assert names == {"tileset.json", "farmer.glb", "farmer_lod1.glb", "farmer_lod2.glb"}
    assert validate(tmp_path / "figure", external=False) == []


def test_levels_run_from_coarse_to_fine_with_their_errors() -> None:
    given = asset(ZURICH, lods=shrinking())
    tiles = _tiles(tileset(given))
    assert [tile["content"]["uri"] for tile in tiles] == ["farmer_lod2.glb", "farmer_lod1.glb", "farmer.glb"]
    assert [tile["geometricError"] for tile in tiles] == [*level_errors(given.lods)[:0:-1], 0]
    assert tiles[0]["refine"] == "REPLACE"
    assert "transform" not in tiles[1]


def test_errors_never_grow_towards_finer_levels() -> None:
    lods = (capsule(16, 4), capsule(12, 3, deviation_m=(0.01, 5.0)), capsule(8, 2, deviation_m=(0.01, 4.0)))
    errors = [tile["geometricError"] for tile in _tiles(tileset(asset(ZURICH, lods=lods)))]
    assert errors == [5.0, 5.0, 0]


@pytest.mark.parametrize("distance", [0.01, 50.0, 2000.0, 1e6])
def test_visible_from_sets_the_error_of_the_tileset(distance: float) -> None:
    document = tileset(asset(ZURICH), distance)
    assert document["geometricError"] >= document["root"]["geometricError"]
    # 1080 rows, 60 degrees across 1920 columns: CesiumJS stops drawing at 16 pixels, 104 m away per metre of error.
    smallest = level_errors(asset().lods)[-1] * 104
    assert document["geometricError"] * 104 == pytest.approx(max(distance, smallest), rel=2e-3)
    assert pytest.approx(103.9, abs=0.1) == VISIBLE_RANGE_PER_ERROR


@pytest.mark.parametrize("height", [0.01, 0.02, 1.0, 1.79, 1800.0, 6186.2, 400_000.0])
def test_the_range_grows_with_the_figure(height: float) -> None:
    lods = tuple(replace(mesh, vertices=mesh.vertices * (height / HEIGHT)) for mesh in shrinking())
    error = tileset(asset(replace(ZURICH, figure_height_m=height), lods=lods))["geometricError"]
    assert error * 103.923 == pytest.approx(height / 1.79 * 2000, rel=1e-4)


def test_a_person_has_a_range_of_two_kilometres() -> None:
    assert visible_range(1.79) == 2000.0
    assert tileset(asset(ZURICH))["geometricError"] == 2000.0 / VISIBLE_RANGE_PER_ERROR


def test_a_range_of_less_than_ten_heights_is_a_warning() -> None:
    assert short_range_warning(None, 6186.2) is None
    assert short_range_warning(18_000.0, 1800.0) is None
    note = short_range_warning(2000.0, 1800.0)
    assert note is not None
    assert note.startswith("--visible-from: beyond 2000 m a figure 1800 m tall is not drawn")
    assert "\n" not in note


def test_box_holds_every_vertex_of_every_level(tmp_path: Path) -> None:
    write_tileset(asset(ZURICH), tmp_path)
    box = np.array(_tiles(json.loads((tmp_path / "tileset.json").read_text()))[0]["boundingVolume"]["box"])
    for file in tmp_path.glob("*.glb"):
        x, y, z = read_gltf(file).scene_vertices().T
        inside = np.abs(np.stack([x, -z, y], axis=1) - box[:3]) <= box[[3, 7, 11]]
        assert inside.all()
    assert box[2] + box[11] == pytest.approx(1.8, abs=2e-3)  # up is z, and the box not much larger than the figure


def test_without_a_place_the_option_is_named() -> None:
    with pytest.raises(InputError, match="--lonlat"):
        root_tile(asset())


@pytest.mark.parametrize("distance", [0.0, -1.0, float("nan"), float("inf")])
def test_invalid_distances_are_errors(distance: float) -> None:
    with pytest.raises(ExportError, match="--visible-from"):
        tileset(asset(ZURICH), distance)


def test_copyright_is_in_the_metadata_and_in_every_content(tmp_path: Path) -> None:
    write_tileset(asset(ZURICH), tmp_path)
    document = json.loads((tmp_path / "tileset.json").read_text())
    assert document["asset"]["version"] == "1.1"
    assert document["metadata"]["properties"]["copyright"] == "© Zürich map, CC BY 4.0"
    for file in tmp_path.glob("*.glb"):
        assert read_gltf(file).document["asset"]["copyright"] == "© Zürich map, CC BY 4.0"


def test_names_cannot_leave_the_folder(tmp_path: Path) -> None:
    write_tileset(asset(ZURICH, name="../../etc/Bäuerin 7%"), tmp_path / "out")
    assert {file.name for file in tmp_path.iterdir()} == {"out"}
    assert validate(tmp_path / "out", external=False) == []


places = st.builds(
    GeoPlacement,
    st.floats(-180, 180),
    st.floats(-89.9999, 89.9999),
    st.floats(-500, 100_000),
    st.just("ellipsoid"),
    st.floats(0, 360, exclude_max=True),
)


@settings(max_examples=50, deadline=None)
@given(places)
def test_the_transform_gives_the_place_it_was_made_from(place: GeoPlacement) -> None:
    found = placement_of_tile(tileset(asset(place))["root"]["transform"])
    feet = ecef_from_geodetic([[place.lon_deg, place.lat_deg, place.height_m]])
    again = ecef_from_geodetic([[found["lon_deg"], found["lat_deg"], found["height_m"]]])
    # The project promises 1 mm and 0.01 degrees; float64 at 6e6 m has steps of 1e-9 m.
    assert np.linalg.norm(feet - again) < 1e-6
    turn = (found["heading_deg"] - place.heading_deg + 180) % 360 - 180
    assert abs(turn) < 1e-4
