"""`write_figures`: many files into one folder, atomically, with any names and in any order."""

from __future__ import annotations

import json
import os
import random
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import exporters.write
from exporters.errors import ExportError
from exporters.figure_reader import read_figures
from exporters.gltf.reader import read_gltf
from exporters.placed_figure import figure_of
from exporters.tiles.gather import write_figures
from exporters.tiles.tileset import VISIBLE_RANGE_PER_ERROR
from exporters.validate import validate
from exporters.write import write
from fig2mesh.commands.main import main
from georef.geodesy import ecef_from_tile, tile_from_asset
from georef.placement import GeoPlacement
from tests.exporters.analytic import ZURICH, asset, capsule
from tests.exporters.walk import contents, outside

SMALL = (capsule(8, 2),)
PLACES = [
    (8.5417, 47.3769, 455.34),
    (8.5417, 47.3769, 455.34),
    (180.0, 10.0, 0.0),
    (-180.0, 10.0, 5.0),
    (0.0, 90.0, 2.0),
    (35.48, 31.55, -411.0),
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Six figures of two names, one of them in three levels of detail."""
    for number, (lon, lat, height) in enumerate(PLACES):
        place = GeoPlacement(lon, lat, height, heading_deg=30.0 * number)
        name = ("farmer", "Bäuerin/7%")[number % 2]
        if number == 2:
            write(asset(place, name=name), tmp_path / "in" / "deep" / "tiles")
        else:
            write(asset(place, lods=SMALL, name=name), tmp_path / "in" / f"{number}.glb")
    return tmp_path / "in"


def _bytes(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize("version", ["1.0", "1.1"])
def test_all_figures_are_present_and_valid(tmp_path: Path, folder: Path, version: str) -> None:
    written = write_figures([folder], tmp_path / "out", version=version)
    assert written.figures == 6
    assert {path.relative_to(tmp_path / "out").as_posix() for path in written.files} == set(_bytes(tmp_path / "out"))
    for name in ["tileset.json", "index.geojson"] + ["figures.czml"] * (version == "1.1"):
        assert validate(tmp_path / "out" / name, external=False) == []
    found = [Path(met.uri) for met in contents(tmp_path / "out")]
    assert len(found) == len(set(found)) == 8
    assert {file.suffix for file in found} == {".glb" if version == "1.1" else ".b3dm"}
    assert {str(file) for file in found} == {name for name in _bytes(tmp_path / "out") if name.startswith("figures/")}


def test_every_vertex_is_in_all_boxes_above_and_at_its_recorded_place(tmp_path: Path, folder: Path) -> None:
    write_figures([folder], tmp_path / "out")
    for met in contents(tmp_path / "out"):
        gltf = read_gltf(tmp_path / "out" / met.uri)
        points = tile_from_asset().apply(gltf.scene_vertices()) @ met.matrix[:3, :3].T + met.matrix[:3, 3]
        for centre, axes in met.boxes:
            assert outside(points, centre, axes) < 0
        record = gltf.document["asset"]["extras"]["georeference"]
        wanted = ecef_from_tile(GeoPlacement(**{key: value for key, value in record.items() if key != "crs"}))
        assert np.array_equal(met.matrix, wanted.matrix)


def test_the_order_of_the_sources_does_not_matter(tmp_path: Path, folder: Path) -> None:
    sources = [*folder.glob("*.glb"), folder / "deep" / "tiles" / "tileset.json"]
    write_figures([folder], tmp_path / "out")
    for seed in range(3):
        random.Random(seed).shuffle(sources)
        write_figures(sources, tmp_path / f"out{seed}")
        assert _bytes(tmp_path / f"out{seed}") == _bytes(tmp_path / "out")


def test_same_names_and_places_with_other_contents_keep_their_order(tmp_path: Path) -> None:
    for number, columns in enumerate((8, 10, 12)):
        write(asset(ZURICH, lods=(capsule(columns, 2),)), tmp_path / f"{number}.glb")
    sources = [tmp_path / f"{number}.glb" for number in range(3)]
    write_figures(sources, tmp_path / "one")
    write_figures(sources[::-1], tmp_path / "two")
    assert _bytes(tmp_path / "one") == _bytes(tmp_path / "two")
    assert len(list((tmp_path / "one" / "figures").iterdir())) == 3


def test_names_are_safe_unique_and_recognisable(tmp_path: Path, folder: Path) -> None:
    write(asset(ZURICH, lods=SMALL, name="FARMER"), tmp_path / "in" / "a.glb")
    write(asset(ZURICH, lods=SMALL, name="../../farmer_lod1"), tmp_path / "in" / "b.glb")
    write(asset(ZURICH, lods=SMALL, name="x" * 300), tmp_path / "in" / "c.glb")
    write_figures([folder], tmp_path / "out")
    names = [path.name for path in (tmp_path / "out" / "figures").iterdir()]
    assert len({name.casefold() for name in names}) == len(names) == 11
    assert {"farmer_2.glb", "Bäuerin_7_.glb", "x" * 60 + ".glb"} <= set(names)
    assert {path.name for path in tmp_path.iterdir()} == {"in", "out"}


def test_a_file_given_twice_is_one_figure(tmp_path: Path, folder: Path) -> None:
    assert write_figures([folder / "0.glb", folder, folder / "0.glb"], tmp_path / "out").figures == 6


def test_a_tileset_of_figures_can_be_gathered_again(tmp_path: Path, folder: Path) -> None:
    write_figures([folder], tmp_path / "out")
    write_figures([tmp_path / "out"], tmp_path / "again")
    assert _bytes(tmp_path / "again") == _bytes(tmp_path / "out")
    write_figures([tmp_path / "out"], tmp_path / "out", overwrite=True)
    assert _bytes(tmp_path / "again") == _bytes(tmp_path / "out")


def test_records_read_from_files_equal_those_of_the_assets(tmp_path: Path) -> None:
    given = asset(ZURICH)
    write(given, tmp_path / "tiles")
    names = ("farmer.glb", "farmer_lod1.glb", "farmer_lod2.glb")
    (read,) = read_figures(tmp_path / "tiles")
    assert tuple(os.path.basename(each) for each in read.contents) == names
    wanted = figure_of(given, read.contents)
    assert read.observed == pytest.approx(wanted.observed, abs=1e-4)
    assert read.shares == pytest.approx(wanted.shares, abs=1e-4)
    same = {"name", "placement", "contents", "errors", "source", "copyright", "parts", "low", "high"}
    assert {key: getattr(read, key) for key in same} == {key: getattr(wanted, key) for key in same}


def test_contents_are_the_sources_to_the_bit_copied_or_linked(tmp_path: Path, folder: Path) -> None:
    write_figures([folder], tmp_path / "copied")
    write_figures([folder], tmp_path / "linked", link=True)
    assert _bytes(tmp_path / "copied") == _bytes(tmp_path / "linked")
    wanted = Counter(path.read_bytes() for path in folder.rglob("*.glb"))
    assert Counter(path.read_bytes() for path in (tmp_path / "copied" / "figures").iterdir()) == wanted
    assert {path.stat().st_nlink for path in (tmp_path / "copied" / "figures").iterdir()} == {1}
    assert {path.stat().st_nlink for path in (tmp_path / "linked" / "figures").iterdir()} == {2}


def test_overwriting_removes_files_of_the_old_tileset(tmp_path: Path, folder: Path) -> None:
    write_figures([folder], tmp_path / "out")
    (tmp_path / "out" / "figures" / "mine.txt").write_text("mine")
    with pytest.raises(ExportError, match=r"tileset\.json: already exists"):
        write_figures([folder / "0.glb"], tmp_path / "out")
    write_figures([folder / "0.glb"], tmp_path / "out", overwrite=True)
    assert set(_bytes(tmp_path / "out")) == {
        "tileset.json",
        "index.geojson",
        "figures.czml",
        "figures/farmer.glb",
        "figures/mine.txt",
    }


def test_only_needed_names_are_replaced_in_foreign_tilesets(tmp_path: Path, folder: Path) -> None:
    (tmp_path / "out" / "figures").mkdir(parents=True)
    foreign = {"asset": {"version": "1.0"}, "root": {"content": {"uri": "figures/theirs.glb"}}}
    (tmp_path / "out" / "tileset.json").write_text(json.dumps(foreign))
    (tmp_path / "out" / "figures" / "theirs.glb").write_text("theirs")
    write_figures([folder / "0.glb"], tmp_path / "out", overwrite=True)
    assert (tmp_path / "out" / "figures" / "theirs.glb").read_text() == "theirs"


@pytest.mark.parametrize("there_before", [False, True])
@pytest.mark.parametrize("failing", [0, 3, 9])
def test_a_failure_midway_leaves_the_disk_as_it_was(
    tmp_path: Path, folder: Path, failing: int, there_before: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if there_before:
        write_figures([folder / "0.glb", folder / "1.glb"], tmp_path / "out", visible_from_m=10)
    before = _bytes(tmp_path)
    real, count = os.replace, 0

    def replace(source: Path, destination: Path) -> None:
        nonlocal count
        count += 1
        if count == failing + 1:
            raise OSError(28, "No space left on device")
        real(source, destination)

    monkeypatch.setattr(exporters.write.os, "replace", replace)
    with pytest.raises(ExportError, match="No space left on device"):
        write_figures([folder], tmp_path / "out", overwrite=True)
    assert _bytes(tmp_path) == before
    assert (tmp_path / "out").exists() == there_before
    assert (tmp_path / "out" / "figures").exists() == there_before


def _refused(capsys: pytest.CaptureFixture[str], *words: str | Path) -> str:
    assert main(["tileset", *map(str, words)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_bad_input_is_one_line_and_leaves_nothing(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    write(asset(lods=SMALL), tmp_path / "nowhere.glb")
    (tmp_path / "empty").mkdir()
    (tmp_path / "broken.glb").write_bytes(b"glTF nonsense")
    (tmp_path / "note.txt").write_text("x")
    cases = {
        tmp_path / "nowhere.glb": "has no place on the earth; make it with --lonlat LON LAT",
        tmp_path / "empty": "contains no figure",
        tmp_path / "broken.glb": "not a valid glTF file",
        tmp_path / "note.txt": "not a figure",
        tmp_path / "gone.glb": "no such file or folder",
    }
    for source, finding in cases.items():
        line = _refused(capsys, folder, source, "-o", out)
        assert str(source) in line
        assert finding in line
        assert not out.exists()
    assert "--visible-from" in _refused(capsys, folder, "-o", out, "--visible-from", "-1")
    assert "note.txt is not a directory" in _refused(capsys, folder, "-o", tmp_path / "note.txt" / "out")
    assert not out.exists()


def test_tilesets_that_contradict_their_contents_are_refused(tmp_path: Path) -> None:
    write(asset(ZURICH, lods=SMALL), tmp_path / "in")
    document = json.loads((tmp_path / "in" / "tileset.json").read_text())
    document["root"]["transform"][12] += 5.0
    (tmp_path / "in" / "tileset.json").write_text(json.dumps(document))
    with pytest.raises(ExportError, match=r"5 m from the place recorded"):
        write_figures([tmp_path / "in"], tmp_path / "out")


def test_old_content_is_not_gathered(tmp_path: Path, folder: Path) -> None:
    write_figures([folder], tmp_path / "old", version="1.0")
    with pytest.raises(ExportError, match=r"give the \.glb files"):
        write_figures([tmp_path / "old"], tmp_path / "out")


def test_the_command_gives_each_figure_the_range_of_its_height(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heights = {"person": 1.79, "tower": 180.0, "map": 1800.0}
    for name, height in heights.items():
        write(asset(replace(ZURICH, figure_height_m=height), lods=SMALL, name=name), tmp_path / "in" / f"{name}.glb")
    assert main(["tileset", str(tmp_path / "in"), "-o", str(tmp_path / "out")]) == 0
    assert "--visible-from" not in capsys.readouterr().err
    for each in contents(tmp_path / "out"):
        height = heights[Path(each.uri).stem]
        assert 103.923 * each.errors[-2] == pytest.approx(2000 / 1.79 * height, rel=1e-4)
    assert validate(tmp_path / "out", external=False) == []
    main(["tileset", str(tmp_path / "out"), "-o", str(tmp_path / "again")])
    assert _bytes(tmp_path / "again") == _bytes(tmp_path / "out")
    capsys.readouterr()
    main(["tileset", str(tmp_path / "in"), "-o", str(tmp_path / "near"), "--visible-from", "2000"])
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "--visible-from" in line]
    assert "a figure 1800 m tall is not drawn" in line
    assert {each.errors[-2] for each in contents(tmp_path / "near")} == {2000.0 / VISIBLE_RANGE_PER_ERROR}


def test_the_command(tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["tileset", str(folder), "-o", str(out), "--tiles-version", "1.0", "--visible-from", "500"]) == 0
    captured = capsys.readouterr()
    assert captured.out == f"{out / 'tileset.json'}\n"
    assert "6 figures" in captured.err
    assert validate(out, external=False) == []
    assert main(["validate", str(out)]) == 0
    shutil.rmtree(out / "figures")
    assert main(["validate", str(out)]) == 2


def test_a_figure_that_is_there_as_model_and_as_tileset_is_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    levels = (capsule(12, 2), capsule(8, 2))
    write(asset(ZURICH, lods=levels, name="farmer"), tmp_path / "in" / "farmer.glb")
    write(asset(ZURICH, lods=levels, name="farmer"), tmp_path / "in" / "farmer_tiles")
    assert main(["tileset", str(tmp_path / "in"), "-o", str(tmp_path / "out")]) == 0
    note, *_ = capsys.readouterr().err.splitlines()
    assert note.endswith("farmer_tiles/farmer.glb, farmer; left out")
    assert "in/farmer.glb: the same figure as" in note
    assert {path.name for path in (tmp_path / "out" / "figures").iterdir()} == {"farmer.glb", "farmer_lod1.glb"}


def test_other_figures_in_one_spot_are_kept_and_noted(tmp_path: Path) -> None:
    for number, columns in enumerate((8, 10)):
        write(asset(ZURICH, lods=(capsule(columns, 2),), name="farmer"), tmp_path / "in" / f"{number}.glb")
    write(asset(replace(ZURICH, lon_deg=8.6), lods=SMALL, name="farmer"), tmp_path / "in" / "2.glb")
    written = write_figures([tmp_path / "in"], tmp_path / "out")
    assert written.figures == 3
    assert written.notes == ("farmer: 2 figures of this name stand in one spot, and hide each other",)
