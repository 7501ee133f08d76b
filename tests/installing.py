"""Programs of others are installed into build/ on first use, by one test process at a time."""

from __future__ import annotations

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
