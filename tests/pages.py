"""Clients of the browser on one page, in one start of Chromium, see tests/clients/pages/page.js."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

from fig2mesh.view.server import page_server
from tests.browser import chromium, serving
from tests.installing import alone_in
from tests.node import CLIENTS, ROOT, installed, runner

PAGES = CLIENTS / "pages"
FOLDER = ROOT / "build" / "pages"
CESIUM_OLD = "cesium-1.123"
PACKAGES = (
    CESIUM_OLD,
    "3d-tiles-renderer",
    "@google/model-viewer",
    "@loaders.gl/core",
    "@loaders.gl/gltf",
    "babylonjs",
    "babylonjs-loaders",
    "deck.gl",
    "esbuild",
    "itowns",
    "three",
)
ENTRIES = ("page", "three", "tiles_renderer", "cesium", "babylon", "model_viewer", "deck", "itowns")
SECONDS = 1200


def version(package: str) -> str:
    """The pinned version of a package, without the name that an alias stands for."""
    return str(json.loads((CLIENTS / "package.json").read_text())["dependencies"][package]).rpartition("@")[2]


def bundled() -> tuple[Path, Path]:
    """The packages and the modules of the page, bundled with what they import; a second or two."""
    modules = installed(FOLDER, *PACKAGES)
    bundles = FOLDER / "bundles"
    program = modules / "@esbuild" / "linux-x64" / "bin" / "esbuild"
    command = [str(program) if program.is_file() else str(modules / ".bin" / "esbuild")]
    command += [str(PAGES / f"{name}.js") for name in ENTRIES]
    command += ["--bundle", "--format=esm", "--splitting", f"--outdir={bundles}", "--external:/modules/*"]
    command += ["--log-level=error"]
    with alone_in(FOLDER):
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            check=False,
            cwd=PAGES,
            env={"NODE_PATH": str(modules)},
            timeout=120,
        )
    if done.returncode:
        pytest.fail(f"esbuild: {done.stderr[-2000:]}")
    return modules, bundles


def acted(files: Path, cesium: Path, actions: list[dict[str, Any]], size: tuple[int, int]) -> dict[str, Any]:
    """What the page makes of actions, see tests/clients/view.mjs; `files` are served below /files/."""
    program = chromium()
    modules, bundles = bundled()
    run = runner(installed(ROOT / "build" / "browser", "playwright-core"), SECONDS)
    folders = {
        "bundles": bundles,
        "cesium": cesium,
        "cesium_old": modules / CESIUM_OLD / "Build" / "Cesium",
        "files": files,
        "modules": modules,
    }
    with serving(page_server((PAGES / "page.html").read_text(encoding="utf-8"), 0, folders)) as address:
        job = {"browser": program, "url": address, "width": size[0], "height": size[1], "actions": actions}
        return dict(run("view.mjs", stdin=job)) | {"address": address}
