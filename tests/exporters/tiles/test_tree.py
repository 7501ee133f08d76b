"""The tree of many figures: laws that hold for figures anywhere on the earth."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from exporters.errors import ExportError
from exporters.placed_figure import PlacedFigure
from exporters.tiles.place_tree import BRANCHES, PlaceNode, box_corners, figure_corners, place_tree
from exporters.tiles.tileset import VISIBLE_RANGE_PER_ERROR
from exporters.tiles.tree import FIGURES_PER_FILE, SCHEMA, tileset_documents
from georef.geodesy import ecef_from_tile
from georef.placement import GeoPlacement
from tests.exporters.walk import contents, outside
from tests.georef.strategies import placements

LOW, HIGH = (-0.4, -0.25, 0.0), (0.4, 0.35, 1.79)


def figure(place: GeoPlacement, number: int, levels: int = 1) -> PlacedFigure:
    names = tuple(f"figures/{number}_lod{lod}.glb" for lod in range(levels))
    errors = tuple(0.01 * lod for lod in range(levels))
    return PlacedFigure(f"figure {number}", place, LOW, HIGH, names, errors, parts=("head", "torso"))


def crowd(count: int, seed: int = 0, spread_deg: float | None = None) -> list[PlacedFigure]:
    """Figures all over the earth, evenly by area, or within some degrees of a place."""
    random = np.random.default_rng(seed)
    lon = random.uniform(-180, 180, count)
    lat = np.degrees(np.arcsin(random.uniform(-1, 1, count)))
    if spread_deg is not None:
        lon, lat = 8.5 + random.normal(0, spread_deg, count), 47.4 + random.normal(0, spread_deg, count)
    heights, headings = random.uniform(-400, 4000, count), random.uniform(0, 360, count)
    return [
        figure(GeoPlacement(float(x), float(y), float(z), heading_deg=float(turn)), number)
        for number, (x, y, z, turn) in enumerate(zip(lon, lat, heights, headings, strict=True))
    ]


def documents(figures: list[PlacedFigure], **options: Any) -> dict[str, Any]:
    return json.loads(json.dumps(dict(tileset_documents(figures, options.pop("visible_from_m", 2000.0), **options))))


def check_laws(figures: list[PlacedFigure], found: dict[str, Any]) -> None:
    """Each content once, inside every box above it, errors that never grow downwards, a figure where it should be."""
    met = list(contents(found))
    wanted = [uri for each in figures for uri in each.contents]
    assert sorted(each.uri for each in met) == sorted(wanted)
    by_uri = {uri: each for each in figures for uri in each.contents}
    for each in met:
        source = by_uri[each.uri]
        placed = ecef_from_tile(source.placement)
        assert np.array_equal(each.matrix, placed.matrix)
        corners = placed.apply(
            [[x, y, z] for x in (LOW[0], HIGH[0]) for y in (LOW[1], HIGH[1]) for z in (LOW[2], HIGH[2])]
        )
        for centre, axes in each.boxes:
            assert outside(corners, centre, axes) < 0
        for (centre, axes), (inner, inner_axes) in zip(each.boxes, each.boxes[1:], strict=False):
            # Levels of detail share one box; rounding in ECEF is 1e-9 m.
            assert outside(box_corners([*inner, *inner_axes.ravel()]), centre, axes) < 1e-8
        assert list(each.errors) == sorted(each.errors, reverse=True)


@settings(max_examples=60, deadline=None)
@given(st.lists(placements, min_size=1, max_size=40))
def test_figures_anywhere_are_reached_once_and_inside_all_boxes(places: list[GeoPlacement]) -> None:
    figures = [figure(place, number, levels=1 + number % 3) for number, place in enumerate(places)]
    check_laws(figures, documents(figures))


@pytest.mark.parametrize(
    "places",
    [
        [GeoPlacement(0, 90), GeoPlacement(120, 90, 5.0), GeoPlacement(-120, 89.9999)],
        [GeoPlacement(0, -90), GeoPlacement(77, -90), GeoPlacement(0, 90)],
        [GeoPlacement(180, 10), GeoPlacement(-180, 10), GeoPlacement(179.99999, 10), GeoPlacement(-179.99999, 10)],
        [GeoPlacement(8.5, 47.4, 400.0)] * 50,
        [GeoPlacement(0, 0), GeoPlacement(180, 0)],
        [
            GeoPlacement(0, 0),
            GeoPlacement(90, 0),
            GeoPlacement(180, 0),
            GeoPlacement(-90, 0),
            GeoPlacement(0, 90),
            GeoPlacement(0, -90),
        ],
    ],
    ids=["north pole", "south pole", "antimeridian", "one place", "antipodes", "all round"],
)
def test_special_places_need_no_special_cases(places: list[GeoPlacement]) -> None:
    figures = [figure(place, number) for number, place in enumerate(places)]
    check_laws(figures, documents(figures))


@pytest.mark.parametrize("spread", [None, 2.0, 0.01])
def test_a_thousand_figures(spread: float | None) -> None:
    figures = crowd(1000, spread_deg=spread)
    found = documents(figures)
    check_laws(figures, found)
    assert len(found) == 3  # two further files of at most 512 figures


@pytest.mark.parametrize("count", [1, 2, 7, 8, 9, 64, 65, 511, 512, 513, 4097])
def test_the_tree_is_as_flat_as_eight_branches_allow(count: int) -> None:
    centres = np.random.default_rng(count).normal(0, 1e3, (count, 1, 3)) + [6.4e6, 0, 0]
    tree = place_tree(centres + np.zeros((1, 8, 1)))
    assert tree.depth == max(1, math.ceil(round(math.log(count, BRANCHES), 9)))
    assert tree.count == count

    def nodes(node: PlaceNode) -> list[PlaceNode]:
        return [node, *(inner for child in node.children for inner in nodes(child))]

    every = nodes(tree)
    assert sorted(index for node in every for index in node.figures) == list(range(count))
    assert all(len(node.children) + len(node.figures) <= BRANCHES for node in every)
    assert all(node.count == sum(child.count for child in node.children) for node in every if node.children)
    # Leaves are full: no more nodes than figures need, within a factor that uneven division explains.
    assert len(every) <= 1.5 * (count / 7 + 1)


def test_neighbours_come_together() -> None:
    figures = crowd(2000)
    tree = place_tree(np.array([figure_corners(each.placement, LOW, HIGH) for each in figures]))
    leaves = [tree]
    while any(node.children for node in leaves):
        leaves = [inner for node in leaves for inner in (node.children or (node,))]
    longest = [2 * float(np.linalg.norm(np.array(leaf.box[3:]).reshape(3, 3), axis=1).max()) for leaf in leaves]
    # 2,000 figures on the earth, 8 a leaf: squares of 1,400 km a side. Random groups would be 12,000 km long.
    assert np.median(longest) < 3e6


def test_boxes_lie_flat() -> None:
    figures = [figure(GeoPlacement(8 + x / 10, 47 + y / 10, 400.0), 10 * x + y) for x in range(8) for y in range(8)]
    (document,) = documents(figures).values()
    half = np.linalg.norm(np.reshape(document["root"]["boundingVolume"]["box"][3:], (3, 3)), axis=1)
    # 53 x 78 km: the earth bulges by (53^2 + 78^2) / 8 / 6371 km = 175 m between the corners.
    assert half[0] == pytest.approx(26.5e3, rel=0.02)
    assert half[1] == pytest.approx(39e3, rel=0.02)
    assert half[2] == pytest.approx(175 / 2, rel=0.2)


def test_files_stay_small_and_refer_to_one_another_without_cycles() -> None:
    figures = crowd(3000, spread_deg=1.0)
    found = documents(figures)
    sizes = {name: len(json.dumps(document)) for name, document in found.items()}
    assert len(found) == 7  # six of 500 figures each, and the one to open
    # The one to open has the inner tiles only.
    assert sizes["tileset.json"] < 20_000
    assert max(sizes.values()) < 1_000 * FIGURES_PER_FILE
    for name, document in found.items():
        assert document["schema"] == SCHEMA, name


def test_trees_of_more_files_than_one_may_name_have_levels_of_files(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("exporters.tiles.tree.FIGURES_PER_FILE", 9)
    figures = crowd(500)
    found = documents(figures)
    check_laws(figures, found)
    uris = {
        name: [part.split('"')[1] for part in json.dumps(each).split('"uri": ')[1:]] for name, each in found.items()
    }
    further = {name: sum(uri.endswith(".json") for uri in each) for name, each in uris.items()}
    # 500 > 9 * 9: the first file names files that name files.
    assert 1 < further["tileset.json"] <= 9
    assert sorted(uri for each in uris.values() for uri in each if uri.endswith(".json")) == sorted(
        name for name in found if name != "tileset.json"
    )
    assert max(further.values()) <= 64


def test_visible_from_is_the_error_of_all_inner_tiles() -> None:
    (document,) = documents(crowd(20), visible_from_m=5000.0).values()
    error = 5000.0 / VISIBLE_RANGE_PER_ERROR
    pending, inner = [document["root"]], 0
    while pending:
        tile = pending.pop()
        pending += tile.get("children", [])
        if "content" not in tile:
            inner += 1
            assert (tile["geometricError"], tile["refine"]) == (error, "ADD")
        else:
            assert (tile["geometricError"], tile["refine"]) == (0, "REPLACE")
    assert document["geometricError"] == error
    assert inner == 4


def mixed(count: int, spread_deg: float, seed: int = 3) -> list[PlacedFigure]:
    """Figures of 1.79 m, 180 m and 6 km side by side, each at its own scale."""
    random = np.random.default_rng(seed)
    found = []
    for each, height in zip(crowd(count, seed, spread_deg), random.choice([1.79, 180.0, 6186.2], count), strict=True):
        low, high = ((np.array(corner) * height / 1.79).tolist() for corner in (LOW, HIGH))
        place = replace(each.placement, figure_height_m=float(height))
        found.append(replace(each, placement=place, low=tuple(low), high=tuple(high)))
    return found


@pytest.mark.parametrize("version", ["1.0", "1.1"])
def test_figures_of_any_heights_have_their_own_ranges(version: str) -> None:
    figures = mixed(700, 2.0)
    found = documents(figures, visible_from_m=None, version=version)
    ranges = {each.contents[0]: 2000 / 1.79 * each.placement.figure_height_m for each in figures}
    met = list(contents(found))
    assert {each.uri for each in met} == set(ranges)
    for each in met:
        # CesiumJS tests a tile against the error of its parent, the one before its own, and each one above.
        assert each.errors[-2] * VISIBLE_RANGE_PER_ERROR == pytest.approx(ranges[each.uri], rel=1e-9)
        assert list(each.errors) == sorted(each.errors, reverse=True)
        placed = ecef_from_tile(figures[int(each.uri.split("/")[1].split("_")[0])].placement).matrix
        assert np.array_equal(each.matrix, placed)
        for (centre, axes), (inner, inner_axes) in zip(each.boxes, each.boxes[1:], strict=False):
            assert outside(box_corners([*inner, *inner_axes.ravel()]), centre, axes) < 1e-8
    assert found["tileset.json"]["geometricError"] * VISIBLE_RANGE_PER_ERROR == pytest.approx(max(ranges.values()))


def test_people_alone_are_drawn_from_two_kilometres() -> None:
    assert documents(crowd(100), visible_from_m=None) == documents(crowd(100), visible_from_m=2000.0)


def test_a_coarse_level_is_never_worse_than_the_tileset() -> None:
    rough = PlacedFigure("rough", GeoPlacement(0, 0), LOW, HIGH, ("a.glb", "b.glb"), (0.0, 3.0))
    (document,) = documents([rough], visible_from_m=10.0).values()
    assert document["geometricError"] == document["root"]["geometricError"] == 3.0


def test_metadata_is_on_every_level_and_only_what_is_known() -> None:
    known = PlacedFigure(
        "Bäuerin",
        GeoPlacement(8.5, 47.4, 400.0, heading_deg=10.0, figure_height_m=1.6),
        LOW,
        HIGH,
        ("a.glb", "b.glb"),
        (0.0, 0.1),
        "map.png",
        "© Zürich",
        ("head", "torso"),
        (0.5, 0.25),
        0.3,
    )
    unknown = PlacedFigure("x", GeoPlacement(8.5, 47.4), LOW, HIGH, ("c.glb",), (0.0,))
    (document,) = documents([known, unknown]).values()
    assert document["metadata"] == {"class": "collection", "properties": {"figures": 2}}
    properties = {met.uri: met.tile["metadata"]["properties"] for met in contents({"tileset.json": document})}
    assert properties["a.glb"] == properties["b.glb"]
    assert properties["a.glb"] == {
        "name": "Bäuerin",
        "source": "map.png",
        "copyright": "© Zürich",
        "parts": ["head", "torso"],
        "partsObservedShare": [0.5, 0.25],
        "observedShare": 0.3,
        "longitude": 8.5,
        "latitude": 47.4,
        "height": 400.0,
        "heading": 10.0,
        "figureHeight": 1.6,
    }
    assert set(properties["c.glb"]) == {"name", "longitude", "latitude", "height", "heading", "figureHeight"}


def test_version_1_0_has_the_same_values_in_extras() -> None:
    new = documents(crowd(3))["tileset.json"]
    old = documents(crowd(3), version="1.0")["tileset.json"]
    assert old["asset"]["version"] == "1.0"
    assert "schema" not in old
    assert "metadata" not in json.dumps(old)
    pairs = zip(new["root"]["children"], old["root"]["children"], strict=True)
    assert all(one["metadata"]["properties"] == other["extras"] for one, other in pairs)


@pytest.mark.parametrize("distance", [0.0, -5.0, math.nan, math.inf])
def test_invalid_distances_are_errors(distance: float) -> None:
    with pytest.raises(ExportError, match="--visible-from"):
        documents(crowd(1), visible_from_m=distance)


@pytest.mark.slow
def test_two_thousand_figures_by_counts() -> None:
    figures = crowd(2000, spread_deg=3.0)
    found = documents(figures)
    check_laws(figures, found)
    assert max(met.depth for met in contents(found)) == 5  # four levels of 8, and the figure
    tiles = sum(text.count('"boundingVolume"') for text in map(json.dumps, found.values()))
    # 2,000 figures, 287 nodes above them, and those that begin a file named twice.
    assert tiles <= 2000 + 300 + 2 * len(found)
