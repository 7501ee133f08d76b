"""Files and folders that appear whole or not at all.

Everything is written into a temporary folder beside its target and renamed into place when it is finished: only a
rename within one file system is atomic. What goes wrong before that leaves the disk as it was. A process that is
killed leaves its temporary folder behind; `sweep_temporary` removes it.
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
"""Names of temporary folders, as a pattern of `glob`; each has the name of its process and a random one in it."""

_IN_PATHS: Final = re.compile(re.escape(TEMPORARY).replace(r"\*", r"\w+-\w+") + "/")


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """A path to write a file to, which becomes `path` when the body ends and goes where it fails.

    It has the name of the file, as writers choose a format by its suffix, and is in a folder that is there already.
    Raises OSError where the disk refuses.
    """
    with _temporary_folder(path.parent) as stage:
        yield stage / path.name
        os.replace(stage / path.name, path)


@contextmanager
def atomic_text(path: Path) -> Iterator[TextIO]:
    """A stream of UTF-8 text, its lines ended by LF, that becomes the file `path` when the body ends."""
    with atomic_path(path) as partial, partial.open("w", encoding="utf-8", newline="\n") as stream:
        yield stream


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file, whole or not at all. Raises OSError where the disk refuses."""
    with atomic_path(path) as partial:
        partial.write_bytes(content)


def write_text(path: Path, text: str) -> None:
    """Write a file of UTF-8 text as it is, whole or not at all. Raises OSError where the disk refuses."""
    write_bytes(path, text.encode())


@contextmanager
def atomic_folder(folder: Path) -> Iterator[Path]:
    """An empty folder that replaces `folder`, with all that is in it, when the body ends, and goes where it fails.

    Raises OSError where the disk refuses.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    with _temporary_folder(folder.parent) as stage:
        # No temporary folder by its name: a process killed between the two renames leaves the only copy here.
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
    """Put the files that `fill` makes in a folder beside `main`, all of them or none; `main` comes last.

    path : the output as it was asked for, for messages
    fill : writes into the (empty) folder that it is given, a file of `main`'s name among others, folders too
    outdated : files beside `main`, slashes between folders, that go where `fill` makes none of their name
    returns : the files written

    Raises ExportError where the disk refuses, or a file is there already although `overwrite` is off.
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
    """Remove what killed processes had not put in place; no other process may be writing there.

    below : also in the folders of the folder, however deep
    """
    for stale in list(folder.rglob(TEMPORARY) if below else folder.glob(TEMPORARY)):
        shutil.rmtree(stale, ignore_errors=True)


def without_temporary(message: str) -> str:
    """A message with the paths that files get instead of those that they are written to."""
    return _IN_PATHS.sub("", message)


@contextmanager
def _folders(folder: Path) -> Iterator[None]:
    """Make a folder and the ones above it; take them away again if the body fails."""
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
                break  # someone else has put something in: it stays
        raise


@contextmanager
def _temporary_folder(parent: Path) -> Iterator[Path]:
    # Not from tempfile: its folders are private to the user, and the files' permissions should be those that the
    # user's umask gives.
    stage = parent / TEMPORARY.replace("*", f"{os.getpid()}-{secrets.token_hex(4)}")
    stage.mkdir()
    try:
        yield stage
    finally:
        shutil.rmtree(stage, ignore_errors=True)


def _put_in_place(stage: Path, folder: Path, names: list[str], overwrite: bool, outdated: list[str]) -> None:
    """Rename staged files into their folder in this order, or leave the folder as it was."""
    # Hidden, so that it is no folder of an output.
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
                    # Equal bytes are no conflict: .gltf and .obj of one figure share their texture.
                    raise ExportError(target, "exists already", "use --overwrite or choose another name")
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
