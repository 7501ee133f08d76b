"""The screen of `fig2mesh globe`: every figure that is listed is drawn, or the page says that it is not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from exporters.asset import Asset, Texture
from exporters.tiles.gather import write_figures
from exporters.tiles.tileset import write_tileset
from exporters.write import write
from fig2mesh.globe.assets import find_assets
from fig2mesh.globe.page import globe_page, page_files
from fig2mesh.view.server import page_server
from tests.browser import Look, pixels, serving
from tests.exporters.analytic import HEIGHT, ZURICH, asset, capsule

SIZE = 300
COLOURS = ((255, 0, 255), (0, 255, 255), (255, 255, 0))
"""That no ground, label or panel has."""

STATE = """(async () => {
  for (let i = 0; i < 40; i++) {
    await new Promise((done) => { fig2mesh.viewer.scene.requestRender(); requestAnimationFrame(done); });
  }
  const note = document.getElementById('undrawn');
  const list = [...document.querySelectorAll('#figures button')];
  return { note: note.hidden ? '' : note.textContent, far: list.filter((each) => each.className === 'far').length,
    ground: [...document.querySelectorAll('dd')].map((each) => each.textContent) };
})()"""

WITHOUT_PANEL = "document.getElementById('panel').style.display = 'none'"

FLY = "fig2mesh.look(fig2mesh.figures.find((figure) => figure.name === {name!r}), 0)"


def tall(height: float, name: str, colour: int, east_m: float = 0.0) -> Asset:
    """A capsule of one colour as tall as that, so many metres east of Zürich, at sea level."""
    pixel = Texture(np.full((8, 8, 3), COLOURS[colour], np.uint8))
    mesh = capsule(16, 4, texture=pixel, observed=None)
    lon = ZURICH.lon_deg + east_m / 75_000
    place = replace(ZURICH, lon_deg=lon, height_m=0.0, figure_height_m=height)
    return asset(place, lods=(replace(mesh, vertices=mesh.vertices * (height / HEIGHT)),), name=name)


def share_of(png: str, colour: int) -> float:
    """Share of the screen in a colour, as a shaded or tone-mapped client shows it."""
    rgb = pixels(png)[..., :3].astype(int)
    low, high = (np.array(COLOURS[colour]) < 128), (np.array(COLOURS[colour]) >= 128)
    near = (rgb[..., high] > 200).all(axis=2) & (rgb[..., low] < 60).all(axis=2)
    return float(near.mean())


def seen(look: Look, cesium: Path, path: Path, *actions: dict[str, Any]) -> list[Any]:
    """Results of actions on the page of a model, the panels put away for the pictures."""
    assets = find_assets((path,))
    with serving(page_server(globe_page(assets), 0, {"cesium": cesium}, page_files(assets))) as address:
        found = look(address, {"evaluate": WITHOUT_PANEL}, *actions, size=(SIZE, SIZE))
    assert found["messages"] == []
    return [each.get("value", each.get("png")) for each in found["results"][1:]]


@pytest.mark.parametrize("height", [0.01, 1.79, 6186.2])
def test_one_figure_is_drawn_at_first_and_after_a_click(
    tmp_path: Path, look: Look, cesium: Path, height: float
) -> None:
    write_tileset(tall(height, "one", 0), tmp_path)
    state, first, _, again = seen(
        look,
        cesium,
        tmp_path,
        {"evaluate": STATE},
        {"screenshot": True},
        {"evaluate": "document.querySelector('#figures button').click()"},
        {"screenshot": True},
    )
    assert state["note"] == ""
    assert not any(text.startswith("-0.00") for text in state["ground"])
    assert share_of(first, 0) > 0.02
    assert share_of(again, 0) > 0.02


@pytest.mark.slow
def test_a_mixed_collection_is_drawn_or_the_page_says_what_is_not(tmp_path: Path, look: Look, cesium: Path) -> None:
    for figure in (tall(0.01, "ant", 0), tall(1.79, "person", 1, 8.0), tall(6186.2, "giant", 2, 9000.0)):
        write(figure, tmp_path / "in" / f"{figure.name}.glb")
    write_figures([tmp_path / "in"], tmp_path / "out")
    names = ("ant", "person", "giant")
    flights = [step for name in names for step in ({"evaluate": FLY.format(name=name)}, {"screenshot": True})]
    state, first, *rest = seen(look, cesium, tmp_path / "out", {"evaluate": STATE}, {"screenshot": True}, *flights)
    assert share_of(first, 2) > 0.005, "the one that is large enough"
    assert state["far"] == 2
    assert state["note"].startswith("not drawn from here: ")
    assert "ant" in state["note"]
    assert "person" in state["note"]
    for colour, picture in enumerate(rest[1::2]):
        assert share_of(picture, colour) > 0.02, names[colour]


@pytest.mark.slow
def test_figures_far_apart_are_not_an_empty_globe(tmp_path: Path, look: Look, cesium: Path) -> None:
    for number, east in enumerate((0.0, 400_000.0)):
        write(tall(1.79, f"figure {number}", 0, east), tmp_path / "in" / f"{number}.glb")
    write_figures([tmp_path / "in"], tmp_path / "out")
    state, first = seen(look, cesium, tmp_path / "out", {"evaluate": STATE}, {"screenshot": True})
    assert share_of(first, 0) > 0.02
    assert state["note"].startswith("not drawn from here: figure")


@pytest.mark.slow
def test_the_grid_is_not_painted_over_the_figure(tmp_path: Path, look: Look, cesium: Path) -> None:
    write_tileset(tall(1.79, "one", 0), tmp_path)
    _, _, with_grid, _, without = seen(
        look,
        cesium,
        tmp_path,
        {"evaluate": STATE},
        {"evaluate": "(fig2mesh.setGrid(true), 0)"},
        {"screenshot": True},
        {"evaluate": "(fig2mesh.setGrid(false), 0)"},
        {"screenshot": True},
    )
    assert abs(share_of(with_grid, 0) - share_of(without, 0)) < 0.001
