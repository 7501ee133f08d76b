"""Files named by a row, which must lie inside the collection's folder, and their digests."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from exporters.file_digest import sha256_of
from fig2mesh.batch.path_text import located, nearest_name
from fig2mesh.conversion.request import Request
from fig2mesh.errors import InputError

DATUMS = ("ellipsoid", "egm96")
"""Values of --altitude-datum that are not files."""

FILE_FIELDS = ("mask", "keypoints", "part_labels", "map", "altitude_datum")
"""Fields of a request, besides the figure, that may name a file."""


@dataclass(frozen=True)
class Roots:
    """base : folder of the collection, to which paths are relative; root : folder that paths may not leave."""

    base: Path
    root: Path

    def resolve(self, column: str, path: Path) -> Path:
        """Path of a file named in a row. Raises InputError if it is outside of `root`, also through links."""
        source, shown = f"column {column}", str(path)[:120]
        try:
            whole = located(self.base, str(path), source)
            real = Path(os.path.realpath(whole, strict=False))
            if not real.is_relative_to(self.root):
                self._check_relative(column, path, real)
                straight = Path(os.path.normpath(whole)).is_relative_to(self.base)
                found = f"{shown} is a link out of {self.root}" if straight else f"{shown} leads out of {self.root}"
                if not real.exists():
                    raise InputError(source, f"{found}, and does not exist", "check the path; see also --root DIR")
                wider = os.path.commonpath([real.parent, self.root])
                raise InputError(source, found, f"move the file there, or allow a wider folder with --root {wider}")
            if not stat.S_ISREG(os.stat(real).st_mode):
                raise InputError(source, f"{shown} is not a file", "check the path")
        except OSError as error:  # also loops of links, and names that are too long
            near = nearest_name(self.base, whole) if error.errno == errno.ENOENT else None
            remedy = f"check the path (did you mean {near[:120]}?)" if near else "check the path"
            raise InputError(source, f"{shown}: {error.strerror}", remedy) from None
        except ValueError as error:
            raise InputError(source, f"{shown!r} is not a path ({error})", "check the path") from None
        return whole

    def _check_relative(self, column: str, path: Path, real: Path) -> None:
        """Raise InputError for a path that is missing from the table's folder, itself outside of `root`."""
        base = Path(os.path.realpath(self.base))
        if path.is_absolute() or real.exists() or base.is_relative_to(self.root) or not real.is_relative_to(base):
            return
        remedy = f"paths are relative to the folder of the table, {base}; check the path"
        if (self.root / path).is_file():
            remedy = f"it is in {self.root}, but {remedy}"
        raise InputError(f"column {column}", f"{str(path)[:120]} does not exist", remedy)

    def shorten(self, text: str) -> str:
        """A message without the common folder of its paths."""
        for folder in (self.base, Path(os.path.realpath(self.base)), self.root):
            text = text.replace(f"{folder}{os.sep}", "")
        return text


def resolve(request: Request, roots: Roots, own: Collection[str]) -> Request:
    """Request of a row, with the paths that the row names resolved.

    own : names of the fields whose files the row names; those from the command line may be anywhere

    Raises InputError naming the column.
    """
    changes: dict[str, Any] = {"figure": roots.resolve("figure", request.figure)}
    for name in own:
        value = getattr(request, name)
        if name == "altitude_datum" and value not in DATUMS:
            changes[name] = str(roots.resolve(name, Path(value)))
        elif isinstance(value, Path):
            changes[name] = roots.resolve(name, value)
    if "map" in changes:
        for file in sheet_files(changes["map"]):
            roots.resolve("map", file)
    return replace(request, **changes)


def sheet_files(sheet: Path) -> list[Path]:
    """A map sheet and its possible sidecar files, whose names begin with its stem and a dot."""
    start = sheet.stem.casefold() + "."
    beside = [file for file in sheet.parent.iterdir() if file.name.casefold().startswith(start) and file.is_file()]
    return sorted({sheet, *beside})


def input_files(request: Request) -> dict[str, list[Path]]:
    """Input files of a resolved request, by the field that names them."""
    files = {"figure": [request.figure]}
    for name in ("mask", "keypoints", "part_labels"):
        if (path := getattr(request, name)) is not None:
            files[name] = [path]
    if request.map is not None:
        files["map"] = sheet_files(request.map)
    if request.altitude_datum not in DATUMS:
        files["altitude_datum"] = [Path(request.altitude_datum)]
    return files


def digest_of(path: Path) -> str:
    """SHA-256 of a file, cached until its size or modification time changes."""
    facts = path.stat()
    return _digest(path, facts.st_size, facts.st_mtime_ns, facts.st_ino)


@lru_cache(maxsize=4096)
def _digest(path: Path, size: int, changed_ns: int, inode: int) -> str:
    return sha256_of(path)


def files_unchanged(folder: Path, files: dict[str, str]) -> bool:
    """Whether files are unchanged; files : path relative to the folder → digest."""
    try:
        return all(digest_of(folder / name) == digest for name, digest in files.items())
    except OSError:
        return False
