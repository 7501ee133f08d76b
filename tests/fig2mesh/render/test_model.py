"""Models back from their files, whatever client they were written for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from exporters.errors import ExportError
from exporters.gltf.part_borders import split_at_parts
from exporters.profiles import PROFILES, profile_named
from exporters.write import write
from fig2mesh.render.model import read_model
from tests.exporters.analytic import ZURICH, asset


@pytest.mark.parametrize("name", [None, "blender", "qgis"])
def test_labels_of_parts_come_back(tmp_path: Path, name: str | None) -> None:
    given = asset(ZURICH)
    write(given, tmp_path / "a.glb", profile=profile_named(name))
    mesh = read_model(tmp_path / "a.glb")
    split = split_at_parts(given.mesh)
    assert np.array_equal(mesh.vertices, split.vertices)
    assert mesh.parts is not None
    assert np.array_equal(mesh.parts, split.parts)


def test_compressed_models_are_rejected_by_name(tmp_path: Path) -> None:
    write(asset(ZURICH), tmp_path / "a.glb", profile=PROFILES["cesiumjs"])
    with pytest.raises(ExportError, match=r"a\.glb: is compressed \(EXT_meshopt_compression\); give a file written"):
        read_model(tmp_path / "a.glb")
