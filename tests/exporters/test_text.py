"""Names of files that are no UTF-8: written with a replacement, or refused before the work."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from exporters.text import plain_text, plain_texts
from fig2mesh.commands.main import main
from tests.drawn import write_figure

QUICK = ("--quality", "draft", "--parts", "outline", "--textures", "none")
MÜLLER = os.fsdecode(b"M\xfcller")
"""Müller in Latin-1, as archives of Windows unpack it."""


@pytest.mark.parametrize("text", ["Müller", "रवि", "", "a\tb"])
def test_what_utf8_holds_is_kept(text: str) -> None:
    assert plain_text(text) == text


def test_texts_at_any_depth() -> None:
    found = plain_texts({MÜLLER: [MÜLLER, 1, None, (MÜLLER, 2.5)], "a\0b": {"c": True}})
    assert found == {"M\ufffdller": ["M\ufffdller", 1, None, ("M\ufffdller", 2.5)], "ab": {"c": True}}


def test_a_figure_whose_name_is_not_utf8(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = write_figure(tmp_path)
    monkeypatch.chdir(tmp_path)
    try:
        os.rename(files.image, f"{MÜLLER}.png")
    except OSError:
        pytest.skip("this file system has no such names")
    words = [f"{MÜLLER}.png", "--keypoints", str(files.keypoints), *QUICK, "--lonlat", "8", "47"]
    outputs = ["-o", "a.gltf", "-o", "a.czml", "-o", "a.geojson", "-o", "a.usda", "-o", "tiles"]
    assert main([*words, *outputs, "--credit", MÜLLER, "--report", "report.json"]) == 0
    assert (
        json.loads(Path("a.gltf").read_text(encoding="utf-8"))["asset"]["extras"]["metadata"]["source"]
        == "M\ufffdller.png"
    )
    assert "M\ufffdller.png" in json.loads(Path("report.json").read_text(encoding="utf-8"))["figure"]["file"]
    assert main(words) == 0
    assert Path("M\ufffdller.glb").exists()


def test_an_output_whose_name_is_not_utf8(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    files = write_figure(tmp_path)
    words = [str(files.image), "--keypoints", str(files.keypoints), *QUICK]
    for name in (f"{MÜLLER}.glb", f"{MÜLLER}/a.glb"):
        assert main([*words, "-o", str(tmp_path / name)]) == 2
        message = capfd.readouterr().err
        assert "its name is not UTF-8" in message
        assert message.count("\n") == 1
