"""Programs of others, as fixtures."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.node import ROOT, RunScript, installed, runner


@pytest.fixture(scope="session")
def node_modules() -> Path:
    """The Khronos glTF validator and CesiumJS: 130 MB, 6 s to install."""
    return installed(ROOT / "build" / "node", "gltf-validator", "cesium")


@pytest.fixture(scope="session")
def node(node_modules: Path) -> RunScript:
    """Run a script of tests/clients with JSON for its stdin; returns its stdout as JSON."""
    return runner(node_modules)


@pytest.fixture(scope="session")
def tiles_tools() -> RunScript:
    """The same with 3d-tiles-tools: 220 MB, more than a minute to install, hence only for slow tests."""
    return runner(installed(ROOT / "build" / "tiles-tools", "3d-tiles-tools"))


@pytest.fixture(scope="session")
def codecs() -> Path:
    """The KTX 2 encoder and another reader of compressed glTF: 9 MB."""
    names = ("ktx2-encoder", "meshoptimizer", "@gltf-transform/core", "@gltf-transform/extensions", "gltf-validator")
    return installed(ROOT / "build" / "codecs", *names)
