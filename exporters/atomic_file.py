"""Atomic writing of files and folders.

Everything is written into a temporary folder next to its target and renamed into place when it is complete: only a
rename within one file system is atomic. Errors before that leave the disk unchanged. A process that is killed leaves
its temporary folder behind; `sweep_temporary` removes it.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final, TextIO

from exporters.errors import ExportError

TEMPORARY: Final = ".fig2mesh-*.tmp"
"""Glob pattern of the names of temporary folders, which contain the process id and a random token."""

_IN_PATHS: Final = re.compile(re.escape(TEMPORARY).replace(r"\*", r"\w+-\w+") + "/")


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Give a path to write a file to, which becomes `path` when the body ends and is removed if it fails.

    It has the name of the file, as writers choose a format by its suffix, and is in an existing folder.
    Raises OSError where it cannot be written.
    """
    with _temporary_folder(path.parent) as stage:
        yield stage / path.name
        os.replace(stage / path.name, path)


@contextmanager
def atomic_text(path: Path) -> Iterator[TextIO]:
    """Open a stream of UTF-8 text with LF line ends, which becomes the file `path` when the body ends."""
    with atomic_path(path) as partial, partial.open("w", encoding="utf-8", newline="\n") as stream:
        yield stream


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file atomically. Raises OSError where it cannot be written."""
    with atomic_path(path) as partial:
        partial.write_bytes(content)


def write_text(path: Path, text: str) -> None:
    """Write a text as UTF-8 atomically, without newline conversion. Raises OSError where it cannot be written."""
    write_bytes(path, text.encode())


@contextmanager
def atomic_folder(folder: Path) -> Iterator[Path]:
    """Give an empty folder that replaces `folder` and its contents when the body ends, and is removed if it fails.

    Raises OSError where it cannot be written.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    with _temporary_folder(folder.parent) as stage:
        # Not named as a temporary folder: a process killed between the two renames leaves the only copy here.
        old = stage.with_suffix(".old")
        try:
            yield stage
            if folder.exists():
                folder.rename(old)
            stage.rename(folder)
        except BaseException:
            if old.exists() and not folder.exists():
                old.rename(folder)
            raise
        shutil.rmtree(old, ignore_errors=True)


def write_whole(
    path: str | os.PathLike[str],
    main: Path,
    fill: Callable[[Path], None],
    overwrite: bool,
    outdated: Iterable[str] = (),
) -> tuple[Path, ...]:
    """Write the files that `fill` makes into the folder of `main`, all of them or none; `main` is renamed last.

    path : the output as given by the user, for messages
    fill : writes files and folders into the empty folder that it is given, among them a file of `main`'s name
    outdated : files in the folder of `main`, with slashes, that are removed unless `fill` makes them again
    returns : the files written

    Raises ExportError where they cannot be written, or a file exists although `overwrite` is off.
    """
    try:
        with _folders(main.parent), _temporary_folder(main.parent) as stage:
            fill(stage)
            files = (file.relative_to(stage).as_posix() for file in stage.rglob("*") if file.is_file())
            names = sorted(name for name in files if name != main.name) + [main.name]
            _put_in_place(stage, main.parent, names, overwrite, sorted(set(outdated) - set(names)))
    except OSError as error:
        reason = error.strerror or str(error)
        raise ExportError(os.fspath(path), f"cannot be written ({reason})", "choose another folder") from error
    return tuple(main.parent / name for name in names)


def sweep_temporary(folder: Path, below: bool = False) -> None:
    """Remove temporary folders that killed processes left behind; no other process may be writing there.

    below : also in subfolders at any depth
    """
    for stale in list(folder.rglob(TEMPORARY) if below else folder.glob(TEMPORARY)):
        shutil.rmtree(stale, ignore_errors=True)


def without_temporary(message: str) -> str:
    """Replace temporary paths in a message by the final ones."""
    return _IN_PATHS.sub("", message)


@contextmanager
def _folders(folder: Path) -> Iterator[None]:
    """Make a folder and its parents; remove them again if the body fails."""
    absolute = Path(os.path.abspath(folder))
    missing = [each for each in (absolute, *absolute.parents) if not each.exists()]
    try:
        absolute.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for each in missing:
            try:
                each.rmdir()
            except OSError:
                break  # not empty: another process has written to it
        raise


@contextmanager
def _temporary_folder(parent: Path) -> Iterator[Path]:
    # Not from tempfile: its folders are private to the user, and the files' permissions should follow the user's
    # umask.
    stage = parent / TEMPORARY.replace("*", f"{os.getpid()}-{secrets.token_hex(4)}")
    stage.mkdir()
    try:
        yield stage
    finally:
        shutil.rmtree(stage, ignore_errors=True)


def _put_in_place(stage: Path, folder: Path, names: list[str], overwrite: bool, outdated: list[str]) -> None:
    """Rename staged files into their folder in this order, or leave the folder unchanged."""
    # Hidden, so that it does not clash with a folder of the output.
    backup = stage / ".replaced"
    kept, new, made = [], [], []
    try:
        for name in names:
            target = folder / name
            for parent in reversed(Path(name).parents):
                if not (folder / parent).exists():
                    (folder / parent).mkdir()
                    made.append(folder / parent)
            if target.exists():
                if not overwrite and target.read_bytes() != (stage / name).read_bytes():
                    # Equal bytes are not a conflict: .gltf and .obj of one figure share their texture.
                    raise ExportError(target, "already exists", "use --overwrite or choose another name")
                _keep(target, backup / name)
                kept.append(name)
            else:
                new.append(name)
            os.replace(stage / name, target)
        for name in outdated:
            if (folder / name).is_file():
                _keep(folder / name, backup / name)
                kept.append(name)
                (folder / name).unlink()
    except BaseException:
        for name in kept:
            os.replace(backup / name, folder / name)
        for name in new:
            (folder / name).unlink(missing_ok=True)
        for each in reversed(made):
            with suppress(OSError):
                each.rmdir()
        raise


def _keep(file: Path, copy: Path) -> None:
    copy.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(file, copy)
    except OSError:  # file systems without hard links
        shutil.copy2(file, copy)
