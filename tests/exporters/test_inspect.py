"""Facts read back from every format are those that went in."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from exporters.errors import ExportError
from exporters.inspect import inspect
from exporters.level_error import level_errors
from exporters.tiles.gather import write_figures
from exporters.write import FORMATS, write
from georef.placement import GeoPlacement
from tests.exporters.analytic import EXACT_VOLUME, ZURICH, asset, capsule

FACTS = ["a.glb", "a.gltf", "a.usda", "a.usdc", "a.usdz", "a.ply", "a.obj", "a.czml", "a.geojson", "tiles"]


@pytest.mark.parametrize("name", FACTS)
def test_facts_of_every_format(tmp_path: Path, name: str) -> None:
    written = write(asset(ZURICH), tmp_path / name)
    facts = inspect(tmp_path / name)
    assert json.loads(json.dumps(facts)) == facts
    assert facts["files"] == {path.name: path.stat().st_size for path in written}
    assert facts["triangles"] == len(capsule().faces)
    assert facts["size_m"] == pytest.approx([0.6, 1.8, 0.6], abs=1e-6)
    assert (facts["watertight"], facts["solid"], facts["components"], facts["genus"]) == (True, True, 1, 0)
    assert facts["volume_m3"] == pytest.approx(EXACT_VOLUME, rel=0.02)  # a 32-gon for a circle
    place = facts["placement"]
    assert (place["lon_deg"], place["lat_deg"]) == pytest.approx((8.5417, 47.3769), abs=1e-12)
    # Through ECEF, where float64 has steps of 1e-9 m.
    assert (place["height_m"], place["heading_deg"]) == pytest.approx((455.34, 135.0), abs=1e-6)
    assert place["height_datum"] == "egm96"
    if name != "a.ply":
        assert facts["texture_px"] == [64, 64]
    if name not in ("a.ply", "a.obj"):
        assert facts["parts"] == ["torso", "head", "l_upper_leg"]
        assert facts["name"] == "farmer"
        assert facts["copyright"] == "© Zürich map, CC BY 4.0"
        assert facts["metadata"] == {"source": "farmer.png", "seed": 7}


def test_levels_of_detail_of_a_tileset(tmp_path: Path) -> None:
    write(asset(ZURICH), tmp_path)
    lods = inspect(tmp_path)["lods"]
    assert [lod["uri"] for lod in lods] == ["farmer.glb", "farmer_lod1.glb", "farmer_lod2.glb"]
    assert [lod["triangles"] for lod in lods] == [len(mesh.faces) for mesh in asset().lods]
    assert [lod["geometric_error_m"] for lod in lods] == list(level_errors(asset().lods))


@pytest.mark.parametrize("name", ["a.usda", "a.usdc", "a.usdz"])
def test_levels_of_detail_of_usd(tmp_path: Path, name: str) -> None:
    write(asset(ZURICH), tmp_path / name)
    lods = inspect(tmp_path / name)["lods"]
    assert [lod["variant"] for lod in lods] == ["LOD0", "LOD1", "LOD2"]
    assert [lod["triangles"] for lod in lods] == [len(mesh.faces) for mesh in asset().lods]
    assert all(lod["solid"] and lod["texture_px"] == [64, 64] for lod in lods)


def test_tilesets_and_indexes_of_many_report_their_number(tmp_path: Path) -> None:
    for number in range(3):
        write(asset(ZURICH, lods=(capsule(8, 2),)), tmp_path / "in" / f"{number}.glb")
    write_figures([tmp_path / "in"], tmp_path / "out")
    for name in ("tileset.json", "index.geojson", "figures.czml"):
        facts = inspect(tmp_path / "out" / name)
        assert facts["metadata"] == {"figures": 3}
        assert facts["files"] == {name: (tmp_path / "out" / name).stat().st_size}


@pytest.mark.parametrize("name", FACTS[:-3])
def test_files_without_a_place_have_no_placement(tmp_path: Path, name: str) -> None:
    write(asset(copyright="", metadata={}), tmp_path / name)
    facts = inspect(tmp_path / name)
    assert facts["placement"] is None
    assert facts["lods"] is None or name.startswith("a.usd")


def test_the_place_of_a_tileset_is_that_of_its_transform(tmp_path: Path) -> None:
    write(asset(GeoPlacement(-70.0, -30.0, 10.0, heading_deg=200.0)), tmp_path)
    document = json.loads((tmp_path / "tileset.json").read_text())
    document["asset"]["extras"]["georeference"]["lon_deg"] = 0.0
    (tmp_path / "tileset.json").write_text(json.dumps(document))
    place = inspect(tmp_path)["placement"]
    assert (place["lon_deg"], place["heading_deg"]) == pytest.approx((-70.0, 200.0), abs=1e-6)


def test_holes_are_reported(tmp_path: Path) -> None:
    whole = capsule()
    write(asset(lods=(capsule(faces=whole.faces[1:]),)), tmp_path / "a.glb")
    facts = inspect(tmp_path / "a.glb")
    assert (facts["watertight"], facts["solid"], facts["genus"]) == (False, False, None)


@pytest.mark.parametrize("name", [*(f"a{suffix}" for suffix in FORMATS), "tileset.json", "a.txt"])
def test_invalid_and_missing_files_are_input_errors(tmp_path: Path, name: str) -> None:
    with pytest.raises(ExportError, match="no such file or folder; check the path"):
        inspect(tmp_path / name)
    (tmp_path / name).write_bytes(b"garbage \x00\xff")
    with pytest.raises(ExportError, match=name):
        inspect(tmp_path / name)
