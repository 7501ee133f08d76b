"""Programs of others agree about where a figure is and what it is made of."""

from __future__ import annotations

from pathlib import Path

import pytest

from exporters.tiles.tileset import write_tileset
from georef.placement import GeoPlacement
from tests.exporters.analytic import ZURICH, asset, capsule
from tests.node import RunScript

PLACES = {
    "Zurich": (8.5417, 47.3769, 455.34),
    "null island": (0.0, 0.0, 0.0),
    "nearly the pole": (13.37, 89.9, 2.0),
    "nearly the other pole": (-120.0, -89.9, 2800.0),
    "nearly the antimeridian": (179.9999, -16.5, 10.0),
    "the antimeridian": (-180.0, 65.0, 0.0),
    "Sydney": (151.2153, -33.8568, 26.0),
    "below the sea": (35.48, 31.55, -411.0),
    "high": (-65.0, -20.0, 5000.0),
}
HEADINGS = (0.0, 45.0, 90.0, 180.0, 271.25, 359.99)


def test_feet_and_nose_are_at_the_requested_place_in_cesium(tmp_path: Path, node: RunScript) -> None:
    jobs, headings = [], []
    for name, (lon, lat, height) in PLACES.items():
        for heading in HEADINGS:
            folder = tmp_path / f"{name} {heading}"
            place = GeoPlacement(lon, lat, height, heading_deg=heading)
            write_tileset(asset(place, lods=(capsule(6, 2),)), folder)
            tileset = str(folder / "tileset.json")
            jobs.append({"tileset": tileset, "lon_deg": lon, "lat_deg": lat, "height_m": height})
            headings.append(heading)
    for job, heading, found in zip(jobs, headings, node("place.mjs", stdin=jobs), strict=True):
        turn = (found["bearing_deg"] - heading + 180) % 360 - 180
        # The project's promise: 1 mm and 0.01 degrees.
        assert found["feet_error_m"] < 1e-3, job
        assert abs(turn) < 0.01, job
        # CesiumJS takes its up from the direction of the point, off by 3e-6 degrees per 100 m of height.
        assert abs(found["tilt_deg"]) < 0.001, job


@pytest.mark.slow
def test_tiles_tools_reads_levels_metadata_and_parts(tmp_path: Path, tiles_tools: RunScript) -> None:
    write_tileset(asset(ZURICH), tmp_path)
    found = tiles_tools("tiles_tools.mjs", tmp_path / "tileset.json")
    assert found["metadata"] == {"name": "farmer", "copyright": "© Zürich map, CC BY 4.0"}
    assert [tile["uris"] for tile in found["tiles"]] == [["farmer_lod2.glb"], ["farmer_lod1.glb"], ["farmer.glb"]]
    for tile in found["tiles"]:
        assert [(part["name"], part["label"]) for part in tile["parts"]] == [
            ("torso", 1),
            ("head", 2),
            ("l_upper_leg", 9),
        ]
        assert [part["observedShare"] for part in tile["parts"]] == pytest.approx([0.5] * 3, abs=0.01)
