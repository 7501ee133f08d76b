"""Closed streams, narrow encodings, limits, missing folders and names that are not UTF-8: one line at most."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from exporters.errors import ExportError
from exporters.text import plain_text
from exporters.write import check_outputs
from fig2mesh.batch.collections.rows import Row
from fig2mesh.batch.tasks import tasks_of
from fig2mesh.commands import doctor
from fig2mesh.commands.main import cli, main
from fig2mesh.conversion.request import Request
from fig2mesh.system import surroundings
from fig2mesh.system.surroundings import memory_error, name_error, temporary_fault
from tests.drawn import write_figure
from tests.node import ROOT

NAMES = {
    b"M\xfcller": "M\ufffdller",
    b"\xe9t\xe9": "\ufffdt\ufffd",
    "地图".encode("shift_jis", "replace"): None,
    b"a\xff": "a\ufffd",
    "Mu\u0308ller".encode(): "Mu\u0308ller",
}
"""Names as bytes, and as they are written into files."""


@pytest.mark.parametrize("name", NAMES)
def test_names_become_plain_text(name: bytes) -> None:
    text = os.fsdecode(name)
    assert plain_text(text).encode()
    assert NAMES[name] in (None, plain_text(text))
    request = Request(Path(text + ".png"))
    assert request.title.encode()
    assert request.targets[0].encode()
    task = next(tasks_of([Row(1, "line 2", {"figure": text + ".png"})]))
    assert (task.title + task.name).encode()


@pytest.mark.parametrize("path", ["M\udcfcller.glb", "\udcff/a.usdz", "tiles\udce9/tileset.json"])
def test_outputs_are_refused_beforehand(path: str) -> None:
    with pytest.raises(ExportError, match="not UTF-8; choose another name"):
        check_outputs([path])


def test_a_picture_that_is_not_utf8_is_converted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = write_figure(tmp_path)
    folder = tmp_path / "Stra\udcdfe"
    try:
        folder.mkdir()
    except (OSError, UnicodeError):
        pytest.skip("the file system takes UTF-8 names only")
    picture = files.image.rename(folder / "M\udcfcller.png")
    monkeypatch.chdir(tmp_path)
    options = ["--quality", "draft", "--parts", "outline", "--textures", "none", "--mesher", "isosurface"]
    words = [str(picture), "--keypoints", str(files.keypoints), *options, "--lonlat", "8", "47", "--report", "r.json"]
    assert main([*words, "-o", "a.glb", "-o", "a.gltf", "-o", "a.usda", "-o", "a.geojson", "-o", "tiles"]) == 0
    assert "M\ufffdller.png" in json.loads(Path("r.json").read_bytes())["figure"]["file"]


def test_closed_streams_and_ascii() -> None:
    program = (
        "import sys; from fig2mesh.commands.main import main; sys.exit(main(['none\\udcfc\\u00e9.png', '-o', 'a']))"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "ascii"}
    for close in ("<&-", ">&-", "2>&-", "<&- >&- 2>&-"):
        command = ["sh", "-c", f'exec "$0" -c "$1" {close}', sys.executable, program]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
        assert done.returncode == 2, done.stderr
        assert done.stdout == ""
        assert done.stderr.count("\n") == (0 if "2>&-" in close else 1)


@pytest.mark.parametrize("text", ["M\udcfcller", "Zürich", "地図", "\ud800"])
@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_anything_can_be_printed(monkeypatch: pytest.MonkeyPatch, text: str, encoding: str) -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding, errors="strict")
    monkeypatch.setattr(sys, "stdout", stream)
    surroundings.open_streams()
    print(text, flush=True)
    if text == "M\udcfcller":  # the bytes of a file name, so that a shell finds the file
        assert stream.buffer.getvalue() == b"M\xfcller\n"  # type: ignore[attr-defined]


ERRORS = {
    "address space": (MemoryError(), 2_000_000_000, "limited to 2.0 GB (ulimit -v)"),
    "library": (ImportError("libtorch_cpu.so: failed to map segment from shared object"), 1, "ulimit -v"),
    "allocator": (RuntimeError("DefaultCPUAllocator: can't allocate memory: 800 bytes"), None, "not enough memory"),
    "threads": (RuntimeError("can't start new thread"), None, "FIG2MESH_THREADS"),
    "mistake of ours": (RuntimeError("odd"), None, None),
    "missing": (ImportError("No module named x"), 1, None),
}


@pytest.mark.parametrize("case", ERRORS)
def test_limits_are_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], case: str) -> None:
    error, limit, expected = ERRORS[case]
    monkeypatch.setattr(surroundings, "address_limit", lambda: limit)
    assert (memory_error(error) is None) == (expected is None)

    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(cli, "main", fail)
    assert main(["a.png"]) == (1 if expected is None else 2)
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert (expected or "internal error") in err


def test_a_real_limit_is_one_line(tmp_path: Path) -> None:
    pytest.importorskip("resource")
    program = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))\n"
        "from fig2mesh.commands.main import main; sys.exit(main(sys.argv[1:]))"
    )
    files = write_figure(tmp_path)
    words = [str(files.image), "--keypoints", str(files.keypoints), "-o", str(tmp_path / "a.glb")]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", program, *words], capture_output=True, text=True, check=False, env=environment
    )
    assert done.returncode == 2, done.stderr
    assert "ulimit -v" in done.stderr.splitlines()[-1]
    assert not (tmp_path / "a.glb").exists()


def test_names_that_cannot_be_used_are_named() -> None:
    for name, encoding, expected in (("M\udcfc", "utf-8", "not UTF-8"), ("é", "ascii", "PYTHONUTF8=1")):
        with pytest.raises(UnicodeEncodeError) as caught:
            name.encode(encoding)
        assert expected in (name_error(caught.value) or "")
    assert name_error(ValueError()) is None


def test_no_temporary_folder_is_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(tempfile, "_candidate_tempdir_list", lambda: [str(tmp_path / "none")])
    assert "set TMPDIR" in (temporary_fault() or "")
    (tmp_path / "a.csv").write_text("figure,lon,lat\na.png,8,47\n")
    assert main(["batch", str(tmp_path / "a.csv"), "--dry-run"]) == 2
    assert capsys.readouterr().err == "fig2mesh: no temporary folder can be written; set TMPDIR to a writable folder\n"


def test_a_tmpdir_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setenv("TMPDIR", str(tmp_path / "none"))
    assert f"TMPDIR={tmp_path / 'none'} cannot be written" in (temporary_fault() or "")


def test_doctor_finds_them_beforehand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "address_limit", lambda: 2_000_000_000)
    monkeypatch.setattr(doctor, "temporary_fault", lambda: "no temporary folder can be written; set TMPDIR")
    monkeypatch.setattr(doctor, "run_apart", lambda function: function())
    found = dict(doctor.examine_surroundings())
    assert found["address space"].startswith("2.0 GB; allow 5 GB")
    assert "TMPDIR" in found["temporary folder"]
    assert "cannot be started" in found["worker processes"]
    assert int(found["threads"]) > 0
