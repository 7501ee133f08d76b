"""The command line: help without heavy imports, one line and exit code 2 for bad usage, nothing lost."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from fig2mesh.commands.main import main
from tests.drawn import DrawnFiles, write_figure

HEAVY = ("torch", "open3d", "numpy", "scipy", "numba", "pymeshlab", "trimesh", "pxr")


@pytest.fixture
def files(tmp_path: Path) -> DrawnFiles:
    return write_figure(tmp_path)


def arguments(files: DrawnFiles, *more: str) -> list[str]:
    return [str(files.image), "--keypoints", str(files.keypoints), "--quality", "draft", *more]


def test_help_imports_nothing_heavy() -> None:
    program = (
        "import sys\nfrom fig2mesh.commands.main import main\ncode = main(['--help'])\n"
        f"loaded = [name for name in {HEAVY!r} if name in sys.modules]\nprint(code, loaded, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "0 []"
    for option in ("--lonlat", "--keypoints", "--quality", "--overwrite", "inspect", "validate"):
        assert option in done.stdout


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert "fig2mesh" in capsys.readouterr().out


BAD = {
    "latitude": (("--lonlat", "8.5", "97.4"), "latitude"),
    "swapped": (("--lonlat", "47.4", "188.5"), "--lonlat"),
    "longitude": (("--lonlat", "188.5", "47.4"), "longitude"),
    "nan": (("--lonlat", "nan", "47.4"), "finite"),
    "one number": (("--lonlat", "8.5"), "--lonlat"),
    "not a number": (("--lonlat", "east", "47"), "east"),
    "facing": (("--facing", "up"), "--facing"),
    "height": (("--height-m", "-1"), "--height-m"),
    "zero height": (("--height-m", "0"), "--height-m"),
    "altitude without place": (("--altitude", "400"), "--lonlat"),
    "grid": (("--lonlat", "8", "47", "--altitude-datum", "no-such-grid.gtx"), "no-such-grid.gtx"),
    "suffix": (("-o", "model.fbx"), "model.fbx"),
    "tiles without place": (("-o", "tiles/tileset.json"), "--lonlat"),
    "same output twice": (("-o", "a.glb", "-o", "./a.glb"), "twice"),
    "part of another output": (("--lonlat", "8", "47", "-o", "t/tileset.json", "-o", "t/drawn.glb"), "also a part"),
    "not for the client": (
        ("--profile", "cesiumjs", "-o", "a.usda"),
        "--profile cesiumjs cannot be combined with .usda; CesiumJS reads",
    ),
    "tiles for Blender": (
        ("--lonlat", "8", "47", "--profile", "blender", "-o", "t/"),
        "--profile blender cannot be combined with 3D Tiles; Blender reads",
    ),
    "no such client": (("--profile", "maya"), "maya"),
    "long name": (("-o", "a" * 300 + ".glb"), "too long"),
    "altitude": (("--lonlat", "8", "47", "--altitude", "1e300"), "--altitude"),
    "visible from": (("--visible-from", "-5"), "--visible-from"),
    "quality": (("--quality", "best"), "best"),
    "unknown option": (("--colour", "red"), "--colour"),
    "bbox": (("--bbox", "0", "0", "5000", "10"), "--bbox"),
    "resume nowhere": (("--resume-from", "unwrap"), "--save-stages"),
    "resume unknown": (("--resume-from", "dance", "--save-stages", "stages"), "dance"),
    "resume empty": (("--resume-from", "unwrap", "--save-stages", "stages"), "stages"),
    "report folder": (("--report", "missing/report.json"), "missing"),
    "standard output": (("-o", "-"), "-o -: writing to stdout is not supported; name a file or a folder"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_usage_is_one_line(
    files: DrawnFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], case: str
) -> None:
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    options, expected = BAD[case]
    assert main(arguments(files, *options)) == 2
    captured = capfd.readouterr()
    assert captured.out == ""
    assert expected in captured.err
    assert captured.err.startswith("fig2mesh: ")
    assert captured.err.count("\n") == 1
    assert sorted(tmp_path.rglob("*")) == before


UNKNOWN = {
    "misspelt": (["viev", "a.png"], "unknown command 'viev' (did you mean 'view'?)"),
    "misspelt, without a figure": (["rendr"], "unknown command 'rendr' (did you mean 'render'?)"),
    "misspelt, with an option first": (["batsh", "-o", "out"], "unknown command 'batsh' (did you mean 'batch'?)"),
    "help on a misspelt one": (["help", "viev"], "unknown command 'viev' (did you mean 'view'?)"),
    "help on nothing like it": (["help", "xyzzy"], "unknown command 'xyzzy'"),
    "nothing like it, with a figure": (["convert", "a.png"], "unknown command 'convert'"),
    "two figures": (["a.png", "b.png"], "Got unexpected extra argument (b.png); give one figure, or a table"),
    "a value missing": (["a.png", "--lonlat", "47,8.5"], "Option '--lonlat' requires 2 arguments, LON LAT"),
    "a value of a command missing": (
        ["globe", "a.glb", "--overlay", "a.png"],
        "Option '--overlay' requires 5 arguments, IMAGE W S E N; see fig2mesh globe --help",
    ),
    "an argument of a command missing": (["render"], "Missing argument 'FIGURE'; see fig2mesh render --help"),
    "a required option missing": (["render", "a.png"], "Missing option '-o' / '--output'; see fig2mesh render --help"),
    "a folder as figure": (["."], ".: is a folder; give the picture in it as figure"),
    "an option of another command": (
        ["inspect", "a.glb", "--lods", "3"],
        "No such option '--lods'; see fig2mesh inspect --help",
    ),
    "a figure without suffix": (["xyzzy"], "xyzzy: no such file"),
    "a figure named like a command": (["view.png"], "view.png: no such file"),
}


@pytest.mark.parametrize("case", UNKNOWN)
def test_an_unknown_command_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], case: str
) -> None:
    monkeypatch.chdir(tmp_path)
    words, expected = UNKNOWN[case]
    assert main(words) == 2
    captured = capfd.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(f"fig2mesh: {expected}")
    assert "; " in captured.err.removeprefix("fig2mesh: ")
    assert captured.err.count("\n") == 1


def test_a_file_named_like_a_misspelt_command_is_a_figure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("viev", "help"):
        Path(name).write_text("not a picture")
        assert main([name]) == 2
        message = capfd.readouterr().err
        assert message.startswith(f"fig2mesh: {name}: ")


def test_help_is_a_command(capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    wanted = capfd.readouterr().out
    assert main(["help"]) == 0
    assert capfd.readouterr().out == wanted
    assert main(["help", "view"]) == 0
    assert "fig2mesh view [OPTIONS] FIGURE" in capfd.readouterr().out


def test_existing_output_is_kept(files: DrawnFiles, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "kept.glb"
    target.write_text("precious")
    assert main(arguments(files, "-o", str(target))) == 2
    assert target.read_text() == "precious"
    assert "--overwrite" in capfd.readouterr().err


def test_missing_figure_is_one_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "nobody.png")]) == 2
    message = capfd.readouterr().err
    assert "nobody.png" in message
    assert message.count("\n") == 1


def test_the_error_for_an_empty_picture_names_the_options(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    Image.new("RGB", (60, 80), "white").save(tmp_path / "empty.png")
    assert main([str(tmp_path / "empty.png"), "-o", str(tmp_path / "a.glb")]) == 2
    message = capfd.readouterr().err
    assert "--keypoints" in message
    assert len(message.strip().splitlines()) == 1


def test_internal_errors_are_not_input_errors(
    files: DrawnFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("planted")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("fig2mesh.parts.layer_inflation.inflate", broken)
    assert main(arguments(files)) == 1
    message = capfd.readouterr().err
    assert "internal error: ZeroDivisionError: planted" in message
    assert "Traceback" not in message
    assert not (tmp_path / "drawn.glb").exists()


def test_inspect_refuses_what_is_not_there(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["inspect", str(tmp_path / "missing.glb")]) == 2
    message = capfd.readouterr().err
    assert "missing.glb" in message
    assert message.count("\n") == 1


def test_validate_finds_damage(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    broken = tmp_path / "broken.glb"
    broken.write_bytes(b"glTF but not really")
    assert main(["validate", str(broken)]) == 2
    assert "broken.glb" in "".join(capfd.readouterr())


def test_profiles_of_the_help_are_those_of_the_writers() -> None:
    from exporters.profiles import PROFILES
    from fig2mesh.commands.main import make

    (option,) = (each for each in make.params if each.name == "profile")
    assert list(option.type.to_info_dict()["choices"]) == list(PROFILES)


def test_a_missing_encoder_is_reported_before_the_work(
    files: DrawnFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "meshopt", None)
    assert main(arguments(files, "--profile", "cesiumjs", "-o", str(tmp_path / "a.glb"))) == 2
    printed = capfd.readouterr().err.strip()
    assert printed == (
        'fig2mesh: --profile: compression needs the package meshopt; pip install "fig2mesh[compression]"'
    )
    assert not (tmp_path / "a.glb").exists()


@pytest.mark.parametrize("name", ["a.czml", "a.geojson"])
def test_places_need_a_place(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    assert main(["figure.png", "-o", str(tmp_path / name)]) == 2
    suffix = Path(name).suffix
    assert f"{suffix} needs a place on the earth; give --lonlat LON LAT" in capsys.readouterr().err


NO_MEMORY = {
    "Python's own": MemoryError(),
    "the system's": OSError(12, "Cannot allocate memory"),
    "a library that cannot be mapped": ImportError("libQt5OpenGL.so.5: failed to map segment from shared object"),
    "torch's": RuntimeError("[enforce fail] DefaultCPUAllocator: can't allocate memory: you tried to allocate 9 bytes"),
    "a C++ library's": RuntimeError("std::bad_alloc"),
}


@pytest.mark.parametrize("case", NO_MEMORY)
def test_too_little_memory_is_one_line(
    files: DrawnFiles, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], case: str
) -> None:
    def fail(*args: object, **options: object) -> None:
        raise NO_MEMORY[case]

    monkeypatch.setattr("fig2mesh.conversion.outputs.check_request", fail)
    assert main(arguments(files)) == 2
    assert capfd.readouterr().err == "fig2mesh: not enough memory; close other programs, or choose a lower --quality\n"


def test_a_missing_temporary_folder_is_one_line(
    files: DrawnFiles, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def fail(*args: object, **options: object) -> None:
        raise FileNotFoundError(2, "No usable temporary directory found in ['/tmp', '/']")

    with monkeypatch.context() as patch:
        patch.setattr("fig2mesh.conversion.outputs.check_request", fail)
        patch.setattr("tempfile.gettempdir", fail)
        assert main(arguments(files)) == 2
    assert "set TMPDIR to a writable folder" in capfd.readouterr().err
