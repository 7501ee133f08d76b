"""One finished run of the main job, shared by the tests that inspect its outputs."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from fig2mesh.commands.main import main
from tests.drawn import DrawnFiles, write_figure

ZURICH = ("8.5417", "47.3769")


@dataclass(frozen=True)
class Run:
    """A finished run: its folder, its input files and its report."""

    folder: Path
    files: DrawnFiles
    report: dict[str, Any]

    def output(self, name: str) -> Path:
        return self.folder / "out" / name


OUTPUTS = ("a.czml", "a.glb", "b/tileset.json", "c.usdz", "d.ply", "e.obj", "f.gltf", "g.usda", "h.geojson")


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The drawn figure through the main job, draft quality, every format, two levels of detail."""
    folder = tmp_path_factory.mktemp("job")
    files = write_figure(folder)
    (folder / "out").mkdir()
    arguments = [str(files.image), "--keypoints", str(files.keypoints), "--lonlat", *ZURICH, "--facing", "NE"]
    arguments += [
        "--quality",
        "draft",
        "--mesher",
        "ball-pivot",
        "--lods",
        "2",
        "--height-m",
        "2.5",
        "--credit",
        "Drawn by a test",
    ]
    arguments += ["--save-stages", str(folder / "stages"), "--report", str(folder / "report.json"), "-q"]
    for name in OUTPUTS:
        arguments += ["-o", str(folder / "out" / name)]
    assert main(arguments) == 0
    return Run(folder, files, json.loads((folder / "report.json").read_text()))
