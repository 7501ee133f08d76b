"""Texture files inside of models: their size, and whether they can be decoded, at a price that is known before.

A few kilobytes of PNG may unpack to gigabytes of pixels, so nothing is decoded before its head has said how many.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from exporters.gltf.ktx2 import IDENTIFIER, size_of

if TYPE_CHECKING:
    from PIL import Image

FORMATS = ("PNG", "JPEG", "WEBP", "AVIF", "GIF", "BMP", "TIFF")
"""What models may embed or name. Pillow knows fifty more, some of which start other programs."""

MAX_TEXTURE_PX = 1 << 26
"""Pixels of a texture that is decoded: 8192 x 8192, beyond which clients scale down or fail; 268 MB as RGBA."""


FEW_SCANS, MAX_SCANNED_PX = 20, 1_000_000_000
"""A progressive JPEG comes in some ten scans over the whole picture; one of ten thousand empty ones is a few
kilobytes that take hours. More than the first are allowed where scans times pixels are below the second."""


class TooLarge(ValueError):
    """A picture of more pixels than are decoded."""


@contextmanager
def opened(data: bytes) -> Iterator[Image.Image]:
    """A picture of which only the head is read. Raises ValueError for what is none of `FORMATS`, or damaged."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            # The limits here are explicit; Pillow's warning would only repeat them.
            warnings.simplefilter("ignore")
            image = Image.open(io.BytesIO(data), formats=FORMATS)
    except Exception as error:  # parsers of damaged heads raise whatever they stumble over
        raise ValueError(f"no picture that can be read ({type(error).__name__})") from error
    with image:
        yield image


def texture_size(data: bytes) -> list[int]:
    """Width and height of an image file, also of KTX 2. Raises ValueError where they cannot be told."""
    if data.startswith(IDENTIFIER):
        return list(size_of(data))
    with opened(data) as image:
        return [image.width, image.height]


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


def check_texture(data: bytes) -> int:
    """Decode a picture and say how many pixels it has.

    Raises TooLarge for more than `MAX_TEXTURE_PX`, ValueError where it cannot be decoded.
    """
    with opened(data) as image:
        count = image.width * image.height
        if count > MAX_TEXTURE_PX:
            raise TooLarge(f"{image.width} x {image.height} px are more than {MAX_TEXTURE_PX / 1e6:.0f} million")
        check_scans(image, data)
        try:
            image.load()
        except Exception as error:  # as above
            reason = " ".join(str(error).split())[:80] or type(error).__name__
            raise ValueError(f"a damaged picture ({reason})") from error
        return count
