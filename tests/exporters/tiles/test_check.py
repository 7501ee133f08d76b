"""Checks of foreign tilesets: legal ones pass, and unchecked parts are reported."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from exporters.tiles.check_metadata import check_entity
from exporters.tiles.gather import write_figures
from exporters.tiles.volumes import Volume
from exporters.validate import validate
from exporters.write import write
from georef.geodesy import ecef_from_geodetic
from georef.placement import GeoPlacement
from tests.exporters.analytic import ZURICH, asset, capsule

SMALL = (capsule(8, 2),)


def _codes(folder: Path, severity: str) -> set[str]:
    return {finding.code for finding in validate(folder, external=False) if finding.severity == severity}


def _change(folder: Path, change: Callable[[Any], Any], name: str = "tileset.json") -> None:
    document = json.loads((folder / name).read_text())
    change(document)
    (folder / name).write_text(json.dumps(document))


@pytest.fixture
def many(tmp_path: Path) -> Path:
    """Twenty figures in files of at most five."""
    for number in range(20):
        place = GeoPlacement(8.5 + number * 1e-3, 47.4, 400.0)
        write(asset(place, lods=SMALL, name=f"figure {number}"), tmp_path / "in" / f"{number}.glb")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("exporters.tiles.tree.FIGURES_PER_FILE", 8)
        write_figures([tmp_path / "in"], tmp_path / "out")
    assert len(list((tmp_path / "out").glob("tileset_*.json"))) == 3
    assert validate(tmp_path / "out", external=False) == []
    return tmp_path / "out"


def test_vertices_are_checked_against_volumes_of_other_files(many: Path) -> None:
    _change(
        many, lambda d: d["root"]["boundingVolume"]["box"].__setitem__(0, d["root"]["boundingVolume"]["box"][0] + 50)
    )
    assert _codes(many, "error") == {"OUTSIDE_VOLUME"}
    assert _codes(many, "warning") == {"CHILD_VOLUME"}


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda tile: tile["metadata"].update({"class": "x"}), "METADATA"),
        (lambda tile: tile["metadata"]["properties"].pop("name"), "METADATA"),
        (lambda tile: tile["metadata"]["properties"].update(extra=1), "METADATA"),
        (lambda tile: tile["metadata"]["properties"].update(longitude="8.5"), "METADATA_TYPE"),
        (lambda tile: tile["metadata"]["properties"].update(parts="head"), "METADATA_TYPE"),
        (lambda tile: tile["transform"].__setitem__(12, tile["transform"][12] + 0.002), "PLACE"),
        (lambda tile: tile["content"].update(uri="figures/gone.glb"), "CONTENT"),
    ],
)
def test_faults_in_further_files(many: Path, change: Callable[[Any], Any], code: str) -> None:
    _change(many, lambda d: change(d["root"]["children"][0]), "tileset_2.json")
    assert code in _codes(many, "error")


def test_a_turned_figure_is_found_at_the_pole_too(tmp_path: Path) -> None:
    write(asset(GeoPlacement(30.0, 90.0, heading_deg=10.0), lods=SMALL), tmp_path)
    assert validate(tmp_path, external=False) == []

    def turn(document: Any) -> None:
        matrix = np.array(document["root"]["transform"]).reshape(4, 4).T
        angle = np.radians(0.05)
        spin = np.eye(4)
        spin[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        document["root"]["transform"] = (matrix @ spin).T.ravel().tolist()

    _change(tmp_path, turn)
    assert _codes(tmp_path, "error") == {"PLACE"}


def test_a_figure_that_no_transform_places_is_found(tmp_path: Path) -> None:
    write(asset(ZURICH, lods=SMALL), tmp_path)
    _change(tmp_path, lambda d: d["root"].pop("transform"))
    assert _codes(tmp_path, "error") == {"PLACE"}


def _foreign(folder: Path, **root: Any) -> Path:
    write(asset(lods=SMALL), folder / "a.glb", overwrite=True)
    tile = {"boundingVolume": {"box": [0, 0, 1, 2, 0, 0, 0, 2, 0, 0, 0, 2]}, "geometricError": 1, "refine": "ADD"}
    document = {"asset": {"version": "1.1"}, "geometricError": 10, "root": tile | root}
    (folder / "tileset.json").write_text(json.dumps(document))
    return folder


def test_scaled_transforms_of_others_are_a_warning(tmp_path: Path) -> None:
    scaled = [2.0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 4e6, 1e6, 5e6, 1]
    _foreign(tmp_path, content={"uri": "a.glb"}, transform=scaled)
    assert [(each.severity, each.code) for each in validate(tmp_path, external=False)] == [("warning", "TRANSFORM")]
    _foreign(tmp_path, content={"uri": "a.glb"}, transform=[0.0, *scaled[1:]])
    assert _codes(tmp_path, "error") == {"TRANSFORM"}


@pytest.mark.parametrize("magic", [b"pnts", b"i3dm", b"cmpt", b"vctr", b"geom"])
def test_other_types_of_content_are_reported_as_unchecked(tmp_path: Path, magic: bytes) -> None:
    (tmp_path / "b.bin").write_bytes(magic + bytes(28))
    _foreign(tmp_path, contents=[{"uri": "a.glb"}, {"uri": "b.bin?v=3"}, {"uri": "https://example.org/c.glb"}])
    found = validate(tmp_path, external=False)
    assert [(each.severity, each.code) for each in found] == [("info", "NOT_CHECKED")] * 2


def test_implicit_tiling_is_reported_as_unchecked(tmp_path: Path) -> None:
    _foreign(tmp_path, content={"uri": "{level}/{x}/{y}.glb"}, implicitTiling={"subdivisionScheme": "QUADTREE"})
    assert [each.code for each in validate(tmp_path, external=False)] == ["NOT_CHECKED"]


def test_a_child_may_reach_out_of_its_parent_if_its_content_does_not(tmp_path: Path) -> None:
    child = {"boundingVolume": {"sphere": [0, 0, 1, 9]}, "geometricError": 0, "content": {"uri": "a.glb"}}
    _foreign(tmp_path, children=[child])
    assert [(each.severity, each.code) for each in validate(tmp_path, external=False)] == [("info", "CHILD_VOLUME")]


def test_features_of_1_1_in_1_0_are_a_warning(tmp_path: Path) -> None:
    _foreign(tmp_path, contents=[{"uri": "a.glb"}])
    _change(tmp_path, lambda d: d["asset"].update(version="1.0"))
    assert _codes(tmp_path, "warning") == {"VERSION_1_1"}
    assert _codes(tmp_path, "error") == set()


def test_a_schema_in_a_file_of_its_own_is_read(tmp_path: Path) -> None:
    _foreign(tmp_path, content={"uri": "a.glb"}, metadata={"class": "tile", "properties": {"id": 5}})
    _change(tmp_path, lambda d: d.update(schemaUri="schema.json"))
    assert _codes(tmp_path, "error") == {"SCHEMA", "METADATA"}
    properties = {"id": {"type": "SCALAR", "componentType": "UINT8"}}
    schema = {"id": "theirs", "classes": {"tile": {"properties": properties}}}
    (tmp_path / "schema.json").write_text(json.dumps(schema))
    assert validate(tmp_path, external=False) == []


@pytest.mark.parametrize(
    ("kind", "good", "bad"),
    [
        ({"type": "STRING"}, ["", "ä"], [1, None, ["a"]]),
        ({"type": "BOOLEAN"}, [True], [1, "true"]),
        ({"type": "SCALAR", "componentType": "UINT8"}, [0, 255, 7.0], [-1, 256, 0.5, True, "1"]),
        ({"type": "SCALAR", "componentType": "INT8"}, [-128, 127], [128]),
        ({"type": "SCALAR", "componentType": "FLOAT32"}, [1, 1.5], [float("nan"), "1"]),
        ({"type": "VEC3", "componentType": "FLOAT64"}, [[1, 2, 3]], [[1, 2], 1]),
        ({"type": "MAT2", "componentType": "FLOAT64"}, [[1, 2, 3, 4]], [[[1, 2], [3, 4]]]),
        ({"type": "STRING", "array": True}, [[], ["a"]], ["a", [1]]),
        ({"type": "STRING", "array": True, "count": 2}, [["a", "b"]], [["a"]]),
        ({"type": "ENUM", "enumType": "sex"}, ["f"], ["x", 1]),
        ({"type": "NONSENSE"}, [], [1]),
    ],
)
def test_values_of_metadata(kind: dict[str, Any], good: list[Any], bad: list[Any]) -> None:
    enums = {"sex": {"values": [{"name": "f", "value": 0}]}}
    schema = {"id": "s", "classes": {"c": {"properties": {"p": kind}}}, "enums": enums}
    for value in good:
        assert list(check_entity({"class": "c", "properties": {"p": value}}, schema, "here")) == []
    for value in bad:
        (found,) = check_entity({"class": "c", "properties": {"p": value}}, schema, "here")
        assert found.code == "METADATA_TYPE"


def _volume(kind: str, values: list[float]) -> Volume:
    return Volume({kind: values}, np.eye(4), "here")


def test_distances_by_which_volumes_reach_out() -> None:
    box = _volume("box", [0, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0, 5])
    assert box.excess_of(_volume("sphere", [0, 0, 0, 3])) == pytest.approx(0)
    assert box.excess_of(_volume("sphere", [1, 0, 0, 3])) == pytest.approx(1)
    assert box.excess_of(_volume("box", [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 7])) == pytest.approx(2)
    sphere = _volume("sphere", [0, 0, 0, 10])
    assert sphere.excess_of(_volume("sphere", [3, 4, 0, 6])) == pytest.approx(1)
    assert sphere.excess_of(_volume("box", [0, 0, 0, 6, 0, 0, 0, 8, 0, 0, 0, 0.1])) == pytest.approx(5e-4, abs=1e-6)
    # A quarter of a degree of the equator, 28 km: its middle is 9 m above the chord.
    region = _volume("region", [0, 0, np.radians(0.25), np.radians(1e-6), 0, 1])
    centre = ecef_from_geodetic([[0.125, 0, 0]])[0].tolist()
    assert (
        _volume("sphere", [*centre, 14_000]).excess_of(region)
        < 0
        < _volume("sphere", [*centre, 13_000]).excess_of(region)
    )
    half_turn = Volume({"box": [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]}, np.diag([2.0, 2.0, 2.0, 1.0]), "scaled")
    assert box.excess_of(half_turn) < 0
    assert _volume("box", [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]).excess_of(half_turn) == pytest.approx(1)
