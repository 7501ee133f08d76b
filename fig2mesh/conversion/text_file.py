"""Text files that commands write: reports and pages."""

from __future__ import annotations

import os
from pathlib import Path

from fig2mesh.errors import OutputError


def check_text(path: Path, overwrite: bool, option: str = "--report", another: str = "--report") -> None:
    """Refuse a text file that could not be written; option, another : what its name is called in the remedy."""
    if path.is_dir():
        raise OutputError(path, "is a folder", f"give {option} a file name")
    if path.exists() and not overwrite:
        raise OutputError(path, "exists", f"pass --overwrite or another {another}")
    if not path.parent.is_dir():
        raise OutputError(path, f"no folder {path.parent}", "create it first")


def write_text(path: Path, text: str, another: str = "--report") -> None:
    """Write a text file, whole or not at all; another : what its name is called in the remedy."""
    partial = path.with_name(f".{path.name}.partial")
    try:
        partial.write_text(text, encoding="utf-8")
        os.replace(partial, path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise OutputError(path, error.strerror or "cannot be written", f"choose another {another}") from None
