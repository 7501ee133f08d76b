"""`fig2mesh render`: the command as a user runs it, and one line and exit code 2 for what cannot be done."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from exporters.asset import Asset
from exporters.write import write
from fig2mesh.commands.main import main
from tests.drawn import DrawnFiles, write_figure
from tests.fig2mesh.render.scenes import balls_mesh

SMALL = ("--size", "60", "90")
OUTLINES = ("--parts", "outline", "--quality", "draft")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> DrawnFiles:
    return write_figure(tmp_path_factory.mktemp("drawn"))


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "balls.glb"
    write(Asset("balls", (balls_mesh(0.06),), part_names={1: "torso", 2: "head"}), path)
    return path


def drawing(files: DrawnFiles, *more: str) -> list[str]:
    return ["render", str(files.image), "--keypoints", str(files.keypoints), *OUTLINES, *SMALL, "-q", *more]


def read(path: Path) -> NDArray[np.uint8]:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGBA"))


def test_still_of_a_drawing(files: DrawnFiles, tmp_path: Path) -> None:
    target, report = tmp_path / "a.png", tmp_path / "a.json"
    effects = ("--effects", "light,shadow,ao", "--effects", "outline,smooth-union,blend", "--ground", "--pitch", "15")
    assert main(drawing(files, "-o", str(target), "--report", str(report), *effects)) == 0
    picture = read(target)
    assert picture.shape == (90, 60, 4)
    assert 0.1 < (picture[..., 3] == 255).mean() < 0.9
    facts = json.loads(report.read_text())
    assert facts["pictures"] == 1
    assert facts["counts"]["camera_rays"] == 60 * 90 * 4
    assert facts["counts"]["ao_rays"] > facts["counts"]["shadow_rays"] > 0
    again = tmp_path / "b.png"
    assert main(drawing(files, "-o", str(again), *effects)) == 0
    assert again.read_bytes() == target.read_bytes()


def test_front_is_the_drawing(files: DrawnFiles, tmp_path: Path) -> None:
    """The figure's shirt is red and its left glove, to the right of the picture, green."""
    assert main(drawing(files, "-o", str(tmp_path / "a.png"))) == 0
    picture = read(tmp_path / "a.png").astype(int)
    red, green, blue, alpha = np.moveaxis(picture, -1, 0)
    shirt, glove = ((alpha == 255) & (a > 1.5 * b) & (a > 1.5 * blue) for a, b in ((red, green), (green, red)))
    assert shirt.sum() > 100
    assert glove.sum() > 5
    assert np.nonzero(glove)[1].mean() > 45


def test_depth_of_a_drawing_makes_no_texture(
    files: DrawnFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise AssertionError("colours were looked up")

    monkeypatch.setattr("fig2mesh.stages.textures.make_sources", broken)
    monkeypatch.setattr("fig2mesh.stages.cloud.scan", broken)
    report = tmp_path / "a.json"
    assert main(drawing(files, "-o", str(tmp_path / "a.png"), "--mode", "depth", "--report", str(report))) == 0
    counts = json.loads(report.read_text())["counts"]
    assert {name for name, value in counts.items() if value} == {"camera_rays"}


@pytest.mark.parametrize("suffix", ["webp", "gif"])
def test_turntable_begins_with_the_still(model: Path, tmp_path: Path, suffix: str) -> None:
    options = ["render", str(model), *SMALL, "-q", "--yaw", "20", "--background", "ivory", "--mode", "parts"]
    still, turn = tmp_path / "a.png", tmp_path / f"a.{suffix}"
    assert main([*options, "-o", str(still)]) == 0
    assert main([*options, "-o", str(turn), "--frames", "5", "--seconds", "1"]) == 0
    with Image.open(turn) as image:
        assert getattr(image, "n_frames", 1) == 5
        image.load()
        assert image.info["duration"] == 200
        assert (np.asarray(image.convert("RGBA")) == read(still)).all()


def test_turntable_turns(model: Path, tmp_path: Path) -> None:
    folder = tmp_path / "turn"
    options = ["render", str(model), *SMALL, "-q", "--mode", "depth"]
    assert main([*options, "-o", str(folder), "--frames", "4"]) == 0
    for index, yaw in enumerate((0, 90, 180, 270)):
        assert main([*options, "-o", str(tmp_path / f"{yaw}.png"), "--yaw", str(yaw)]) == 0
        assert (read(folder / f"{index:04d}.png") == read(tmp_path / f"{yaw}.png")).all()


@pytest.mark.parametrize("suffix", [".gltf", ".ply", ".obj"])
def test_models_of_other_formats_look_the_same(model: Path, tmp_path: Path, suffix: str) -> None:
    other = tmp_path / f"balls{suffix}"
    write(Asset("balls", (balls_mesh(0.06),)), other)
    pictures = []
    for path in (model, other):
        target = tmp_path / f"{path.suffix[1:]}.png"
        assert main(["render", str(path), *SMALL, "-q", "--effects", "light", "-o", str(target)]) == 0
        pictures.append(read(target).astype(int))
    assert (np.abs(pictures[0] - pictures[1]).max(axis=-1) > 8).mean() < 0.01


SUN = ("--mode", "clay", "--effects", "sun,shadow", "--lonlat", "8.54", "47.38", "--facing", "S", "--ground")


def test_sun_goes_round_with_the_day(model: Path, tmp_path: Path) -> None:
    """A figure that faces south has the morning sun on its left, which is the right of the picture."""
    halves = []
    for hour in ("06", "18"):
        target = tmp_path / f"{hour}.png"
        options = [*SUN, "--time", f"2026-06-21T{hour}:00+02:00", "-o", str(target), "-q"]
        assert main(["render", str(model), *SMALL, *options]) == 0
        bright = read(target)[..., :3].mean(axis=-1)
        halves.append(bright[:, 30:].sum() - bright[:, :30].sum())
    assert halves[0] > 0 > halves[1]


def test_night_is_reported_in_one_line(model: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    options = [*SUN, "--time", "2026-06-21T23:30Z", "-o", str(tmp_path / "a.png")]
    assert main(["render", str(model), *SMALL, *options]) == 0
    printed = capfd.readouterr()
    assert printed.err.count("below the horizon") == 1
    assert printed.err.count("\n") == 1
    assert printed.out == f"{tmp_path / 'a.png'}\n"


BAD = {
    "suffix": (("-o", "a.bmp"), ".bmp"),
    "effect": (("-o", "a.png", "--effects", "glow"), "glow"),
    "mode": (("-o", "a.png", "--mode", "xray"), "xray"),
    "two lamps": (("-o", "a.png", "--effects", "light,sun"), "light cannot be combined with sun"),
    "shadow alone": (("-o", "a.png", "--effects", "shadow"), "light or sun"),
    "lit depth": (
        ("-o", "a.png", "--mode", "depth", "--effects", "light"),
        "light cannot be combined with --mode depth",
    ),
    "sun nowhere": (("-o", "a.png", "--effects", "sun", "--time", "2026-06-21T12:00Z"), "--lonlat"),
    "sun never": (("-o", "a.png", "--effects", "sun", "--lonlat", "8", "47"), "--time"),
    "sun in no zone": (("-o", "a.png", "--effects", "sun", "--lonlat", "8", "47", "--time", "2026-06-21"), "zone"),
    "place without sun": (("-o", "a.png", "--lonlat", "8", "47"), "sun"),
    "latitude": (("-o", "a.png", "--effects", "sun", "--lonlat", "8", "97", "--time", "2026-06-21T12:00Z"), "latitude"),
    "moving png": (("-o", "a.png", "--frames", "5"), "a .png cannot be combined with --frames"),
    "three times": (("-o", "a.gif", "--frames", "5", "--fps", "5", "--seconds", "5"), "two of the three"),
    "colour": (("-o", "a.png", "--background", "sky-ish"), "sky-ish"),
    "outline colour": (("-o", "a.png", "--outline-colour", "x"), "--outline-colour"),
    "size": (("-o", "a.png", "--size", "0", "10"), "--size"),
    "too large": (("-o", "a.png", "--size", "8192", "8192", "--samples", "8"), "--size"),
    "film": (("-o", "a.mp4"), "ffmpeg"),
    "no output": ((), "--output"),
    "no folder": (("-o", "a.png", "--report", "missing/report.json"), "missing"),
    "no texture": (("-o", "a.png", "--textures", "none"), "--textures"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_usage_is_one_line(
    files: DrawnFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], case: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    options, expected = BAD[case]
    arguments = ["render", str(files.image), "--keypoints", str(files.keypoints), *OUTLINES, *options]
    assert main(arguments) == 2
    captured = capfd.readouterr()
    assert captured.out == ""
    assert expected in captured.err
    assert captured.err.startswith("fig2mesh: ")
    assert captured.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


BAD_MODELS = {
    "missing": ("nobody.glb", (), "no such file"),
    "damaged": ("damaged.glb", (), "not a valid glTF file"),
    "blend": ("balls.glb", ("--effects", "blend"), "drawing instead"),
    "joints": ("balls.glb", ("--keypoints", "x.json"), "finished model"),
    "parts": ("bare.glb", ("--mode", "parts"), "--evidence parts"),
    "colours": ("bare.glb", (), "--mode clay"),
}


@pytest.mark.parametrize("case", BAD_MODELS)
def test_bad_models_are_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], case: str
) -> None:
    from dataclasses import replace

    monkeypatch.chdir(tmp_path)
    mesh = balls_mesh(0.1)
    write(Asset("balls", (mesh,)), "balls.glb")
    write(Asset("bare", (replace(mesh, colors=None, parts=None),)), "bare.glb")
    Path("damaged.glb").write_bytes(b"glTF but not really")
    name, options, expected = BAD_MODELS[case]
    assert main(["render", name, *SMALL, "-o", "a.png", *options]) == 2
    message = capfd.readouterr().err
    assert name in message or "--" in message
    assert expected in message
    assert message.count("\n") == 1
    assert not Path("a.png").exists()


def test_existing_pictures_are_kept(model: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    target, folder = tmp_path / "kept.png", tmp_path / "kept"
    target.write_text("precious")
    folder.mkdir()
    (folder / "0000.png").write_text("precious")
    for path in (target, folder):
        assert main(["render", str(model), *SMALL, "-o", str(path), "--frames", "1"]) == 2
        assert "--overwrite" in capfd.readouterr().err
    assert target.read_text() == (folder / "0000.png").read_text() == "precious"
    assert main(["render", str(model), *SMALL, "-o", str(target), "--overwrite", "-q"]) == 0
    assert read(target).shape == (90, 60, 4)
