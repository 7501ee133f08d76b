"""The pictorial map: its script draws it, its world file places it, its people come to stand where it shows them."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyproj
import pytest
from PIL import Image

from exporters.inspect import inspect
from exporters.validate import validate

pytest.importorskip("resvg_py")

from examples import draw_map, place_three_from_map
from examples.place_three_from_map import MAP

FIGURES = list(csv.DictReader((MAP / "figures.csv").open(encoding="utf-8", newline="")))


def test_the_sheet_is_what_the_script_draws(tmp_path: Path) -> None:
    sheet, world, reference, table = draw_map.run(tmp_path)
    stored, fresh = (np.asarray(Image.open(path)).astype(int) for path in (MAP / "map.jpg", sheet))
    assert stored.shape == fresh.shape == (draw_map.HEIGHT, draw_map.WIDTH, 3)
    # Another version of the renderer, or of what compresses it, may smooth edges a little differently.
    assert np.abs(stored - fresh).mean() < 2
    assert world.read_text() == (MAP / "map.jgw").read_text()
    assert pyproj.CRS.from_wkt(reference.read_text()) == pyproj.CRS.from_wkt((MAP / "map.prj").read_text())
    assert table.read_text() == (MAP / "figures.csv").read_text()
    assert sum(path.stat().st_size for path in MAP.iterdir()) < 600_000


def test_the_world_file_gives_the_edges_and_the_feet() -> None:
    dx, _, _, dy, lon, lat = map(float, (MAP / "map.jgw").read_text().split())
    edges = [lon - dx / 2, lat + dy * (draw_map.HEIGHT - 0.5), lon + dx * (draw_map.WIDTH - 0.5), lat - dy / 2]
    np.testing.assert_allclose(edges, [draw_map.WEST, draw_map.SOUTH, draw_map.EAST, draw_map.NORTH], atol=1e-8)
    for row, (_, *place) in zip(FIGURES, draw_map.PEOPLE, strict=True):
        # Feet are noted to a tenth of a pixel.
        at = [lon + dx * (float(row["x"]) - 0.5), lat + dy * (float(row["y"]) - 0.5)]
        np.testing.assert_allclose(at, place, atol=0.06 * dx)


def test_people_are_drawn_in_their_boxes() -> None:
    sheet = np.asarray(Image.open(MAP / "map.jpg")).astype(int)
    for row in FIGURES:
        left, top, right, bottom = map(int, row["box_on_map"].split())
        assert bottom == round(float(row["y"]))
        assert left < float(row["x"]) < right
        figure = np.asarray(Image.open(MAP / row["figure"]).convert("RGBA"))
        mask = figure[..., 3] > 128
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        cut = Image.fromarray(figure[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1])
        small = np.asarray(cut.resize((right - left, bottom - top), Image.Resampling.BOX)).astype(int)
        inside = small[..., 3] > 250
        off = np.abs(small[..., :3] - sheet[top:bottom, left:right])[inside]
        assert off.mean() < 20, row["name"]


@pytest.mark.slow
def test_people_come_to_stand_where_the_map_shows_them(tmp_path: Path) -> None:
    # As a user runs it, but for the quality.
    script = [sys.executable, place_three_from_map.__file__, tmp_path, "draft"]
    done = subprocess.run([*map(str, script)], capture_output=True, text=True, check=False, timeout=1200)
    assert done.returncode == 0, done.stderr
    *made, tileset = map(Path, done.stdout.splitlines())
    assert all(path.is_file() for path in (*made, tileset))
    assert sorted(path.stem for path in made if path.suffix == ".usdc") == ["farmer", "footballer", "market_woman"]
    # The map is 50 km across: its figures are visible from where the whole map is.
    assert 103.9 * json.loads(tileset.read_text())["geometricError"] > 1e6
    models = [path for path in made if path.suffix == ".glb"]
    assert [path.name for path in models] == ["footballer.glb", "market_woman.glb", "farmer.glb"]
    for path, row, (_, lon, lat) in zip(models, FIGURES, draw_map.PEOPLE, strict=True):
        facts = inspect(path)
        assert facts["placement"]["lon_deg"] == pytest.approx(lon, abs=2e-5)
        assert facts["placement"]["lat_deg"] == pytest.approx(lat, abs=2e-5)
        # The sheet has north at the top.
        assert facts["placement"]["heading_deg"] == pytest.approx(180, abs=1e-6)
        low, high = facts["bounds_m"]
        assert low[1] == pytest.approx(0, abs=1)
        assert high[1] == pytest.approx(float(row["height-m"]), rel=0.02)
    assert not [finding for finding in validate(tileset, external=False) if finding.severity != "info"]
    index = json.loads((tileset.parent / "index.geojson").read_text())
    assert {each["properties"]["name"] for each in index["features"]} == {row["name"] for row in FIGURES}
