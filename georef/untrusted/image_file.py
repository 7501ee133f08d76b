"""Picture files from elsewhere: their size, and whether they can be decoded, at a price that is known before.

A few kilobytes of PNG may unpack to gigabytes of pixels, so nothing is decoded before its head has said how many.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from georef.untrusted.damage import DamagedFile, reason_of

if TYPE_CHECKING:
    from PIL import Image

FORMATS = ("PNG", "JPEG", "WEBP", "AVIF", "GIF", "BMP", "TIFF")
"""What models may embed or name. Pillow knows fifty more, some of which start other programs."""

MAX_TEXTURE_PX = 1 << 26
"""Pixels of a texture that is decoded: 8192 x 8192, beyond which clients scale down or fail; 268 MB as RGBA."""

FEW_SCANS, MAX_SCANNED_PX = 20, 1_000_000_000
"""A progressive JPEG comes in some ten scans over the whole picture; one of ten thousand empty ones is a few
kilobytes that take hours. More than the first are allowed where scans times pixels are below the second."""


class TooLarge(DamagedFile):
    """A picture of more pixels than are decoded."""


class NoPicture(DamagedFile):
    """A file that begins like no picture of the formats that are read."""


@contextmanager
def pillow() -> Iterator[None]:
    """Make DamagedFile of all that Pillow raises; only its calls belong into the block.

    Parsers of damaged pictures raise whatever they stumble over. Errors of the disk go through.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            # The limits here are explicit; Pillow's warning would only repeat them.
            warnings.simplefilter("ignore")
            yield
    except Image.DecompressionBombError as error:
        raise TooLarge(f"more than {2e-6 * (Image.MAX_IMAGE_PIXELS or 0):.0f} Mpx") from error
    except UnidentifiedImageError as error:
        raise NoPicture("no picture that can be read") from error
    except OSError as error:
        if error.strerror:
            raise
        raise DamagedFile(f"a damaged picture ({reason_of(error, 80)})") from error
    except Exception as error:
        raise DamagedFile(f"a damaged picture ({reason_of(error, 80)})") from error


def open_head(source: bytes | Path, formats: tuple[str, ...] = FORMATS) -> Image.Image:
    """A picture of which only the head is read.

    Raises NoPicture for what is none of `formats`, TooLarge where Pillow opens none of that size, DamagedFile for a
    damaged head and OSError for a file that cannot be read.
    """
    from PIL import Image

    with pillow():
        return Image.open(io.BytesIO(source) if isinstance(source, bytes) else source, formats=formats)


def picture_size(data: bytes) -> tuple[int, int]:
    """Width and height of a picture. Raises DamagedFile."""
    with open_head(data) as image:
        return image.width, image.height


def check_scans(image: Image.Image, data: bytes) -> None:
    """Raise TooLarge for a progressive JPEG of so many scans that decoding it would never end.

    image : its head, as Pillow has read it; data : the file
    """
    if image.format not in ("JPEG", "MPO") or "progressive" not in image.info:
        return
    # Within the data of a scan ff is followed by 00 or a restart marker: each ff da begins one.
    scans = data.count(b"\xff\xda")
    if scans > FEW_SCANS and scans * image.width * image.height > MAX_SCANNED_PX:
        raise TooLarge(f"a progressive JPEG of {scans} scans over {image.width} x {image.height} px")


def check_cost(image: Image.Image, data: bytes) -> None:
    """Raise TooLarge for a texture of more than `MAX_TEXTURE_PX`, or of too many scans.

    image : its head; data : the file
    """
    if image.width * image.height > MAX_TEXTURE_PX:
        raise TooLarge(f"{image.width} x {image.height} px are more than {MAX_TEXTURE_PX / 1e6:.0f} million")
    check_scans(image, data)


def check_head(data: bytes) -> None:
    """Raise DamagedFile for a texture that no other program should be given: damaged at its head, or too large."""
    with open_head(data) as image:
        check_cost(image, data)


def check_texture(data: bytes) -> int:
    """Decode a texture and say how many pixels it has. Raises TooLarge as `check_cost`, DamagedFile if damaged."""
    with open_head(data) as image:
        check_cost(image, data)
        with pillow():
            image.load()
        return image.width * image.height
