"""The page of `fig2mesh globe` in a browser: figures, parts, levels, evidence, keys."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from exporters.asset import Asset
from exporters.gis.czml import write_czml
from exporters.gltf.glb import glb_bytes, write_gltf
from exporters.level_error import level_errors
from exporters.tiles.tileset import write_tileset
from fig2mesh.globe.assets import find_assets
from fig2mesh.globe.page import globe_page, page_files
from fig2mesh.view.server import page_server
from tests.browser import Look, pixels, serving
from tests.clients.places import BARE
from tests.exporters.analytic import HEIGHT, ZURICH, asset

EAST = replace(ZURICH, lon_deg=ZURICH.lon_deg + 4e-5, heading_deg=30.0)
NORTH = replace(ZURICH, lat_deg=ZURICH.lat_deg + 4e-5, heading_deg=250.0)
SIZE = 400

FACTS = """fig2mesh.figures.map(({ name, kind, credit, metadata, levels, size, place }) =>
  ({ name, kind, credit, metadata, levels: levels.length, size, ...place() }))"""

LOOK = """(async () => {{
  fig2mesh.figures.forEach((figure, i) => figure.show(i === {index}));
  await fig2mesh.look(fig2mesh.figures[{index}], 0);
  const {{ scene, camera }} = fig2mesh.viewer;
  const {{ Cartesian3, Matrix4, Transforms }} = Cesium;
  const {{ feet }} = fig2mesh.figures[{index}].place();
  const enu = Matrix4.inverseTransformation(Transforms.eastNorthUpToFixedFrame(feet), new Matrix4());
  const eye = Matrix4.multiplyByPoint(enu, camera.positionWC, new Cartesian3());
  scene.render();
  const bearing = Cesium.Math.zeroToTwoPi(Math.atan2(eye.x, eye.y));
  return {{ eye: Cesium.Math.toDegrees(bearing), ground: fig2mesh.state.ground,
    parts: [...document.querySelectorAll('#parts button')].map((button) => button.textContent) }};
}})()"""

LEVEL = """(async () => {{
  fig2mesh.setLevel({level});
  const figure = fig2mesh.state.current;
  await fig2mesh.drawn(figure);
  for (let i = 0; i < 200 && ({level} !== null && figure.shownLevel() !== {level}); i++) {{
    await new Promise((done) => {{ fig2mesh.viewer.scene.requestRender(); requestAnimationFrame(done); }});
  }}
  return [figure.shownLevel(), document.getElementById('level').textContent];
}})()"""


def write_by_part(figure: Asset, path: Path) -> None:
    """A file with the observed share of each part, but no mask of observed texels."""
    write_gltf(figure, path)
    document = json.loads(path.read_text())
    del document["extensions"]["EXT_structural_metadata"]["propertyTextures"]
    del document["meshes"][0]["primitives"][0]["extensions"]["EXT_structural_metadata"]
    path.write_text(json.dumps(document))


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory, look: Look, cesium: Path) -> dict[str, Any]:
    """One session of the browser, its results by name."""
    folder = tmp_path_factory.mktemp("globe")
    write_tileset(asset(ZURICH), folder / "tiles")
    write_by_part(asset(EAST), folder / "model.gltf")
    write_czml(asset(NORTH, name="marked"), folder / "people.czml")
    document = json.loads((folder / "people.czml").read_text())
    document[1]["properties"] = {"credit": "of the packet", "source": "map 7"}
    (folder / "people.czml").write_text(json.dumps(document))
    properties = {"name": "pin", "heading_deg": 90}
    point = {"type": "Point", "coordinates": [ZURICH.lon_deg, ZURICH.lat_deg - 1e-4]}
    features = [{"type": "Feature", "properties": properties, "geometry": point}]
    (folder / "index.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    paths = (folder / "tiles", folder / "model.gltf", folder / "people.czml", folder / "index.geojson")
    middle = f"new Cesium.Cartesian2({SIZE / 2}, {SIZE / 2})"
    actions: dict[str, dict[str, Any]] = {
        "at first": {"evaluate": "document.getElementById('figures').textContent"},
        "credits": {"evaluate": "document.querySelector('.cesium-viewer-bottom').textContent"},
        "bare": {"evaluate": BARE},
        "model": {"evaluate": LOOK.format(index=1)},
        "model picture": {"screenshot": True},
        "pick": {"evaluate": f"fig2mesh.at({middle}).part"},
        "click": {"evaluate": "document.querySelectorAll('#parts button')[1].click()"},
        "part": {"evaluate": "document.getElementById('part').textContent"},
        "part picture": {"screenshot": True},
        "unpart": {"key": "Escape"},
        "unpicked": {"evaluate": "fig2mesh.state.part"},
        "mouse": {"click": [SIZE // 2, SIZE // 2]},
        "clicked": {"evaluate": "fig2mesh.state.part"},
        "unclick": {"click": [5, 5]},
        "unclicked": {"evaluate": "fig2mesh.state.part"},
        "observed": {"key": "o"},
        "grain": {"evaluate": "[fig2mesh.state.mode, document.getElementById('grain').textContent]"},
        "observed picture": {"screenshot": True},
        "drawn": {"key": "o"},
        "drawn again": {"screenshot": True},
        "entity": {"evaluate": LOOK.format(index=2)},
        "pin": {"evaluate": LOOK.format(index=3)},
        "tiles": {"evaluate": LOOK.format(index=0)},
        **{f"level {level}": {"evaluate": LEVEL.format(level=level)} for level in (0, 2, 1)},
        "auto": {"key": "a"},
        "forced": {"evaluate": "fig2mesh.state.forced"},
        "next": {"key": "n"},
        "current": {"evaluate": "fig2mesh.figures.indexOf(fig2mesh.state.current)"},
        "facts": {"evaluate": FACTS},
    }
    assets = find_assets(paths)
    with serving(page_server(globe_page(assets), 0, {"cesium": cesium}, page_files(assets))) as address:
        found = look(address, *actions.values(), size=(SIZE, SIZE))
    assert found["messages"] == []
    assert [request for request in found["requests"] if not request.startswith(address)] == []
    return {
        name: result.get("value", result.get("png")) for name, result in zip(actions, found["results"], strict=True)
    }


def linear(srgb: np.ndarray) -> np.ndarray:
    """As CesiumJS decodes colours."""
    return (srgb / 255) ** 2.2


@pytest.mark.slow
def test_all_kinds_are_listed_with_place_and_credit(seen: dict[str, Any]) -> None:
    assert seen["at first"] == "farmermodelmarkedpin"
    assert "of the packet" in seen["credits"]
    tiles, model, entity, pin = seen["facts"]
    assert [each["kind"] for each in (tiles, model, entity, pin)] == ["tiles", "model", "czml", "geojson"]
    for facts, place in ((tiles, ZURICH), (model, EAST), (entity, NORTH)):
        assert facts["lon_deg"] == pytest.approx(place.lon_deg, abs=1e-9)
        assert facts["lat_deg"] == pytest.approx(place.lat_deg, abs=1e-9)
        assert facts["height_m"] == pytest.approx(place.height_m, abs=1e-3)
        assert facts["heading_deg"] == pytest.approx(place.heading_deg, abs=0.01)
    assert [facts["credit"] for facts in (tiles, model, entity)] == ["© Zürich map, CC BY 4.0"] * 2 + ["of the packet"]
    assert model["metadata"] == {"source": "farmer.png", "seed": 7}
    assert tiles["size"] == pytest.approx(HEIGHT, abs=0.01)
    assert (tiles["levels"], model["levels"]) == (3, 1)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "place"), [("tiles", ZURICH), ("model", EAST), ("entity", NORTH)])
def test_the_camera_faces_the_front_and_the_ground_is_level_with_the_feet(
    seen: dict[str, Any], name: str, place: Any
) -> None:
    assert seen[name]["eye"] == pytest.approx(place.heading_deg, abs=0.5)
    assert seen[name]["ground"] == pytest.approx(place.height_m, abs=0.6)
    assert seen[name]["parts"] == ["torso", "head", "l_upper_leg"]


@pytest.mark.slow
def test_parts_are_picked_named_and_stand_out(seen: dict[str, Any]) -> None:
    assert seen["pick"] == "torso"
    assert seen["part"] == "part: head, 50 % observed in the drawing"
    assert seen["unpicked"] is None
    assert (seen["clicked"], seen["unclicked"]) == ("torso", None)
    before, after = (pixels(seen[f"{name} picture"])[..., :3].astype(int) for name in ("model", "part"))
    rows = np.flatnonzero((before < 250).any(axis=2)[:, SIZE // 2])
    top, torso = rows[len(rows) // 10], rows[len(rows) // 2]
    np.testing.assert_allclose(after[top, SIZE // 2], before[top, SIZE // 2], atol=2)
    assert after[torso, SIZE // 2].sum() < 0.75 * before[torso, SIZE // 2].sum()


@pytest.mark.slow
def test_observed_or_inferred_is_shown_by_parts(seen: dict[str, Any]) -> None:
    assert seen["grain"] == ["observed", "by the share of each part"]
    drawn, evidence, again = (
        pixels(seen[name])[..., :3].astype(int) for name in ("model picture", "observed picture", "drawn again")
    )
    at = np.s_[SIZE // 2 - 3 : SIZE // 2 + 4, SIZE // 2 - 3 : SIZE // 2 + 4]
    assert np.abs(drawn[at] - evidence[at]).max() > 20
    # Half observed: half-way between blue and orange, a quarter of the drawing's own colour kept; in linear light.
    blue, orange, own = (linear(np.array(colour)) for colour in ((0x2B, 0x6C, 0xB0), (0xE0, 0x7B, 0x39), drawn[at]))
    expected = 255 * (0.75 * (blue + orange) / 2 + 0.25 * own) ** (1 / 2.2)
    np.testing.assert_allclose(evidence[at], expected, atol=6)
    np.testing.assert_allclose(again[at], drawn[at], atol=2)


@pytest.mark.slow
def test_levels_are_forced_and_described(seen: dict[str, Any]) -> None:
    meshes = asset().lods
    errors = level_errors(meshes)
    for level in range(3):
        shown, text = seen[f"level {level}"]
        assert shown == level
        error = "the finest mesh" if level == 0 else f"for pixels of {1000 * errors[level] / 16:.3g} mm and more"
        assert text == f"shown: LOD {level}, {error}, {len(meshes[level].faces):,} triangles"
    assert seen["forced"] is None
    assert seen["current"] == 1


@pytest.mark.slow
def test_observed_or_inferred_is_shown_by_texels_where_a_file_has_them(
    tmp_path: Path, look: Look, cesium: Path
) -> None:
    (tmp_path / "fine.glb").write_bytes(glb_bytes(asset(ZURICH)))
    actions = [
        {"evaluate": BARE},
        {"evaluate": LOOK.format(index=0)},
        {"evaluate": "fig2mesh.setMode(true)"},
        {"screenshot": True},
        {"evaluate": "(fig2mesh.viewer.camera.rotateLeft(Math.PI), fig2mesh.viewer.scene.requestRender())"},
        {"screenshot": True},
        {"evaluate": "document.getElementById('grain').textContent"},
        {"key": "o"},
        {"screenshot": True},
    ]
    assets = find_assets((tmp_path / "fine.glb",))
    with serving(page_server(globe_page(assets), 0, {"cesium": cesium}, page_files(assets))) as address:
        found = look(address, *actions, size=(SIZE, SIZE))
    assert found["messages"] == []
    assert found["results"][6]["value"] == "per point of the surface"
    front, back, drawn = (pixels(found["results"][i]["png"])[SIZE // 2, SIZE // 2, :3].astype(int) for i in (3, 5, 8))
    assert front[2] > front[0] + 60, "what the drawing showed is blue"
    assert back[0] > back[2] + 60, "what it did not is orange"
    assert abs(int(drawn[2]) - 128) < 8, "the drawing's own colour again"
