"""Paths of outputs."""

from __future__ import annotations

import os

from exporters.errors import ExportError


def check_utf8(path: str | os.PathLike[str]) -> None:
    """Raise ExportError for a path that is not UTF-8: files refer to each other by name, and USD and GDAL refuse it."""
    try:
        os.fspath(path).encode()
    except UnicodeEncodeError:
        raise ExportError(os.fspath(path), "its name is not UTF-8", "choose another name") from None
