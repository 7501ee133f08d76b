"""Text files that commands write: reports and pages."""

from __future__ import annotations

from pathlib import Path

from exporters import atomic_file
from fig2mesh.errors import OutputError


def check_text(path: Path, overwrite: bool, option: str = "--report") -> None:
    """Raise OutputError for a text file that could not be written; option : the one that names it."""
    if path.is_dir():
        raise OutputError(path, "is a directory", f"give {option} a file name")
    if path.exists() and not overwrite:
        raise OutputError(path, "already exists", "use --overwrite or choose another name")
    if not path.parent.is_dir():
        raise OutputError(path, f"no such directory {path.parent}", "create it first")


def write_text(path: Path, text: str, option: str = "--report") -> None:
    """Write a text file, whole or not at all; option : the one that names it. Raises OutputError."""
    try:
        atomic_file.write_text(path, text)
    except OSError as error:
        raise OutputError(path, error.strerror or "cannot be written", f"choose another name for {option}") from None
