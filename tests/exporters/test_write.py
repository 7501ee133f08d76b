"""Outputs are written atomically, and obstacles are reported in one line."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

import pytest

from exporters.errors import ExportError
from exporters.write import FORMATS, check_outputs, write
from georef.errors import InputError
from tests.exporters.analytic import ZURICH, asset, capsule

TARGETS = [*(f"a{suffix}" for suffix in FORMATS), "tiles", "tiles/", "tiles/tileset.json", "deep/er/a.gltf"]

SMALL = asset(ZURICH, lods=(capsule(8, 2), capsule(6, 2, deviation_m=(0.01, 0.03))))
OTHER = asset(ZURICH, lods=(capsule(10, 2), capsule(6, 2, deviation_m=(0.01, 0.03))), name=SMALL.name)


def _contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize("target", TARGETS)
def test_exactly_the_expected_files_are_written(tmp_path: Path, target: str) -> None:
    written = write(SMALL, f"{tmp_path}/{target}")
    assert {str(path.relative_to(tmp_path)) for path in written} == set(_contents(tmp_path))
    assert written[-1].name == (Path(target).name if Path(target).suffix else "tileset.json")


@pytest.mark.parametrize("target", TARGETS)
def test_overwriting_needs_the_option_and_then_replaces(tmp_path: Path, target: str) -> None:
    path = f"{tmp_path}/{target}"
    write(SMALL, path)
    before = _contents(tmp_path)
    with pytest.raises(ExportError, match=r"already exists; use --overwrite"):
        write(OTHER, path)
    assert _contents(tmp_path) == before
    write(OTHER, path, overwrite=True)
    after = _contents(tmp_path)
    assert set(after) == set(before)
    assert after != before


@pytest.mark.parametrize("there_before", [False, True])
@pytest.mark.parametrize("failing", range(4))
@pytest.mark.parametrize("target", ["deep/a.gltf", "deep/a.obj", "deep/a.usda", "deep/a.glb", "deep/tiles"])
def test_a_failure_midway_leaves_the_disk_as_it_was(
    tmp_path: Path, target: str, failing: int, there_before: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if there_before:
        write(SMALL, tmp_path / target)
    before = _contents(tmp_path)
    real = os.replace
    count = 0

    def replace(source: Path, destination: Path) -> None:
        nonlocal count
        count += 1
        if count == failing + 1:
            raise OSError(28, "No space left on device")
        real(source, destination)

    monkeypatch.setattr(os, "replace", replace)
    files = {"tiles": 3, "a.usda": 3}.get(Path(target).name) or len(FORMATS[Path(target).suffix].companions) + 1
    if failing >= files:
        assert len(write(OTHER, tmp_path / target, overwrite=True)) == files
        return
    with pytest.raises(ExportError, match="No space left on device"):
        write(OTHER, tmp_path / target, overwrite=True)
    assert _contents(tmp_path) == before
    assert (tmp_path / "deep").exists() == there_before


def test_a_writer_that_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def half_written(asset: object, path: Path, profile: object) -> None:
        path.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setitem(FORMATS, ".glb", dataclasses.replace(FORMATS[".glb"], writer=half_written))
    with pytest.raises(KeyboardInterrupt):
        write(SMALL, tmp_path / "new" / "a.glb")
    assert list(tmp_path.iterdir()) == []


def test_foreign_files_in_the_folder_of_a_tileset_are_kept(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    write(SMALL, tmp_path)
    write(OTHER, tmp_path, overwrite=True)
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_a_foreign_file_of_a_needed_name_is_not_replaced_without_the_option(tmp_path: Path) -> None:
    (tmp_path / "farmer.glb").write_text("mine")
    with pytest.raises(ExportError, match=r"farmer\.glb: already exists"):
        write(SMALL, tmp_path)
    assert _contents(tmp_path) == {"farmer.glb": b"mine"}


def test_formats_with_the_same_texture_live_side_by_side(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("a.gltf", "a.obj", "a.usda", "a.usdc")]
    check_outputs(paths)
    for path in paths:
        write(SMALL, path)
    assert len(_contents(tmp_path)) == 8  # four, their .bin and .mtl, a texture of each level


def test_the_drawing_next_to_the_output_is_never_changed(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"the drawing")
    for suffix in FORMATS:
        write(SMALL, tmp_path / f"a{suffix}", overwrite=True)
    assert (tmp_path / "a.png").read_bytes() == b"the drawing"


def test_permissions_follow_the_umask(tmp_path: Path) -> None:
    mask = os.umask(0o022)
    try:
        write(SMALL, tmp_path / "tiles")
    finally:
        os.umask(mask)
    assert (tmp_path / "tiles").stat().st_mode & 0o777 == 0o755
    assert (tmp_path / "tiles" / "tileset.json").stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize("name", ["a.fbx", "a.stl", "a.png", "a.b3dm"])
def test_unknown_suffixes_are_refused_with_the_known_ones(tmp_path: Path, name: str) -> None:
    with pytest.raises(ExportError, match=r"unknown suffix '\.\w+'; use \.glb, .* or a folder"):
        check_outputs([tmp_path / name])


def test_suffixes_in_capitals_are_known(tmp_path: Path) -> None:
    for suffix in FORMATS:
        write(SMALL, tmp_path / f"{suffix[1:]}{suffix.upper()}")


def test_obstacles_are_reported_before_writing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check_outputs([tmp_path / "not" / "yet" / "a.glb", tmp_path / "not"])
    with pytest.raises(InputError, match="twice"):
        check_outputs([tmp_path / "a.glb", f"{tmp_path}/./a.glb"])
    (tmp_path / "a_texture.png").write_bytes(b"")
    with pytest.raises(ExportError, match=r"a_texture\.png: already exists, a part of a\.gltf"):
        check_outputs([tmp_path / "a.gltf"])
    check_outputs([tmp_path / "a.gltf"], overwrite=True)
    with pytest.raises(ExportError, match="is not a directory"):
        check_outputs([tmp_path / "a_texture.png" / "b.glb"])
    (tmp_path / "folder.glb").mkdir()
    with pytest.raises(ExportError, match="a directory, not a file"):
        check_outputs([tmp_path / "folder.glb"], overwrite=True)
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # root may write anywhere
    with pytest.raises(ExportError, match="no permission to write to"):
        check_outputs([tmp_path / "b.glb"])


def test_tileset_without_a_place_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="--lonlat"):
        write(asset(lods=SMALL.lods), tmp_path / "tiles")
    assert list(tmp_path.iterdir()) == []


def test_visible_from_reaches_the_tileset(tmp_path: Path) -> None:
    near, far = tmp_path / "near", tmp_path / "far"
    write(SMALL, near, visible_from_m=100)
    write(SMALL, far, visible_from_m=5000)
    assert (near / "tileset.json").read_bytes() != (far / "tileset.json").read_bytes()
    write(SMALL, tmp_path / "usual")
    write(SMALL, tmp_path / "two km", visible_from_m=2000.0)
    assert (tmp_path / "usual" / "tileset.json").read_bytes() == (tmp_path / "two km" / "tileset.json").read_bytes()
