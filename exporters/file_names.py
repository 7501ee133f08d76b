"""Names of files and folders that every file system can hold, made from names for people.

https://learn.microsoft.com/en-us/windows/win32/fileio/naming-a-file
https://www.unicode.org/reports/tr44/#Default_Ignorable_Code_Point
"""

from __future__ import annotations

import re
import unicodedata
from functools import lru_cache
from pathlib import PurePath
from typing import Final

MAX_NAME_CHARACTERS: Final = 60
"""Characters of a name. Windows and macOS allow 255 UTF-16 units for a file, Windows often 260 for a whole path."""

MAX_NAME_BYTES: Final = 180
"""Bytes of a name in UTF-8. Linux allows 255 for a file; numbers, levels and suffixes need the rest."""

DEVICES: Final = re.compile(r"(CON|PRN|AUX|NUL|CONIN|CONOUT|CLOCK|(COM|LPT)[0-9¹²³])", re.IGNORECASE)
"""Names of devices, which Windows does not accept as names of files, whatever their suffix."""

GENERIC: Final = re.compile(
    r"(images?|img|imgp|pictures?|pict?|photos?|figures?|fig|drawings?|scans?|scanned|bild|foto|untitled|unnamed|"
    r"input|output|out|page|file|download|screenshot|dscn?|dscf|cutout|crop|copy|tmp|temp)?[\W\d_]*",
    re.IGNORECASE,
)
"""Names of pictures and folders that say nothing about the figure, as cameras, scanners and programs give them."""

_INVISIBLE = re.compile(
    "[\u00ad\u034f\u061c\u115f\u1160\u17b4\u17b5\u180b-\u180f\u200b-\u200f\u202a-\u202e\u2060-\u206f\u3164"
    "\ufe00-\ufe0f\ufeff\uffa0\ufff0-\ufff8\U0001bca0-\U0001bca3\U0001d173-\U0001d17a\U000e0000-\U000e0fff]"
)
"""Characters without a shape: joiners, variation selectors, marks of direction. Some file systems ignore them."""


def safe_name(name: str, filler: str = "_") -> str:
    """Name of a file or folder for `name`; unchanged where it is one already.

    filler : of one or more characters that are not kept

    Letters, marks and digits of all scripts are kept, in their composed form (NFC), and so are symbols such as emoji,
    and `.`, `_` and `-` within the name. Characters without a shape are removed, so that an emoji that is joined from
    several becomes these. The result is not empty, does not begin with `.` or `-`, does not end with `.`, is not the
    name of a device of Windows, and has at most `MAX_NAME_CHARACTERS` and `MAX_NAME_BYTES`.
    """
    text = unicodedata.normalize("NFC", _INVISIBLE.sub("", name.encode("utf-8", "replace").decode()))
    text = _stripped(re.sub("\0+", lambda _: filler, _kept(text)))
    first, dot, rest = text.partition(".")
    if DEVICES.fullmatch(first):
        text = f"{first}_{dot}{rest}"
    return _stripped(_cut(text)) or "figure"


def name_key(name: str) -> str:
    """Key that is equal for names that some file system takes for the same: by case, or by composition of marks."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def figure_name(picture: PurePath) -> str:
    """Name for the figure of a picture: its stem, or the name of its folder where the stem says nothing.

    So `farmer.png` and `farmer/image.png` are both `farmer`, and `scans/IMG_0001.jpg` is `IMG_0001`.
    """
    folder = picture.parent.name
    if GENERIC.fullmatch(picture.stem) and folder not in ("", "..") and not GENERIC.fullmatch(folder):
        return folder
    return picture.stem


def _stripped(text: str) -> str:
    text = re.sub(r"^[.-]+|\.+$", "", text)
    # A mark at the beginning would be drawn over the separator of the path.
    return f"_{text}" if text and unicodedata.category(text[0])[0] == "M" else text


def _cut(text: str) -> str:
    """Beginning of a text that is short enough, not cut within a character and its marks."""
    end = min(len(text), MAX_NAME_CHARACTERS)
    while len(text[:end].encode()) > MAX_NAME_BYTES:
        end -= 1
    if end == len(text):
        return text
    while end and unicodedata.category(text[end])[0] == "M":
        end -= 1
    return text[: end or MAX_NAME_CHARACTERS // 2]


def _kept(text: str) -> str:
    return "".join(character if _is_kept(character) else "\0" for character in text)


@lru_cache(maxsize=4096)
def _is_kept(character: str) -> bool:
    if character.isascii():
        return character.isalnum() or character in "._-"
    kind = unicodedata.category(character)
    return kind[0] in "LMN" or kind in ("So", "Sk")
