"""Kernels are kept where the user can write, or compiled in each run; one line says so."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba.core.caching
import pytest

from fig2mesh.field import compiled, kernel_cache


@pytest.fixture
def refuse(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Callable[..., None]]:
    """Make folders below the given ones unwritable, as for another user; a home, cache and temporary folder of ours."""
    for name in ("home", "tmp"):
        (tmp_path / name).mkdir()
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    writable = kernel_cache._writable

    def make(*folders: Path) -> None:
        refused = [folder.resolve() for folder in folders]
        monkeypatch.setattr(
            kernel_cache,
            "_writable",
            lambda folder: not any(folder.resolve().is_relative_to(each) for each in refused) and writable(folder),
        )
        kernel_cache.kernel_folder.cache_clear()
        kernel_cache.warn_once.cache_clear()

    yield make
    monkeypatch.undo()
    kernel_cache.kernel_folder.cache_clear()


MODULES = Path(kernel_cache.__file__).parent


def test_beside_the_modules_by_default(refuse: Callable[..., None]) -> None:
    refuse()
    assert kernel_cache.kernel_folder() == kernel_cache.KernelFolder(MODULES / "__pycache__")


def test_of_the_user_where_the_installation_is_read_only(refuse: Callable[..., None], tmp_path: Path) -> None:
    refuse(MODULES)
    found = kernel_cache.kernel_folder()
    assert (found.path, found.note) == (tmp_path / "home" / ".cache" / "fig2mesh" / "kernels", "")


@pytest.mark.parametrize("home", ["", "~", "nowhere", "/proc/none"])
def test_private_and_temporary_without_a_home(
    refuse: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, home: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", home)
    monkeypatch.setenv("XDG_CACHE_HOME", home)
    refuse(MODULES, Path("/.cache"))
    found = kernel_cache.kernel_folder()
    assert found.path is not None
    assert found.path.parent == tmp_path / "tmp"
    assert found.path.stat().st_mode & 0o777 == 0o700
    assert "NUMBA_CACHE_DIR" in found.note
    assert sorted(path.name for path in tmp_path.iterdir()) == ["home", "tmp"]


def test_not_in_a_folder_of_somebody_else(refuse: Callable[..., None], tmp_path: Path) -> None:
    (tmp_path / "tmp" / f"fig2mesh-kernels-{os.getuid()}").mkdir()
    (tmp_path / "tmp" / f"fig2mesh-kernels-{os.getuid()}").chmod(0o777)
    refuse(MODULES, tmp_path / "home")
    assert kernel_cache.kernel_folder().path is None


def test_a_given_folder_that_cannot_be_written_is_named(
    refuse: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    refuse()
    assert "file cannot be written" in kernel_cache.kernel_folder().note


def test_nowhere_is_said_once_and_kernels_run(
    refuse: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    logged: list[str] = []
    monkeypatch.setattr(kernel_cache.log, "warning", lambda text, *values: logged.append(text % values))
    refuse(MODULES, tmp_path)
    for _ in range(3):
        assert compiled.kernel(_double)(2.0) == 4.0
    assert logged == [kernel_cache.NOT_KEPT]


def test_numba_without_a_folder_is_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.core.caching.CacheImpl, "_locator_classes", [])
    assert compiled.kernel(_double)(3.0) == 6.0


@pytest.mark.parametrize("fault", [OSError(28, "No space left on device"), EOFError(), OSError(30, "Read-only")])
def test_a_cache_that_fails_costs_a_compilation(monkeypatch: pytest.MonkeyPatch, fault: Exception) -> None:
    def fail(*_: Any) -> None:
        raise fault

    monkeypatch.setattr(numba.core.caching.FunctionCache, "save_overload", fail)
    monkeypatch.setattr(numba.core.caching.FunctionCache, "load_overload", fail)
    monkeypatch.setattr(numba.core.caching.FunctionCache, "flush", fail)
    assert compiled.kernel(_double)(4.0) == 8.0


def _double(x: float) -> float:
    return 2 * x
