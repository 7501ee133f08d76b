"""Programs of others read many figures: CesiumJS, 3d-tiles-tools, py3dtiles."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from exporters.asset import Asset
from exporters.gltf.part_borders import split_at_parts
from exporters.level_error import level_errors
from exporters.placed_figure import PlacedFigure
from exporters.tiles.gather import write_figures
from exporters.tiles.tileset import write_tileset
from exporters.tiles.tree import tileset_documents
from exporters.write import write
from fig2mesh.globe.assets import find_assets
from fig2mesh.globe.page import globe_page, page_files
from fig2mesh.view.server import page_server
from georef.geodesy import ecef_from_geodetic, ecef_from_tile
from georef.placement import GeoPlacement
from tests import py3dtiles
from tests.browser import Look, serving
from tests.exporters.analytic import HEIGHT, ZURICH, asset, capsule, shrinking
from tests.exporters.test_clients import HEADINGS, PLACES
from tests.exporters.tiles.test_tree import crowd, mixed
from tests.node import RunScript

SMALL = (capsule(8, 2),)


@pytest.fixture
def four(tmp_path: Path) -> Path:
    """A folder of four figures, one of them in three levels of detail, in the sea and at the pole too."""
    for number, (lon, lat, height) in enumerate([(8.5, 47.4, 400.0), (180.0, 10.0, 0.0), (0.0, 90.0, 2.0)]):
        place = GeoPlacement(lon, lat, height, heading_deg=30.0 * number)
        write(asset(place, lods=SMALL, name=f"figure {number}"), tmp_path / "in" / f"{number}.glb")
    write(asset(ZURICH, name="farmer"), tmp_path / "in" / "tiles")
    return tmp_path / "in"


def _distance(points: np.ndarray, figure: PlacedFigure) -> float:
    """From the nearest of points, ECEF, to a figure's box with its millimetre."""
    local = ecef_from_tile(figure.placement).inverse().apply(points)
    gap = np.maximum(np.maximum(np.array(figure.low) - 1e-3 - local, local - np.array(figure.high) - 1e-3), 0)
    return float(np.linalg.norm(gap, axis=-1).min())


@pytest.mark.parametrize("visible_from", [100.0, 2000.0, 300_000.0])
def test_cesium_draws_just_the_figures_within_the_distance(
    tmp_path: Path, node: RunScript, visible_from: float
) -> None:
    figures = crowd(700, spread_deg=visible_from / 111e3 * 2)
    for name, document in tileset_documents(figures, visible_from):
        (tmp_path / name).write_text(json.dumps(document))
    random = np.random.default_rng(5)
    views = [
        {
            "lon_deg": 8.5 + x * visible_from / 111e3,
            "lat_deg": 47.4 + y * visible_from / 111e3,
            "height_m": 5000 + z * visible_from,
        }
        for x, y, z in random.uniform([-2, -2, 0], [2, 2, 0.9], (12, 3)).tolist()
    ]
    first = figures[0].placement
    views.append({"lon_deg": first.lon_deg, "lat_deg": first.lat_deg, "height_m": first.height_m + visible_from / 2})
    views.append({"lon_deg": -170.0, "lat_deg": -40.0, "height_m": 10.0})
    found = node("visible.mjs", stdin={"tileset": str(tmp_path / "tileset.json"), "views": views})["views"]
    for view, visible in zip(views, found, strict=True):
        camera = ecef_from_geodetic([[view["lon_deg"], view["lat_deg"], view["height_m"]]])
        away = {each.contents[0]: _distance(camera, each) for each in figures}
        # Drawn from where 16 pixels are one of 1080 rows at 60 degrees across, to float32's digits of nothing here.
        assert set(visible["drawn"]) == {uri for uri, distance in away.items() if distance < visible_from * (1 - 1e-9)}
    assert found[-1] == {"drawn": [], "files": 0, "visited": 0}
    assert found[-2]["drawn"]
    # Nor is the rest of the tree visited: 700 figures, 101 nodes above them.
    assert all(each["visited"] < 801 for each in found)


def test_cesium_draws_figures_of_any_heights_from_as_far_as_their_own(tmp_path: Path, node: RunScript) -> None:
    figures = mixed(300, 0.05)
    for name, document in tileset_documents(figures):
        (tmp_path / name).write_text(json.dumps(document))
    ranges = {each.contents[0]: 2000 / 1.79 * each.placement.figure_height_m for each in figures}
    first = {
        height: next(each for each in figures if each.placement.figure_height_m == height)
        for height in (1.79, 180.0, 6186.2)
    }
    # Above one figure of each height, within the range of that height and beyond it.
    views = [
        {
            "lon_deg": each.placement.lon_deg,
            "lat_deg": each.placement.lat_deg,
            "height_m": each.placement.height_m + each.high[2] + share * ranges[each.contents[0]],
        }
        for each in first.values()
        for share in (0.01, 0.5, 0.99, 1.01)
    ]
    found = node("visible.mjs", stdin={"tileset": str(tmp_path / "tileset.json"), "views": views})["views"]
    for view, visible in zip(views, found, strict=True):
        camera = ecef_from_geodetic([[view["lon_deg"], view["lat_deg"], view["height_m"]]])
        near = {each.contents[0] for each in figures if _distance(camera, each) < ranges[each.contents[0]]}
        assert set(visible["drawn"]) == near
    for number, each in enumerate(first.values()):
        drawn = [each.contents[0] in visible["drawn"] for visible in found[4 * number : 4 * number + 4]]
        assert drawn == [True, True, True, False]


def tall(height_m: float, name: str) -> Asset:
    """A figure as tall as that, as a map shows it."""
    mesh = capsule(8, 2)
    larger = replace(mesh, vertices=mesh.vertices * height_m / HEIGHT)
    return asset(replace(ZURICH, figure_height_m=height_m), lods=(larger,), name=name)


ZOOM = """(async () => {
  const { viewer, figures } = fig2mesh;
  fig2mesh.state.current = figures[0];
  viewer.camera.lookAtTransform(Cesium.Matrix4.IDENTITY);
  await viewer.zoomTo(figures[0].drawn);
  for (let i = 0; i < 200 && !(i > 5 && figures[0].drawn.tilesLoaded); i++) {
    await new Promise((done) => { viewer.scene.requestRender(); requestAnimationFrame(done); });
  }
  return [figures[0].shownLevel(), document.getElementById('range').hidden];
})()"""

AT = """(async () => {{
  await fig2mesh.look(fig2mesh.figures[0], 0);
  fig2mesh.viewer.camera.zoomOut({out});
  for (let i = 0; i < 20; i++) {{
    await new Promise((done) => {{ fig2mesh.viewer.scene.requestRender(); requestAnimationFrame(done); }});
  }}
  const note = document.getElementById('range');
  return [fig2mesh.figures[0].shownLevel(), note.hidden ? null : note.textContent];
}})()"""


def _page(folder: Path, look: Look, cesium: Path, *scripts: str) -> list[Any]:
    assets = find_assets((folder,))
    with serving(page_server(globe_page(assets), 0, {"cesium": cesium}, page_files(assets))) as address:
        found = look(address, *({"evaluate": script} for script in scripts), size=(480, 270))
    assert found["messages"] == []
    return [each["value"] for each in found["results"]]


@pytest.mark.slow
@pytest.mark.parametrize("height", [1.79, 1800.0, 400_000.0])
def test_a_figure_is_drawn_where_a_client_flies_to(tmp_path: Path, look: Look, cesium: Path, height: float) -> None:
    write(tall(height, "giant"), tmp_path / "one")
    write_figures([tmp_path / "one"], tmp_path / "all")
    for folder in ("one", "all"):
        zoomed, viewed = _page(tmp_path / folder, look, cesium, ZOOM, AT.format(out=0))
        assert zoomed == [0, True]
        assert viewed == [0, None]


@pytest.mark.slow
def test_the_globe_flies_into_a_short_range_or_reports_that_nothing_is_drawn(
    tmp_path: Path, look: Look, cesium: Path
) -> None:
    # A canvas of 270 rows has a quarter of the range.
    write(tall(1800.0, "giant"), tmp_path / "short", visible_from_m=7000.0)
    near, far = _page(tmp_path / "short", look, cesium, AT.format(out=0), AT.format(out=20_000))
    assert near == [0, None]
    assert far == [-1, "not drawn from here: closer than 1.8 km"]
    write(tall(1800.0, "giant"), tmp_path / "shorter", visible_from_m=2000.0)
    assert _page(tmp_path / "shorter", look, cesium, AT.format(out=0)) == [
        [-1, "not drawn from here: closer than 500 m"]
    ]


def test_levels_of_detail_follow_their_errors_in_cesium(tmp_path: Path, node: RunScript) -> None:
    given = asset(ZURICH, lods=shrinking())
    write_tileset(given, tmp_path, visible_from_m=2000.0)
    write(given, tmp_path / "in")
    write_figures([tmp_path / "in"], tmp_path / "many")
    errors = level_errors(given.lods)
    # Just within and beyond the distances at which each level's error is 16 pixels, above the head; and the whole.
    ranges = [103.923 * errors[1], 103.923 * errors[2], 2000.0]
    heights = [distance + change for distance in ranges for change in (-0.01, 0.01)]
    views = [
        {"lon_deg": ZURICH.lon_deg, "lat_deg": ZURICH.lat_deg, "height_m": ZURICH.height_m + 1.801 + height}
        for height in heights
    ]
    wanted = ["farmer.glb", "farmer_lod1.glb", "farmer_lod1.glb", "farmer_lod2.glb", "farmer_lod2.glb", None]
    for folder, prefix in ((tmp_path, ""), (tmp_path / "many", "figures/")):
        found = node("visible.mjs", stdin={"tileset": str(folder / "tileset.json"), "views": views})["views"]
        names = [[prefix + name] if name else [] for name in wanted]
        assert [each["drawn"] for each in found] == names


def test_cesium_reads_the_metadata(four: Path, tmp_path: Path, node: RunScript) -> None:
    write_figures([four], tmp_path / "out")
    view = {"lon_deg": 0, "lat_deg": 0, "height_m": 0}
    found = node("visible.mjs", stdin={"tileset": str(tmp_path / "out" / "tileset.json"), "views": [view]})["metadata"]
    assert len(found) == 6
    for level in ("", "_lod1", "_lod2"):
        facts = found[f"figures/farmer{level}.glb"]
        assert facts["name"] == "farmer"
        assert facts["parts"] == ["torso", "head", "l_upper_leg"]
        assert (facts["longitude"], facts["latitude"], facts["height"]) == (8.5417, 47.3769, 455.34)
        assert facts["observedShare"] == pytest.approx(0.5, abs=0.01)


def test_entities_of_czml_are_at_the_requested_place_in_cesium(tmp_path: Path, node: RunScript) -> None:
    wanted = {}
    for place, (lon, lat, height) in PLACES.items():
        for heading in HEADINGS:
            name = f"{place} {heading}"
            wanted[name] = GeoPlacement(lon, lat, height, heading_deg=heading)
            write(asset(wanted[name], lods=(capsule(6, 2),), name=name), tmp_path / "in" / f"{name}.glb")
    write_figures([tmp_path / "in"], tmp_path / "out")
    found = node("czml.mjs", stdin=str(tmp_path / "out" / "figures.czml"))
    assert {each["name"] for each in found} == set(wanted)
    for each in found:
        place = wanted[each["name"]]
        feet = ecef_from_geodetic([place.lon_deg, place.lat_deg, place.height_m])
        assert np.linalg.norm(feet - each["position"]) < 1e-3, each
        assert abs((each["bearing_deg"] - place.heading_deg + 180) % 360 - 180) < 0.01, each
        assert abs(each["tilt_deg"]) < 0.001, each
        assert each["upright"] == pytest.approx(1)
        assert each["model"].endswith(".glb")
        assert each["height_reference"] == "NONE"


def test_cesium_clamps_entities_of_czml(tmp_path: Path, node: RunScript) -> None:
    references = []
    for height in (0.0, 3.0):
        place = GeoPlacement(8.5, 47.4, height, altitude_mode="clamp", heading_deg=70.0)
        write(asset(place, lods=SMALL), tmp_path / f"{height}.czml")
        (found,) = node("czml.mjs", stdin=str(tmp_path / f"{height}.czml"))
        references.append(found["height_reference"])
        assert found["bearing_deg"] == pytest.approx(70.0, abs=0.01)
        assert found["height_m"] == pytest.approx(height, abs=1e-6)
    assert references == ["CLAMP_TO_GROUND", "RELATIVE_TO_GROUND"]


@pytest.mark.slow
def test_tiles_tools_reads_structure_and_metadata_of_many(tmp_path: Path, tiles_tools: RunScript) -> None:
    figures = crowd(600, spread_deg=1.0)
    for name, document in tileset_documents(figures, 2000.0):
        (tmp_path / name).write_text(json.dumps(document))
    (tmp_path / "figures").mkdir()
    for each in figures:
        (tmp_path / each.contents[0]).write_bytes(b"glTF")
    found = tiles_tools("tiles_tools_many.mjs", tmp_path / "tileset.json")
    assert found["metadata"] == {"figures": 600}
    assert set(found["contents"]) == {each.contents[0] for each in figures}
    for each in figures:
        facts = found["contents"][each.contents[0]]["metadata"]
        assert facts["name"] == each.name
        assert facts["parts"] == ["head", "torso"]
        assert facts["longitude"] == each.placement.lon_deg
    # Root, file, its root, two levels, the figure: counted from 0.
    assert found["depth"] <= 6


@pytest.mark.slow
def test_tiles_tools_reads_version_1_0(four: Path, tmp_path: Path, tiles_tools: RunScript) -> None:
    write_figures([four], tmp_path / "out", version="1.0")
    found = tiles_tools("tiles_tools_many.mjs", tmp_path / "out" / "tileset.json", "--batch")
    assert len(found["contents"]) == 6
    for each in found["contents"].values():
        assert each["kind"] == "b3dm"
        assert each["extras"]["parts"] == each["batch"]["name"] == ["torso", "head", "l_upper_leg"]
        assert each["batch"]["label"] == [1, 2, 9]


@pytest.mark.slow
@pytest.mark.parametrize("version", ["1.0", "1.1"])
def test_py3dtiles_reads_many(four: Path, tmp_path: Path, version: str) -> None:
    write_figures([four], tmp_path / "out", version=version)
    found = py3dtiles.read("py3dtiles_contents.py", tmp_path / "out" / "tileset.json")
    assert found["version"] == version
    assert found["tiles"] == 7
    assert len(found["contents"]) == 6
    vertices = sorted(content["vertices"] for content in found["contents"].values())
    levels = asset(ZURICH).lods
    meshes = [levels[-1]] * 3 + list(levels)
    assert vertices == sorted(len(split_at_parts(mesh).vertices) for mesh in meshes)
    for content in found["contents"].values():
        assert content["kind"] == ("B3dm" if version == "1.0" else "Gltf")
        assert version == "1.1" or content["batch"]["name"] == ["torso", "head", "l_upper_leg"]
