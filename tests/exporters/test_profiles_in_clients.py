"""Files of each profile in their client, or in its own validator."""

from __future__ import annotations

import base64
import io
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from exporters.profiles import PROFILES, profile_named
from exporters.write import write
from tests.exporters.analytic import HEIGHT, ZURICH, asset, capsule
from tests.exporters.outlined import hulled, ribboned
from tests.node import ROOT, installed, runner

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


def _browser() -> str:
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        pytest.skip(f"no browser ({', '.join(BROWSERS)}): CesiumJS not tried; apt-get install chromium")
    return browser


def _pixels(png: str) -> NDArray[np.int64]:
    with Image.open(io.BytesIO(base64.b64decode(png))) as image:
        return np.asarray(image.convert("RGB")).astype(np.int64)


@pytest.mark.slow
def test_cesiumjs_shows_compressed_models_like_plain_ones(
    tmp_path: Path, node_modules: Path, codecs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    browser = _browser()
    monkeypatch.setenv("NODE_PATH", str(codecs))
    names = (None, "cesiumjs", "cesiumjs-ktx2")
    models = []
    for name in names:
        for suffix in (".glb", ".gltf"):
            path = tmp_path / f"{name}{suffix}"
            write(asset(ZURICH, lods=(capsule(48, 12),)), path, profile=profile_named(name))
            models.append(str(path))
    run = runner(installed(ROOT / "build" / "browser", "playwright-core"))
    cesium = str(node_modules / "cesium" / "Build" / "Cesium")
    job = {"browser": browser, "cesium": cesium, "models": models, "width": 120, "height": 200}
    found = run("cesium_models.mjs", stdin=job)
    assert [(each.get("error"), each["messages"]) for each in found] == [(None, [])] * len(models)
    plain = _pixels(found[0]["png"])
    shown = (plain != 255).any(axis=2)
    # A capsule 0.6 m by 1.8 m, upright: it stands in the middle, three times as high as wide.
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    assert np.ptp(rows) / np.ptp(columns) == pytest.approx(HEIGHT / 0.6, rel=0.1)
    # The drawing's red grows to the right and its green downwards: the front is visible.
    assert plain[100, columns[-5], 0] > plain[100, columns[5], 0] + 50
    assert plain[rows[-9], 60, 1] > plain[rows[9], 60, 1] + 50
    for each, model in zip(found[1:], models[1:], strict=True):
        other = _pixels(each["png"])
        assert ((other != 255).any(axis=2) ^ shown).sum() <= 2, model
        # WebP is lossless; ETC1S has four colours in a block of four by four texels, here of a steep ramp.
        assert np.abs(other - plain)[shown].mean() < (4.0 if "ktx2" in model else 0.5), model


@pytest.mark.slow
def test_cesiumjs_shows_outlines_without_hiding_the_figure(
    tmp_path: Path, node_modules: Path, codecs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    browser = _browser()
    monkeypatch.setenv("NODE_PATH", str(codecs))
    shapes = {
        "bare": capsule(),
        "hull": hulled(capsule()),
        "ribbon": ribboned(capsule(), pens=2),
        "ribbon as drawn": ribboned(capsule(), drawn=True),
    }
    names = (None, "cesiumjs", "cesiumjs-ktx2")
    models = []
    for name in names:
        for form, mesh in shapes.items():
            path = tmp_path / f"{name} {form}.glb"
            write(asset(ZURICH, lods=(mesh,)), path, profile=profile_named(name))
            models.append(str(path))
    run = runner(installed(ROOT / "build" / "browser", "playwright-core"))
    cesium = str(node_modules / "cesium" / "Build" / "Cesium")
    job = {"browser": browser, "cesium": cesium, "models": models, "width": 120, "height": 200}
    found = run("cesium_models.mjs", stdin=job)
    assert [(each.get("error"), each["messages"]) for each in found] == [(None, [])] * len(models)
    assert [each["outline"] for each in found] == [False, True, True, True] * len(names)
    bare = _pixels(found[0]["png"])
    for each, model in zip(found[1:], models[1:], strict=True):
        # Far from the line the figure is as without: nothing is in front of it.
        assert np.abs(_pixels(each["png"]) - bare)[80:120, 50:70].mean() < 8, model


@pytest.mark.parametrize("suffix", [".usdc", ".usdz"])
@pytest.mark.parametrize("lods", [1, 3])
def test_nvidias_validator_finds_nothing(tmp_path: Path, suffix: str, lods: int) -> None:
    path, report = tmp_path / f"farmer{suffix}", tmp_path / "report.json"
    write(asset(ZURICH, lods=asset().lods[:lods]), path, profile=PROFILES["omniverse"])
    tool = Path(sys.executable).with_name("nvidia_usd_validate")
    if not tool.is_file():
        pytest.skip("usd-validation-nvidia is not installed: not checked by NVIDIA's validator")
    command = [str(tool), "--json-output", str(report), str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert json.loads(report.read_text()) == {"status": "PASS", "rules": []}, done.stderr


def test_assimp_reads_what_qgis_is_given(tmp_path: Path) -> None:
    # QGIS reads the models of its 3D symbols through Qt 3D, which uses Assimp.
    tool = shutil.which("assimp")
    if tool is None:
        pytest.skip("assimp not found: models for QGIS not read by it; apt-get install assimp-utils")
    given = asset(ZURICH)
    for suffix in (".glb", ".gltf", ".obj"):
        write(given, tmp_path / f"farmer{suffix}", profile=PROFILES["qgis"])
        done = subprocess.run([tool, "info", str(tmp_path / f"farmer{suffix}")], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout
        numbers = {
            line[:14].strip(" :"): [float(number) for number in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", line[14:])]
            for line in done.stdout.splitlines()
        }
        assert numbers["Faces"] == [len(given.mesh.faces)]
        size = np.subtract(numbers["Maximum point"], numbers["Minimum point"])
        assert size == pytest.approx([0.6, HEIGHT, 0.6], abs=1e-5)
