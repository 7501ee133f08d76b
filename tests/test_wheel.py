"""The wheel contains everything: it runs without the checkout, read-only, from another folder, without a home."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.drawn import write_figure
from tests.node import ROOT

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder into which the wheel is installed, without its dependencies; nobody may write there."""
    pytest.importorskip("setuptools", "77")
    source, site = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("site")
    for name in ("fig2mesh", "exporters", "georef"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    pip = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check"]
    wheel = [*pip, "wheel", "--no-deps", "--no-build-isolation", "-w", str(source / "dist"), str(source)]
    subprocess.run(wheel, check=True, cwd=source)
    (file,) = (source / "dist").glob("*.whl")
    subprocess.run([*pip, "install", "--no-deps", "--target", str(site), str(file)], check=True, cwd=source)
    shutil.rmtree(source)
    for cache in [*site.rglob("__pycache__")]:
        shutil.rmtree(cache)
        cache.touch()  # nothing can be kept there, whoever runs the test
    for path in site.rglob("*"):
        path.chmod(path.stat().st_mode & 0o555)
    return site


def test_the_wheel_converts_elsewhere(site: Path, tmp_path: Path) -> None:
    files = write_figure(tmp_path)
    environment = {
        "PATH": os.environ["PATH"],
        "PYTHONPATH": str(site),
        "PYTHONDONTWRITEBYTECODE": "1",
        "HOME": "/nonexistent/home",
        "XDG_CACHE_HOME": str(tmp_path / "cache"),
        "OMP_NUM_THREADS": "1",
    }
    if os.getuid() == 0:  # for whom it would be made
        environment.pop("HOME")
    figure = [files.image.name, "--keypoints", files.keypoints.name, "--lonlat", "8", "47"]
    words = [*figure, "--altitude-datum", "egm96", "--quality", "draft", "-o", "a.glb", "-o", "tiles"]
    before = sorted(site.rglob("*"))
    command = [sys.executable, str(site / "bin" / "fig2mesh"), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    where = "import fig2mesh, exporters, georef; print(fig2mesh.__file__, exporters.__file__, georef.__file__)"
    done = subprocess.run(
        [sys.executable, "-c", where], capture_output=True, text=True, check=True, env=environment, cwd=tmp_path
    )
    assert all(Path(file).is_relative_to(site) for file in done.stdout.split())
    assert (tmp_path / "a.glb").is_file()
    assert (tmp_path / "tiles" / "tileset.json").is_file()
    assert any((tmp_path / "cache" / "fig2mesh" / "kernels").rglob("*.nbc"))
    assert sorted(site.rglob("*")) == before
