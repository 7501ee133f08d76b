"""Programs of others are installed into build/ on first use, by one test process at a time."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Nobody else installs into `folder` meanwhile; who comes second finds what the first has installed."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(folder.with_name(f"{folder.name}.lock")):
        yield


def install(python: Path | str, *arguments: str) -> str:
    """Install Python packages for an interpreter, by uv where that can, which is quicker, else by pip.

    Returns the end of what pip says where it cannot either, else nothing.
    """
    uv = [sys.executable, "-m", "uv", "pip", "install", "-q", "--python", str(python)]
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "-q", "--disable-pip-version-check"]
    for installer in (uv, pip):
        done = subprocess.run([*installer, *arguments], capture_output=True, text=True, check=False, timeout=900)
        if done.returncode == 0:
            return ""
    return done.stderr.strip()[-200:] or "no reason given"
