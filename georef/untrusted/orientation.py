"""Orientation of a picture, wherever its file may state it.

Sources in the order in which they decide, as browsers, Pillow and the Metadata Working Group's guidelines have it:
the boxes of an AVIF, EXIF (its chunk or segment; tag 274 of a TIFF), EXIF as text of ImageMagick (`Raw profile type`),
XMP.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from georef.untrusted.damage import DamagedFile
from georef.untrusted.image_file import pillow

ORIENTATION = 274
"""EXIF and TIFF tag. Values: 1 upright, 2 to 8 mirrored or turned."""

XMP_HEAD = b"http://ns.adobe.com/xap/1.0/\0"
NAMESPACE = "http://ns.adobe.com/tiff/1.0/"

MAX_XMP = 4 << 20
"""Leading bytes of an XMP packet that are searched."""


def first_stated(stated: Iterable[tuple[str, int | None]]) -> tuple[int, str | None]:
    """Orientation of a picture, 1 to 8, and a remark in one line where sources contradict each other.

    stated : name and value of each source, in the order in which they decide; None: states nothing
    """
    valid = [(name, value) for name, value in stated if value is not None and 1 <= value <= 8]
    if not valid:
        return 1, None
    name, value = valid[0]
    others = [f"{other} {number}" for other, number in valid[1:] if number != value]
    return value, f"its orientation is {value} by {name}, but {', '.join(others)}; {name} counts" if others else None


def exif_orientation(data: bytes) -> int | None:
    """Orientation in EXIF data, with or without their leading "Exif"; None where they state none."""
    from PIL.Image import Exif

    exif = Exif()
    try:
        with pillow():
            exif.load(data)
            value = exif.get(ORIENTATION)
    except DamagedFile:
        return None
    return value if isinstance(value, int) else None


def xmp_orientation(data: bytes) -> int | None:
    """`tiff:Orientation` in an XMP packet, as attribute or as element, under any prefix; None where it has none.

    A search, as XMP needs no entities and a parser would expand them.
    """
    text = _text(data[:MAX_XMP])
    prefixes = re.findall(rf'xmlns:([\w.-]{{1,40}})\s*=\s*["\']{re.escape(NAMESPACE)}["\']', text)
    for prefix in dict.fromkeys(prefixes):
        name = f"{re.escape(prefix)}:Orientation"
        found = re.search(rf'(?<![\w:]){name}\s*=\s*["\']\s*(\d)\s*["\']|<{name}(?:\s[^<>]*)?>\s*(\d)\s*</', text)
        if found is not None:
            return int(found[1] or found[2])
    return None


def _text(data: bytes) -> str:
    for mark, encoding in ((b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be"), (b"<\0", "utf-16-le")):
        if data.startswith(mark):
            return data.decode(encoding, errors="replace")
    return data.decode("utf-16-be" if data.startswith(b"\0<") else "utf-8", errors="replace")


def raw_profile(text: bytes) -> bytes:
    """Content of a `Raw profile type` text of ImageMagick: a name, a length, and hexadecimal digits."""
    words = text.split()
    try:
        return bytes.fromhex(b"".join(words[2:]).decode("ascii"))
    except ValueError:
        return b""


def profile_orientations(name: str, data: bytes) -> Iterable[tuple[str, int | None]]:
    """Orientation in a raw profile; APP1 may hold EXIF or XMP."""
    if data.startswith(XMP_HEAD) or name.lower().endswith("xmp"):
        return [(f"{name} (XMP)", xmp_orientation(data.removeprefix(XMP_HEAD)))]
    return [(name, exif_orientation(data))]
