"""The files that a row names: inside the collection's folder, and their digests."""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from exporters.file_digest import sha256_of
from fig2mesh.batch.row_options import DATUMS, PATHS
from fig2mesh.errors import InputError


@dataclass(frozen=True)
class Roots:
    """base : folder from which the rows' paths are seen, the collection's; root : folder that they may not leave."""

    base: Path
    root: Path

    def resolve(self, column: str, path: Path) -> Path:
        """The file a row means. Raises InputError where it is outside of `root`, through links too."""
        whole, shown = self.base / path, str(path)[:120]
        try:
            real = Path(os.path.realpath(whole, strict=False))
            if not real.is_relative_to(self.root):
                straight = Path(os.path.normpath(whole)).is_relative_to(self.base)
                found = f"{shown} is a link out of {self.root}" if straight else f"{shown} leads out of {self.root}"
                raise InputError(f"column {column}", found, "put the file there, or pass --root DIR")
            if not stat.S_ISREG(os.stat(real).st_mode):
                raise InputError(f"column {column}", f"{shown} is no file", "check the path")
        except OSError as error:  # also loops of links, and names that are too long
            raise InputError(f"column {column}", f"{shown}: {error.strerror}", "check the path") from None
        except ValueError as error:
            raise InputError(f"column {column}", f"{shown!r} is no path ({error})", "check the path") from None
        return whole

    def shorten(self, text: str) -> str:
        """A message without the folder that all its paths have in common."""
        for folder in (self.base, Path(os.path.realpath(self.base)), self.root):
            text = text.replace(f"{folder}{os.sep}", "")
        return text


def inside(values: dict[str, Any], roots: Roots, trusted: frozenset[str]) -> dict[str, Any]:
    """Parameters of the main job with the paths that the row names resolved.

    trusted : parameters that are from the command line, not from the row
    """
    resolved = dict(values)
    resolved["figure"] = roots.resolve("figure", values["figure"])
    for name in PATHS:
        if values[name] is not None and name not in trusted:
            resolved[name] = roots.resolve(name.removesuffix("_sheet"), values[name])
    datum = values["altitude_datum"]
    if datum not in DATUMS and "altitude_datum" not in trusted:
        resolved["altitude_datum"] = str(roots.resolve("altitude_datum", Path(datum)))
    sheet = resolved["map_sheet"]
    if sheet is not None and "map_sheet" not in trusted:
        for file in sheet_files(sheet):
            roots.resolve("map", file)
    return resolved


def sheet_files(sheet: Path) -> list[Path]:
    """A sheet and what may belong to it: files beside it that begin with its stem and a dot."""
    start = sheet.stem.casefold() + "."
    beside = [file for file in sheet.parent.iterdir() if file.name.casefold().startswith(start) and file.is_file()]
    return sorted({sheet, *beside})


def input_files(values: dict[str, Any]) -> dict[str, list[Path]]:
    """Parameter → the files that decide what becomes of it; of resolved parameters."""
    files = {"figure": [values["figure"]]}
    for name in PATHS:
        if values[name] is not None:
            files[name] = sheet_files(values[name]) if name == "map_sheet" else [values[name]]
    if values["altitude_datum"] not in DATUMS:
        files["altitude_datum"] = [Path(values["altitude_datum"])]
    return files


def digest_of(path: Path) -> str:
    """SHA-256 of a file; read once, as long as size and time of change stay the same."""
    facts = path.stat()
    return _digest(path, facts.st_size, facts.st_mtime_ns, facts.st_ino)


@lru_cache(maxsize=4096)
def _digest(path: Path, size: int, changed_ns: int, inode: int) -> str:
    return sha256_of(path)


def stand(folder: Path, files: dict[str, str]) -> bool:
    """Whether files are there as they were left. files : path seen from the folder → digest"""
    try:
        return all(digest_of(folder / name) == digest for name, digest in files.items())
    except OSError:
        return False
