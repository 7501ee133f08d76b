"""CZML and GeoJSON: their places, and the checks of them; for CesiumJS see test_clients_tiles.py."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from exporters.errors import ExportError
from exporters.gis.czml import description, entity_quaternion, packet, quaternion
from exporters.gis.geojson import feature
from exporters.placed_figure import PlacedFigure
from exporters.validate import validate
from exporters.write import check_outputs, in_order, write
from fig2mesh.commands.main import main
from georef.geodesy import ecef_from_asset
from georef.placement import GeoPlacement
from tests.exporters.analytic import ZURICH, asset, capsule
from tests.georef.strategies import placements

SMALL = asset(ZURICH, lods=(capsule(8, 2),))
FIGURE = PlacedFigure("farmer", ZURICH, (0, 0, 0), (1, 1, 1), ("farmer.glb",), (0.0,))
CLAMPED = GeoPlacement(8.5, 47.4, 0.0, altitude_mode="clamp")


def _rotation(quaternion: list[float]) -> np.ndarray:
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@settings(max_examples=200, deadline=None)
@given(placements)
def test_the_quaternion_is_the_rotation_that_tiles_have(place: GeoPlacement) -> None:
    found = entity_quaternion(place)
    assert math.hypot(*found) == pytest.approx(1, abs=1e-15)
    assert found[3] >= 0
    # An entity's x, y, z are the model's front, left and up.
    assert np.allclose(_rotation(found), ecef_from_asset(place).matrix[:3, [2, 0, 1]], atol=1e-14)


@given(st.integers(0, 2), st.integers(-1, 1))
def test_half_turns_have_quaternions(axis: int, sign: int) -> None:
    turn = -np.eye(3)
    turn[axis, axis] = 1
    found = quaternion(turn)
    assert np.allclose(_rotation(found), turn)
    assert next(value for value in found if value) > 0


def test_a_feature_has_lon_lat_and_ellipsoidal_height() -> None:
    found = feature(FIGURE, "a b.glb")
    assert found["geometry"] == {"type": "Point", "coordinates": [8.5417, 47.3769, 455.34]}
    assert found["properties"]["heading_deg"] == 135.0
    assert found["properties"]["model"] == "a%20b.glb"
    clamped = feature(PlacedFigure("x", CLAMPED, (0, 0, 0), (1, 1, 1), ("x.glb",), (0.0,)), None)
    assert clamped["geometry"]["coordinates"] == [8.5, 47.4]
    assert set(clamped["properties"]) == set(found["properties"])


@pytest.mark.parametrize(
    ("height", "mode", "reference"),
    [(5.0, "absolute", "NONE"), (0.0, "clamp", "CLAMP_TO_GROUND"), (5.0, "clamp", "RELATIVE_TO_GROUND")],
)
def test_clamped_figures_stand_on_the_terrain(height: float, mode: Any, reference: str) -> None:
    place = GeoPlacement(8.5, 47.4, height, altitude_mode=mode)
    found = packet(PlacedFigure("x", place, (0, 0, 0), (1, 1, 1), ("x.glb",), (0.0,)), "id", "x.glb")
    assert found["model"]["heightReference"] == reference
    assert found["position"]["cartographicDegrees"] == [8.5, 47.4, height]


def test_foreign_text_is_escaped() -> None:
    evil = PlacedFigure(
        "<b>", ZURICH, (0, 0, 0), (1, 1, 1), ("x.glb",), (0.0,), "<script>alert('a')</script>", 'A & B "C"', ("<i>",)
    )
    text = description(evil)
    assert "<script>" not in text
    assert "&lt;script&gt;alert(&#x27;a&#x27;)&lt;/script&gt;" in text
    assert "A &amp; B &quot;C&quot;" in text
    assert "<i>" not in text


@pytest.mark.parametrize("suffix", [".czml", ".geojson"])
@pytest.mark.parametrize("place", [ZURICH, CLAMPED, GeoPlacement(0, 90), GeoPlacement(-180, -90), GeoPlacement(180, 0)])
def test_the_model_is_next_to_the_file_and_all_is_valid(tmp_path: Path, suffix: str, place: GeoPlacement) -> None:
    written = write(asset(place, name="a name"), tmp_path / f"my farmer{suffix}")
    assert [path.name for path in written] == ["my farmer.glb", f"my farmer{suffix}"]
    assert validate(written[-1], external=False) == []


@pytest.mark.parametrize("suffix", [".czml", ".geojson"])
def test_without_a_place_nothing_is_written(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(ExportError, match="--lonlat"):
        write(asset(lods=SMALL.lods), tmp_path / f"a{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_one_model_for_all_of_them(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("a.czml", "a.geojson", "a.glb")]
    check_outputs(paths)
    for path in in_order(paths):
        write(SMALL, path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.czml", "a.geojson", "a.glb"]


def _edit(path: Path, change: Callable[[Any], None]) -> set[str]:
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    return {each.code for each in validate(path, external=False) if each.severity == "error"}


GEOJSON_FAULTS: dict[str, tuple[Callable[[Any], None], str]] = {
    "moved": (lambda d: d["geometry"]["coordinates"].__setitem__(0, 8.5418), "PLACE"),
    "raised": (lambda d: d["geometry"]["coordinates"].__setitem__(2, 455.35), "PLACE"),
    "turned": (lambda d: d["properties"].update(heading_deg=135.02), "PLACE"),
    "range": (lambda d: d["geometry"].update(coordinates=[8.0, 97.0]), "LONLAT"),
    "no numbers": (lambda d: d["geometry"].update(coordinates=["8", "47"]), "COORDINATES"),
    "model gone": (lambda d: d["properties"].update(model="gone.glb"), "REFERENCE"),
    "type": (lambda d: d.update(type="Figure"), "TYPE"),
    "no geometry": (lambda d: d.pop("geometry"), "FEATURE"),
    "no features": (lambda d: d.update(type="FeatureCollection"), "FEATURES"),
}


@pytest.mark.parametrize("fault", GEOJSON_FAULTS)
def test_faults_of_geojson(tmp_path: Path, fault: str) -> None:
    change, code = GEOJSON_FAULTS[fault]
    write(SMALL, tmp_path / "a.geojson")
    assert _edit(tmp_path / "a.geojson", change) == {code}


CZML_FAULTS: dict[str, tuple[Callable[[Any], None], str]] = {
    "moved": (lambda d: d[1]["position"].update(cartographicDegrees=[8.5418, 47.3769, 455.34]), "PLACE"),
    "range": (lambda d: d[1]["position"].update(cartographicDegrees=[98.0, 147.0, 0.0]), "LONLAT"),
    "turned": (lambda d: d[1]["orientation"].update(unitQuaternion=[0, 0, 0, 1]), "PLACE"),
    "long": (lambda d: d[1]["orientation"].update(unitQuaternion=[0, 0, 0, 2]), "ORIENTATION"),
    "clamped": (lambda d: d[1]["model"].update(heightReference="CLAMP_TO_GROUND"), "HEIGHT_REFERENCE"),
    "unknown": (lambda d: d[1]["model"].update(heightReference="GROUND"), "HEIGHT_REFERENCE"),
    "model gone": (lambda d: d[1]["model"].update(gltf="gone.glb"), "REFERENCE"),
    "no document": (lambda d: d[0].update(id="x"), "DOCUMENT"),
    "no packets": (lambda d: d.clear(), "PACKETS"),
}


@pytest.mark.parametrize("fault", CZML_FAULTS)
def test_faults_of_czml(tmp_path: Path, fault: str) -> None:
    change, code = CZML_FAULTS[fault]
    write(SMALL, tmp_path / "a.czml")
    assert code in _edit(tmp_path / "a.czml", change)


def test_foreign_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    places = {
        "type": "FeatureCollection",
        "crs": {},
        "features": [
            {"type": "Feature", "properties": None, "geometry": None},
            {
                "type": "Feature",
                "properties": {"model": "https://example.org/a.glb"},
                "geometry": {"type": "Point", "coordinates": [1, 2]},
            },
            {
                "type": "Feature",
                "properties": {},
                "geometry": {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]]]},
            },
        ],
    }
    (tmp_path / "a.geojson").write_text(json.dumps(places))
    found = validate(tmp_path / "a.geojson")
    assert [(each.severity, each.code) for each in found] == [("warning", "CRS"), ("info", "NOT_CHECKED")]
    position = {"epoch": "2026-01-01T00:00:00Z", "cartographicDegrees": [0, 1, 2, 3, 60, 2, 3, 4]}
    model = {"gltf": "https://example.org/a.glb"}
    moving = [{"id": "document", "version": "1.0"}, {"id": "a", "position": position, "model": model}]
    (tmp_path / "a.czml").write_text(json.dumps(moving))
    assert {each.severity for each in validate(tmp_path / "a.czml")} == {"info"}
    for name in ("a.czml", "a.geojson"):
        (tmp_path / name).write_bytes(b"garbage \xff")
        assert [each.code for each in validate(tmp_path / name)] == ["UNREADABLE"]
    assert main(["validate", str(tmp_path / "a.czml")]) == 2
