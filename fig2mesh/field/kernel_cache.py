"""Folder in which compiled kernels are kept between runs; without numba, so that it can be asked for at no cost.

By default that is beside the modules. In an installation that the user cannot write to, it is the user's cache folder,
then a private folder in the temporary one; where none of these can be written, kernels are compiled in each run.
"""

from __future__ import annotations

import functools
import logging
import multiprocessing
import os
import stat
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

VARIABLE: Final = "NUMBA_CACHE_DIR"
"""Environment variable that names the folder; numba's own."""

REMEDY: Final = f"set {VARIABLE} to a writable folder"

NOT_KEPT: Final = f"compiled kernels cannot be kept, so that each run compiles them (up to a minute); {REMEDY}"

log = logging.getLogger("fig2mesh")


@dataclass(frozen=True)
class KernelFolder:
    """Folder of compiled kernels.

    path : None where there is none; numba_dir : value for numba, "" for folders beside the modules
    note : why kernels do not outlast this run or the temporary folder, "" where they do
    """

    path: Path | None
    numba_dir: str = ""
    note: str = ""


@functools.cache
def kernel_folder() -> KernelFolder:
    """Return the first folder that can be written."""
    given = os.environ.get(VARIABLE, "")
    wrong = f"{VARIABLE}={given} cannot be written; " if given else ""
    if given and _writable(Path(given)):
        return KernelFolder(Path(given), given)
    beside = Path(__file__).parent / "__pycache__"
    if _writable(beside):
        return KernelFolder(beside, "", wrong and f"{wrong}compiled kernels are kept beside the modules")
    for folder in _of_user():
        if _writable(folder):
            return KernelFolder(folder, str(folder), wrong and f"{wrong}compiled kernels are kept in {folder}")
    if (private := _private_temporary()) is not None:
        kept = f"compiled kernels are kept in {private}, which may be emptied"
        return KernelFolder(private, str(private), f"{wrong}{kept}; {REMEDY}")
    return KernelFolder(None, "", wrong + NOT_KEPT)


@functools.cache
def warn_once(note: str) -> None:
    """Log a note about kernels that are not kept, once in a process and not in the workers of a batch."""
    if note and multiprocessing.parent_process() is None:
        log.warning("%s", note)


def _writable(folder: Path) -> bool:
    # Not by os.access, which knows nothing of quotas, of containers, or of the user root of another machine.
    try:
        str(folder).encode()  # numba hashes paths as UTF-8
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except (OSError, ValueError):
        return False


def _of_user() -> Iterator[Path]:
    """Cache folders of the user; relative ones, as "~" without a home, would be made in the working directory."""
    for folder in (os.environ.get("XDG_CACHE_HOME", ""), os.path.expanduser("~/.cache")):
        if os.path.isabs(folder):
            yield Path(folder) / "fig2mesh" / "kernels"


def _private_temporary() -> Path | None:
    """Folder in the temporary one that only this user can write: compiled kernels of somebody else would be run."""
    user = os.getuid() if hasattr(os, "getuid") else "user"
    try:
        temporary = tempfile.gettempdir()
        if os.path.realpath(temporary) == os.getcwd():  # what tempfile resorts to
            return None
        folder = Path(temporary) / f"fig2mesh-kernels-{user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return None
    if not stat.S_ISDIR(found.st_mode) or (hasattr(os, "getuid") and (found.st_uid != user or found.st_mode & 0o022)):
        return None
    return folder if _writable(folder) else None
