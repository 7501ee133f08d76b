"""Public interface for scripts: names, lazy imports, and ten lines from a picture to files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import fig2mesh
from tests.drawn import write_figure
from tests.node import ROOT

HEAVY = ("torch", "open3d", "numpy", "scipy", "numba", "pymeshlab", "trimesh", "pxr", "click")


def test_importing_the_package_imports_nothing_heavy() -> None:
    program = f"import sys, fig2mesh\nfig2mesh.Request\nprint([name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", fig2mesh.__all__)
def test_every_name_is_there(name: str) -> None:
    assert name in dir(fig2mesh)
    assert getattr(fig2mesh, name).__doc__


def test_other_names_are_not() -> None:
    with pytest.raises(AttributeError, match="no attribute 'convrt'"):
        fig2mesh.convrt  # noqa: B018


def test_from_a_picture_to_files(tmp_path: Path) -> None:
    files = write_figure(tmp_path)
    figure = fig2mesh.read_figure(str(files.image), keypoints=str(files.keypoints))
    assert figure._repr_png_().startswith(b"\x89PNG")
    request = fig2mesh.Request(files.image, keypoints=files.keypoints, quality="draft", parts="outline", seed=1)
    model = fig2mesh.convert(request, figure)
    assert model.asset.mesh.texture is not None
    assert model._repr_png_().startswith(b"\x89PNG")
    written = fig2mesh.write(model, tmp_path / "a.glb", tmp_path / "a.ply")
    assert {path.name for path in written} == {"a.glb", "a.ply"}
    assert not [each for each in fig2mesh.validate(tmp_path / "a.glb") if each.severity in ("error", "warning")]
    with pytest.raises(fig2mesh.InputError, match="overwrite"):
        fig2mesh.write(model, tmp_path / "a.glb")
    with pytest.raises(fig2mesh.InputError, match="place"):
        fig2mesh.write(model, tmp_path / "tiles")
