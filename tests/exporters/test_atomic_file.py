"""Files and folders are written atomically, even with failures in between."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from exporters.atomic_file import (
    TEMPORARY,
    atomic_folder,
    atomic_path,
    atomic_text,
    sweep_temporary,
    without_temporary,
    write_bytes,
    write_text,
    write_whole,
)
from exporters.errors import ExportError


def _contents(folder: Path) -> dict[str, bytes | None]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


@contextmanager
def _file(path: Path) -> Iterator[Path]:
    with atomic_path(path) as partial:
        partial.write_bytes(b"new")
        yield path


@contextmanager
def _text(path: Path) -> Iterator[Path]:
    with atomic_text(path) as stream:
        stream.write("new")
        yield path


@contextmanager
def _folder(path: Path) -> Iterator[Path]:
    with atomic_folder(path) as stage:
        (stage / "file").write_bytes(b"new")
        yield path


@pytest.mark.parametrize("error", [ValueError, OSError, KeyboardInterrupt])
@pytest.mark.parametrize("there_before", [False, True])
@pytest.mark.parametrize("write", [_file, _text, _folder])
def test_a_body_that_fails_leaves_the_disk_as_it_was(
    tmp_path: Path, write: Callable[[Path], object], there_before: bool, error: type[BaseException]
) -> None:
    target = tmp_path / "target"
    if there_before and write is _folder:
        target.mkdir()
        (target / "old").write_bytes(b"old")
    elif there_before:
        target.write_bytes(b"old")
    before = _contents(tmp_path)
    with pytest.raises(error), write(target):  # type: ignore[attr-defined]
        raise error
    assert _contents(tmp_path) == before


@pytest.mark.parametrize("there_before", [False, True])
def test_the_content_is_complete_after_success_and_not_visible_before(tmp_path: Path, there_before: bool) -> None:
    target = tmp_path / "a.npz"
    if there_before:
        target.write_bytes(b"old")
    with atomic_path(target) as partial:
        assert partial.name == target.name
        assert partial.parent.parent == tmp_path
        partial.write_bytes(b"new")
        assert target.exists() == there_before
        assert not there_before or target.read_bytes() == b"old"
    assert _contents(tmp_path) == {"a.npz": b"new"}


def test_a_failing_rename_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(source: Path, target: Path) -> None:
        raise OSError(28, "No space left on device")

    (tmp_path / "a").write_bytes(b"old")
    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="No space left on device"):
        write_bytes(tmp_path / "a", b"new")
    assert _contents(tmp_path) == {"a": b"old"}


def test_a_body_that_writes_nothing_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), atomic_path(tmp_path / "a"):
        pass
    assert _contents(tmp_path) == {}


def test_a_missing_folder_is_an_error_and_is_not_made(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        write_text(tmp_path / "none" / "a", "new")
    assert _contents(tmp_path) == {}


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_text_is_written_unchanged(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    folder = tmp_path_factory.mktemp("text")
    write_text(folder / "one", text)
    with atomic_text(folder / "two") as stream:
        stream.write(text)
    assert _contents(folder) == {"one": text.encode(), "two": text.encode()}


def test_permissions_of_files_follow_the_umask(tmp_path: Path) -> None:
    mask = os.umask(0o022)
    try:
        write_text(tmp_path / "a", "new")
    finally:
        os.umask(mask)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize("write", [_file, _folder])
def test_of_two_writers_that_overlap_the_last_one_wins(tmp_path: Path, write: Callable[[Path], object]) -> None:
    with write(tmp_path / "target"), write(tmp_path / "target"):  # type: ignore[attr-defined]
        pass
    written = tmp_path / "target" / "file" if write is _folder else tmp_path / "target"
    assert written.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [tmp_path / "target"]


def _write_often(path: Path, digit: str) -> None:
    for _ in range(100):
        write_text(path, digit * 100_000)


def test_two_processes_leave_one_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "target"
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=_write_often, args=(path, digit)) for digit in "12"]
    for process in processes:
        process.start()
    while any(process.is_alive() for process in processes):
        if path.exists():
            assert path.read_text() in ("1" * 100_000, "2" * 100_000)
    for process in processes:
        process.join()
        assert process.exitcode == 0
    assert list(tmp_path.iterdir()) == [path]


def _die_halfway(path: Path) -> None:
    with atomic_path(path) as partial:
        partial.write_text("half")
        os.kill(os.getpid(), signal.SIGKILL)


def test_leftovers_of_a_killed_process_are_removed(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    (tmp_path / "a").write_text("old")
    (tmp_path / ".fig2mesh").mkdir()
    before = _contents(tmp_path)
    for path in (tmp_path / "a", tmp_path / "deep" / "b"):
        process = multiprocessing.get_context("spawn").Process(target=_die_halfway, args=(path,))
        process.start()
        process.join()
        assert process.exitcode == -signal.SIGKILL
    assert len(list(tmp_path.glob(TEMPORARY))) == len(list((tmp_path / "deep").glob(TEMPORARY))) == 1
    sweep_temporary(tmp_path)
    assert len(_contents(tmp_path)) == len(before) + 2
    sweep_temporary(tmp_path, below=True)
    assert _contents(tmp_path) == before


def test_messages_name_the_file_that_is_written(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No such file") as caught, atomic_path(tmp_path / "a.json") as partial:
        partial.read_bytes()
    assert without_temporary(str(caught.value)) == f"[Errno 2] No such file or directory: '{tmp_path / 'a.json'}'"


def test_an_old_folder_is_replaced_completely(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "target"
    with _folder(target):
        pass
    (target / "old").write_bytes(b"old")
    with _folder(target):
        assert (target / "old").exists()
    assert _contents(tmp_path) == {"deep": None, "deep/target": None, "deep/target/file": b"new"}


def test_a_folder_that_cannot_be_put_in_place_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "target"
    target.mkdir()
    (target / "old").write_bytes(b"old")
    rename = Path.rename

    def refuse(source: Path, to: Path) -> Path:
        if source.match(TEMPORARY):
            raise OSError(28, "No space left on device")
        return rename(source, to)

    monkeypatch.setattr(Path, "rename", refuse)
    with pytest.raises(OSError, match="No space left on device"), _folder(target):
        pass
    assert _contents(tmp_path) == {"target": None, "target/old": b"old"}


@pytest.mark.parametrize("failing", range(4))
def test_several_files_are_put_in_place_together(tmp_path: Path, failing: int, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "outdated").write_bytes(b"old")
    (tmp_path / "b").write_bytes(b"old")
    before, real, order = _contents(tmp_path), os.replace, []

    def replace(source: Path, target: Path) -> None:
        order.append(Path(target).name)
        if len(order) == failing + 1:
            raise OSError(28, "No space left on device")
        real(source, target)

    def fill(stage: Path) -> None:
        (stage / "deep").mkdir()
        for name in ("main", "b", "deep/c"):
            (stage / name).write_bytes(b"new")

    monkeypatch.setattr(os, "replace", replace)
    if failing < 3:
        with pytest.raises(ExportError, match=r"cannot be written \(No space left on device\)"):
            write_whole("OUT", tmp_path / "main", fill, overwrite=True, outdated=["outdated"])
        assert _contents(tmp_path) == before
    else:
        write_whole("OUT", tmp_path / "main", fill, overwrite=True, outdated=["outdated"])
        assert order == ["b", "c", "main"]
        assert set(_contents(tmp_path)) == {"b", "deep", "deep/c", "main"}
