"""py3dtiles reads the tilesets that are written."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from exporters.tiles import write_tileset
from georef.geodesy import ecef_from_geodetic
from tests.exporters.analytic import ZURICH, asset
from tests.node import CLIENTS, ROOT

PACKAGE = "py3dtiles==12.1.1"
FOLDER = ROOT / "build" / "py3dtiles"


def read(tileset: Path) -> Any:
    """What tests/clients/py3dtiles_look.py prints; the package is installed into build/ on first use.

    Without what it depends on: it asks for older versions of NumPy and numba than the project has, and reads
    tilesets with those that are here.
    """
    if not (FOLDER / "py3dtiles").is_dir():
        command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(FOLDER), PACKAGE]
        install = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
        if install.returncode:
            pytest.skip(f"{PACKAGE} cannot be installed: {install.stderr.strip()[-200:]}")
    done = subprocess.run(
        [sys.executable, str(CLIENTS / "py3dtiles_look.py"), str(tileset)], capture_output=True, text=True, check=False,
        timeout=120, env=os.environ | {"PYTHONPATH": str(FOLDER)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_levels_triangles_volumes_and_place(tmp_path: Path) -> None:
    figure = asset(ZURICH)
    write_tileset(figure, tmp_path)
    found = read(tmp_path / "tileset.json")
    assert [tile["uri"] for tile in found] == ["farmer_lod2.glb", "farmer_lod1.glb", "farmer.glb"]
    assert [tile["triangles"] for tile in found] == [len(mesh.faces) for mesh in reversed(figure.lods)]
    errors = [*(mesh.deviation_m[1] for mesh in reversed(figure.lods[1:])), 0.0]
    assert [tile["geometric_error"] for tile in found] == pytest.approx(errors)
    feet = ecef_from_geodetic((ZURICH.lon_deg, ZURICH.lat_deg, ZURICH.height_m))
    for tile in found:
        assert tile["inside"], tile
        np.testing.assert_allclose(tile["feet"], feet, atol=1e-6)
