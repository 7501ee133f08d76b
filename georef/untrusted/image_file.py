"""Untrusted picture files: size, and test decoding at a cost that is known in advance.

A few kilobytes of PNG may decompress to gigabytes of pixels, so the header is checked before anything is decoded.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from georef.untrusted.damage import DamagedFile, parsing, reason_of

if TYPE_CHECKING:
    from PIL import Image

FORMATS = ("PNG", "JPEG", "WEBP", "AVIF", "GIF", "BMP", "TIFF")
"""Formats that models may embed or refer to. Pillow knows fifty more, some of which start other programs."""

MAX_TEXTURE_PX = 1 << 26
"""Limit of pixels of a decoded texture: 8192 x 8192, beyond which clients scale down or fail; 268 MB as RGBA."""

MAX_UNWEIGHED_SCANS, MAX_SCANNED_PX = 20, 1_000_000_000
"""Limits of progressive JPEGs. They have some ten scans over the whole picture; a few kilobytes with 10,000 empty
scans take hours. More scans than the first limit are allowed if scans times pixels are below the second."""


class TooLarge(DamagedFile):
    """A picture beyond the limits of decoding."""


class NotAPicture(DamagedFile):
    """A file in none of the supported picture formats."""


@contextmanager
def pillow() -> Iterator[None]:
    """Convert all exceptions of Pillow to DamagedFile; only its calls belong in the block.

    Errors of the disk pass through.
    """
    from PIL import Image, UnidentifiedImageError

    with parsing("damaged picture"), warnings.catch_warnings():
        # The limits here are explicit; Pillow's warning would only repeat them.
        warnings.simplefilter("ignore")
        try:
            yield
        except Image.DecompressionBombError as error:
            raise TooLarge(f"more than {2e-6 * (Image.MAX_IMAGE_PIXELS or 0):.0f} Mpx") from error
        except UnidentifiedImageError as error:
            raise NotAPicture("not a readable picture") from error


def open_header(source: bytes | Path, formats: tuple[str, ...] = FORMATS) -> Image.Image:
    """Open a picture, reading only its header.

    Raises NotAPicture for files in none of `formats`, TooLarge beyond Pillow's own limit, DamagedFile for a damaged
    header and OSError for a file that cannot be read.
    """
    from PIL import Image

    with pillow():
        return Image.open(io.BytesIO(source) if isinstance(source, bytes) else source, formats=formats)


@contextmanager
def open_any_size(path: Path, formats: tuple[str, ...]) -> Iterator[Image.Image]:
    """Open a picture of any number of pixels, reading only its header; `Image.open` refuses large ones.

    Raises NotAPicture for files in none of `formats`, DamagedFile for a damaged header.
    """
    # The plugins register themselves; `Image.init` would import thirty more.
    from PIL import AvifImagePlugin, Image, Jpeg2KImagePlugin, TiffImagePlugin, WebPImagePlugin  # noqa: F401

    Image.preinit()
    with path.open("rb") as file:
        head = file.read(16)
        reason: Exception | None = None
        for name in formats:
            factory, accept = Image.OPEN[name]
            accepted = accept is None or accept(head)
            if not accepted or isinstance(accepted, str):
                continue
            file.seek(0)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    image = factory(file, str(path))
            except Exception as error:  # parsers raise all kinds of exceptions for damaged headers
                reason = error
                continue
            yield image
            return
    if reason is None:
        raise NotAPicture("not a readable picture")
    raise DamagedFile(f"damaged picture ({reason_of(reason, 80)})")


def picture_size(data: bytes) -> tuple[int, int]:
    """Width and height of a picture. Raises DamagedFile."""
    with open_header(data) as image:
        return image.width, image.height


def check_scans(image: Image.Image, data: bytes) -> None:
    """Raise TooLarge for a progressive JPEG with too many scans to decode.

    image : opened by Pillow; data : the file
    """
    if image.format not in ("JPEG", "MPO") or "progressive" not in image.info:
        return
    # Within the data of a scan ff is followed by 00 or a restart marker, so each ff da begins a scan.
    scans = data.count(b"\xff\xda")
    if scans > MAX_UNWEIGHED_SCANS and scans * image.width * image.height > MAX_SCANNED_PX:
        raise TooLarge(f"a progressive JPEG of {scans} scans over {image.width} x {image.height} px")


def check_cost(image: Image.Image, data: bytes) -> None:
    """Raise TooLarge for a texture of more than `MAX_TEXTURE_PX`, or of too many scans.

    image : opened by Pillow; data : the file
    """
    if image.width * image.height > MAX_TEXTURE_PX:
        raise TooLarge(f"{image.width} x {image.height} px, more than {MAX_TEXTURE_PX / 1e6:.0f} million")
    check_scans(image, data)


def check_header(data: bytes) -> None:
    """Raise DamagedFile for a texture with a damaged header or too many pixels, before another program reads it."""
    with open_header(data) as image:
        check_cost(image, data)


def check_texture(data: bytes) -> int:
    """Decode a texture; returns its number of pixels. Raises TooLarge as `check_cost`, DamagedFile if damaged."""
    with open_header(data) as image:
        check_cost(image, data)
        with pillow():
            image.load()
        return image.width * image.height
