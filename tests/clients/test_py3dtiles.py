"""Tilesets read by py3dtiles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from exporters.level_error import level_errors
from exporters.tiles.tileset import write_tileset
from georef.geodesy import ecef_from_geodetic
from tests import py3dtiles
from tests.exporters.analytic import ZURICH, asset


@pytest.mark.slow
def test_levels_triangles_volumes_and_place(tmp_path: Path) -> None:
    figure = asset(ZURICH)
    write_tileset(figure, tmp_path)
    found = py3dtiles.read("py3dtiles_levels.py", tmp_path / "tileset.json")
    assert [tile["uri"] for tile in found] == ["farmer_lod2.glb", "farmer_lod1.glb", "farmer.glb"]
    assert [tile["triangles"] for tile in found] == [len(mesh.faces) for mesh in reversed(figure.lods)]
    errors = [*reversed(level_errors(figure.lods))]
    assert [tile["geometric_error"] for tile in found] == pytest.approx(errors)
    feet = ecef_from_geodetic((ZURICH.lon_deg, ZURICH.lat_deg, ZURICH.height_m))
    for tile in found:
        assert tile["inside"], tile
        np.testing.assert_allclose(tile["feet"], feet, atol=1e-6)
