"""Chunks of a PNG that say how its pixels are to be shown; read without decoding, also those behind the pixels.

https://www.w3.org/TR/png-3/
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from georef.untrusted.orientation import exif_orientation, profile_orientations, raw_profile, xmp_orientation

SIGNATURE = b"\x89PNG\r\n\x1a\n"

MAX_TEXT = 16 << 20
"""Limit of a chunk, and of an unpacked text; longer ones are skipped. Orientation stands in a few kilobytes."""

XMP = "XML:com.adobe.xmp"
RAW_PROFILE = "raw profile type "
ORIENTED = ("exif", "app1", "xmp")


@dataclass(frozen=True)
class PngFacts:
    """Facts of a PNG beyond its size.

    bits : per sample; colour_type : as in its header
    orientations : name and value of each source, in the order in which they decide
    profile : it has an iCCP chunk; srgb : it has an sRGB chunk; gamma : of gAMA; chromaticities : white, red, green and
    blue x, y of cHRM; cicp : code points
    """

    bits: int = 8
    colour_type: int = 2
    orientations: tuple[tuple[str, int | None], ...] = ()
    profile: bool = False
    srgb: bool = False
    gamma: float | None = None
    chromaticities: tuple[float, ...] | None = None
    cicp: tuple[int, ...] | None = None


def read_png(path: Path) -> PngFacts:
    """Facts of a PNG; what is damaged or too long states nothing."""
    chunks: dict[bytes, bytes] = {}
    exif: list[tuple[str, int | None]] = []
    raw: list[tuple[str, int | None]] = []
    xmp: list[tuple[str, int | None]] = []
    for name, body in _chunks(path):
        if name == b"eXIf":
            exif.append(("EXIF", exif_orientation(body)))
        elif name in (b"tEXt", b"zTXt", b"iTXt"):
            keyword, text = _text(name, body)
            if keyword == XMP:
                xmp.append(("XMP", xmp_orientation(text)))
            elif keyword.lower() in tuple(RAW_PROFILE + kind for kind in ORIENTED):
                for source, value in profile_orientations(keyword, raw_profile(text)):
                    (xmp if "XMP" in source else raw).append((source, value))
        else:
            chunks.setdefault(name, body)
    head = chunks.get(b"IHDR", b"").ljust(13, b"\0")
    gamma = _numbers(chunks.get(b"gAMA"), 1)
    return PngFacts(
        bits=head[8],
        colour_type=head[9],
        orientations=(*exif, *raw, *xmp),
        profile=b"iCCP" in chunks,
        srgb=b"sRGB" in chunks,
        gamma=gamma[0] if gamma and gamma[0] > 0 else None,
        chromaticities=_numbers(chunks.get(b"cHRM"), 8),
        cicp=tuple(chunks[b"cICP"][:4]) if len(chunks.get(b"cICP", b"")) == 4 else None,
    )


def _chunks(path: Path) -> Iterator[tuple[bytes, bytes]]:
    """Name and content of all chunks but those of pixels, up to the end or to the first damage."""
    with path.open("rb") as file:
        if file.read(8) != SIGNATURE:
            return
        while len(head := file.read(8)) == 8:
            length, name = struct.unpack(">I4s", head)
            if name == b"IEND":
                return
            wanted = name in (b"IHDR", b"eXIf", b"tEXt", b"zTXt", b"iTXt", b"iCCP", b"sRGB", b"gAMA", b"cHRM", b"cICP")
            if wanted and length <= MAX_TEXT:
                body = file.read(length)
                if len(body) < length:
                    return
                yield name, body
                file.seek(4, 1)
            else:
                file.seek(length + 4, 1)


def _text(name: bytes, body: bytes) -> tuple[str, bytes]:
    """Keyword and unpacked text of a text chunk."""
    keyword, _, rest = body.partition(b"\0")
    packed = name == b"zTXt"
    if name == b"zTXt":
        rest = rest[1:]
    elif name == b"iTXt":
        packed = rest[:1] == b"\1"
        rest = rest[2:].partition(b"\0")[2].partition(b"\0")[2]
    if packed:
        try:
            rest = zlib.decompressobj().decompress(rest, MAX_TEXT)
        except zlib.error:
            rest = b""
    return keyword.decode("latin-1"), rest


def _numbers(body: bytes | None, count: int) -> tuple[float, ...] | None:
    if body is None or len(body) != 4 * count:
        return None
    return tuple(value / 100_000 for value in struct.unpack(f">{count}I", body))
