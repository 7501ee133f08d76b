"""Levels of detail that clients select on a screen of 1,080 rows: fine enough for mesh and texture, never finer."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from exporters.asset import Asset
from exporters.gltf.reader import read_gltf
from exporters.level_error import level_errors, sample_m
from exporters.placed_figure import figure_of
from exporters.tiles.gather import write_figures
from exporters.tiles.tileset import TilesVersion, tileset, write_tileset
from exporters.tiles.tree import tileset_documents
from tests.exporters.analytic import HEIGHT, ZURICH, asset, capsule, gradient_texture, shrinking
from tests.node import RunScript

ROWS, TAN = 1080, math.tan(math.radians(30)) * 1080 / 1920
"""Rows of the screen, and the tangent of half its field of view upwards: 60 degrees across 1920 columns."""

FILLS = HEIGHT / (2 * TAN)
"""Distance, metres, at which a capsule of 1.8 m is as tall as the screen."""

DISTANCES = [FILLS * factor for factor in (1.0, 2.0, 4.0, 9.0, 40.0)]


def _levels(tile: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The chain of tiles down to the finest, through inner tiles of one child each."""
    yield tile
    for child in tile.get("children", []):
        yield from _levels(child)


def selected(document: dict[str, Any], distance: float, limit: float = 16.0) -> dict[str, Any] | None:
    """The tile that a client of 3D Tiles shows from a distance to its box; None: nothing."""

    def covers(error: float) -> float:
        return error * ROWS / (distance * 2 * TAN)

    if covers(document["geometricError"]) <= limit:
        return None
    tiles = (tile for tile in _levels(document["root"]) if "content" in tile)
    return next(tile for tile in tiles if covers(tile["geometricError"]) <= limit)


def _documents(given: Asset) -> dict[str, dict[str, Any]]:
    names = tuple(f"{number}.glb" for number in range(len(given.lods)))
    (collection,) = dict(tileset_documents([figure_of(given, names)])).values()
    versions: tuple[TilesVersion, ...] = ("1.0", "1.1")
    return {"collection": collection, **{version: tileset(given, version=version) for version in versions}}


def _scaled(given: Asset, factor: float) -> Asset:
    """The figure at another size, its place and errors with it."""
    assert given.placement is not None
    lods = tuple(
        replace(mesh, vertices=mesh.vertices * factor, deviation_m=(0.0, mesh.deviation_m[1] * factor))
        for mesh in given.lods
    )
    return replace(given, lods=lods, placement=replace(given.placement, figure_height_m=HEIGHT * factor))


FIGURE = asset(replace(ZURICH, figure_height_m=HEIGHT), lods=shrinking(1024))
FIGURES = {
    "standard": FIGURE,
    "draft": replace(FIGURE, lods=shrinking(512)),
    "two levels": replace(FIGURE, lods=shrinking(1024)[:2]),
    "wide texture": replace(
        FIGURE,
        lods=tuple(
            replace(mesh, texture=replace(mesh.texture, pixels=np.zeros((256 >> level, 4096 >> level, 3), np.uint8)))
            for level, mesh in enumerate(shrinking())
        ),
    ),
    "fine mesh": replace(FIGURE, lods=tuple(replace(mesh, deviation_m=(0.0, 0.0)) for mesh in shrinking(1024))),
    "1 cm": _scaled(FIGURE, 0.01 / HEIGHT),
    "10 km": _scaled(FIGURE, 1e4 / HEIGHT),
    "vertex colours": replace(
        FIGURE, lods=tuple(replace(mesh, texture=None, uv=None, observed=None) for mesh in FIGURE.lods)
    ),
}


@pytest.mark.parametrize("name", FIGURES)
def test_the_finest_level_is_selected_where_the_figure_fills_the_view(name: str) -> None:
    given = FIGURES[name]
    assert given.placement is not None
    scale = (given.placement.figure_height_m or HEIGHT) / HEIGHT
    for document in _documents(given).values():
        chain = [tile for tile in _levels(document["root"]) if "content" in tile]
        errors = [tile["geometricError"] for tile in chain]
        assert errors == sorted(errors, reverse=True)
        found = [selected(document, distance * scale) for distance in [*DISTANCES, 500 * FILLS]]
        assert found[0] is chain[-1]
        order = [next(number for number, tile in enumerate(chain) if tile is each) for each in found]
        assert order == sorted(order, reverse=True)
        assert found[-1] is chain[0], "levels are coarse where the figure is small"


@pytest.mark.parametrize("name", FIGURES)
def test_no_selected_level_has_texels_of_more_than_two_pixels(name: str) -> None:
    given = FIGURES[name]
    assert given.placement is not None
    scale = (given.placement.figure_height_m or HEIGHT) / HEIGHT
    document = tileset(given)
    chain = [*_levels(document["root"])]
    for distance in DISTANCES:
        tile = selected(document, distance * scale)
        assert tile is not None
        level = len(chain) - 1 - chain.index(tile)
        if level:
            pixels = sample_m(given.lods[level]) * ROWS / (distance * scale * 2 * TAN)
            assert pixels <= 2


def test_texels_are_measured_on_the_figure() -> None:
    # A cylinder of 0.6 m round which the texture goes once: its 1,024 columns are 1.84 mm wide, its rows 1.76 mm high.
    assert 1.7e-3 < sample_m(shrinking(1024)[0]) < 1.85e-3
    half = capsule(texture=gradient_texture(512))
    assert sample_m(half) == pytest.approx(2 * sample_m(capsule(texture=gradient_texture(1024))))
    double = replace(half, vertices=half.vertices * 2)
    assert sample_m(double) == pytest.approx(2 * sample_m(half), rel=1e-5)


def test_triangles_without_texels_do_not_count() -> None:
    mesh = capsule()
    assert mesh.uv is not None
    assert sample_m(replace(mesh, uv=np.zeros_like(mesh.uv))) == 0.0
    assert level_errors([mesh, replace(mesh, uv=np.zeros_like(mesh.uv), deviation_m=(0.0, 0.1))]) == (0.0, 0.1)


@pytest.mark.parametrize("version", ["1.0", "1.1"])
def test_cesium_selects_the_levels_of_the_model_here(tmp_path: Path, node: RunScript, version: TilesVersion) -> None:
    given = FIGURES["standard"]
    write_tileset(given, tmp_path / "one", version=version)
    write_figures([tmp_path / "one"], tmp_path / "many") if version == "1.1" else None
    views = [
        {"lon_deg": ZURICH.lon_deg, "lat_deg": ZURICH.lat_deg, "height_m": ZURICH.height_m + HEIGHT + 1e-3 + distance}
        for distance in DISTANCES
    ]
    for folder in [tmp_path / "one", *([tmp_path / "many"] if version == "1.1" else [])]:
        document = json.loads((folder / "tileset.json").read_text())
        shown = node("visible.mjs", stdin={"tileset": str(folder / "tileset.json"), "views": views})["views"]
        expected = [selected(document, distance) for distance in DISTANCES]
        assert [each["drawn"] for each in shown] == [[tile["content"]["uri"]] for tile in expected if tile]


@pytest.mark.parametrize("factor", [0.01 / HEIGHT, 1e4 / HEIGHT])
def test_tiny_and_huge_figures_keep_their_shape(tmp_path: Path, factor: float) -> None:
    given = _scaled(FIGURE, factor)
    write_tileset(given, tmp_path)
    found = read_gltf(tmp_path / "farmer.glb").scene_vertices() / factor
    assert cKDTree(FIGURE.mesh.vertices).query(found)[0].max() < 2e-7 * HEIGHT
    box = np.array(json.loads((tmp_path / "tileset.json").read_text())["root"]["boundingVolume"]["box"])
    assert np.all(box[[3, 7, 11]] >= np.ptp(found[:, [0, 2, 1]] * factor, axis=0) / 2)
