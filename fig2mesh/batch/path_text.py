"""Paths as tables write them: of other systems, as URLs, or with their marks composed in another way."""

from __future__ import annotations

import difflib
import os
import re
import unicodedata
from itertools import islice
from pathlib import Path
from urllib.parse import unquote

from fig2mesh.errors import InputError

MAX_LISTED = 20_000
"""Names of a folder that are compared with a name that is missing from it."""

_FILE_URL = re.compile(r"file:/{1,3}(localhost/)?", re.IGNORECASE)
_URL = re.compile(r"[a-z][a-z0-9+.-]+:/", re.IGNORECASE)
_DRIVE = re.compile(r"/?([a-z]:([\\/]|$)|\\\\)", re.IGNORECASE)

HERE = "give the path relative to the folder of the table"


def located(base: Path, text: str, source: str) -> Path:
    r"""Path for the text of a cell, whether there is such a file or not.

    base : folder that it is relative to; source : named in messages

    `file://` URLs are decoded, and `\` separates folders where no file has it in its name. A name in another Unicode
    form than that of the disk, as tables from macOS have it, is that of the disk.

    Raises InputError for other URLs, drives of Windows, and `~`.
    """
    whole = base / text
    if os.path.lexists(whole):
        return whole
    shown = text[:120]
    if match := _FILE_URL.match(text):
        text = "/" + unquote(text[match.end() :])
    elif _URL.match(text):
        raise InputError(source, f"{shown} is a web address", "download the file, and give its path")
    if _DRIVE.match(text) and os.sep == "/":
        raise InputError(source, f"{shown} is a path of Windows, with a drive or a server", HERE)
    if text == "~" or text.startswith(("~/", "~\\")):
        raise InputError(source, f"{shown} begins with ~, which is not expanded in tables", HERE)
    return _as_on_disk(base / text.replace("\\", "/"))


def _as_on_disk(whole: Path) -> Path:
    """The path with its last names in the Unicode form that they have on the disk; unchanged if there are none."""
    if whole.name.isascii() and whole.parent.name.isascii():
        return whole
    if not os.path.lexists(whole) and whole.parent != whole:
        parent = _as_on_disk(whole.parent)
        form = unicodedata.normalize("NFC", whole.name)
        for name in _names(parent):
            if unicodedata.normalize("NFC", name) == form:
                return parent / name
    return whole


def nearest_name(base: Path, whole: Path) -> str | None:
    """Path, as a row could write it, of the file in the same folder whose name is nearest to that of a missing one."""
    wanted = unquote(whole.name).casefold()
    by_key = {name.casefold(): name for name in _names(whole.parent)}
    near = difflib.get_close_matches(wanted, by_key, 1, 0.85)
    if not near:
        return None
    found = whole.parent / by_key[near[0]]
    return os.path.relpath(found, base) if found.is_relative_to(base) else str(found)


def _names(folder: Path) -> list[str]:
    try:
        with os.scandir(folder) as entries:
            return [entry.name for entry in islice(entries, MAX_LISTED)]
    except OSError:
        return []
