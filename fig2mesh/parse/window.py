"""Reading part of a picture, without decoding the rest into memory: scans of maps have hundreds of megapixels.

libvips streams rows past the window (JPEG, PNG, WebP) or reads the tiles that it touches (tiled TIFF).
https://www.libvips.org/API/current/how-it-opens-files.html
"""

from __future__ import annotations

import logging
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from fig2mesh.errors import FigureError
from fig2mesh.records import ByteArray
from georef.sheets.pictures import orientation_of

LARGE_PX = 16_000_000
"""Threshold, pixels; smaller pictures are read whole, so that almost all take one path."""

MAX_PIXELS = 178_956_970
"""Limit for pictures decoded whole, twice Pillow's warning level: 1.5 GB with what is derived from them."""

MAX_PIXELS_PER_BYTE = 1000
"""Limit for larger pictures; a decompression bomb has more. Black and white scans have 200, nearly empty JPEGs 80."""

FORMATS = ("PNG", "JPEG", "TIFF", "WEBP", "AVIF", "JPEG2000", "GIF", "BMP", "PPM")
"""Formats of drawings and scans. Pillow knows forty more, one of which starts another program (EPS)."""

STREAMED = ("PNG", "JPEG", "MPO", "TIFF", "WEBP", "AVIF", "GIF")
"""Those of them that libvips reads as well."""


def is_large(path: Path) -> bool:
    """Whether a picture is worth reading in part, and can be: not where it must be turned, or its header is damaged."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(path, formats=FORMATS)
        with image:
            upright = orientation_of(image) == 1
            return image.format in STREAMED and image.width * image.height > LARGE_PX and upright
    except Image.DecompressionBombError:
        return True
    except Exception:  # whatever a damaged header raises; reading it whole reports the error
        return False


def read_window(path: Path, bbox: tuple[int, int, int, int]) -> tuple[ByteArray, tuple[int, int]]:
    """Read the pixels of a window, and the size of the whole picture.

    bbox : x0, y0, x1, y1 in IMAGE pixels, x1 and y1 exclusive
    returns : (y1 - y0, x1 - x0, 4) uint8, straight alpha, sRGB; (width, height)

    Memory is that of the window and some rows. Raises FigureError for a window that is not inside, and for files that
    cannot be read.
    """
    pyvips = _libvips()
    x0, y0, x1, y1 = bbox
    try:
        head = pyvips.Image.new_from_file(str(path), access="sequential", fail_on="truncated")
        size = (int(head.width), int(head.height))
        if not (0 <= x0 < x1 <= size[0] and 0 <= y0 < y1 <= size[1]):
            found = f"{x0} {y0} {x1} {y1} is not inside {size[0]}×{size[1]} px"
            raise FigureError("--bbox", found, "give X0 Y0 X1 Y1")
        if (area := (x1 - x0) * (y1 - y0)) > MAX_PIXELS:
            found = f"a window of {area / 1e6:.0f} Mpx, more than {MAX_PIXELS / 1e6:.0f} Mpx"
            raise FigureError("--bbox", found, "give one round the figure")
        _check_cost(path, size, bool(head.get_typeof("interlaced")))
        # Tiles can be read in any order; of other files only the rows down to the window are decoded, once.
        image = pyvips.Image.new_from_file(str(path), access="random", fail_on="truncated") if _tiled(head) else head
        window = image.crop(x0, y0, x1 - x0, y1 - y0)
        if window.interpretation not in ("srgb", "rgb"):
            window = window.colourspace("srgb")
        if window.format == "ushort":
            window = window / 257.0
        if window.bands == 3:
            window = window.addalpha()
        pixels = np.asarray(window.cast("uchar").numpy())
    except pyvips.Error as error:
        reason = str(error).strip().split("\n")[0][:100]
        raise FigureError(path, f"cannot be read ({reason})", "give an intact PNG, JPEG, TIFF or WebP") from None
    if pixels.ndim != 3 or pixels.shape[2] != 4:
        raise FigureError(path, f"{head.bands} bands of colour", "give a grey or RGB picture")
    return pixels, size


def size_of(path: Path) -> tuple[int, int]:
    """(width, height) of a picture of any size; decodes nothing. Raises FigureError."""
    pyvips = _libvips()
    try:
        head = pyvips.Image.new_from_file(str(path), access="sequential")
    except pyvips.Error:
        raise FigureError(path, "not a picture that can be read", "give a PNG, JPEG, TIFF or WebP") from None
    return int(head.width), int(head.height)


def _libvips() -> Any:
    """The library, with decoders that are unsafe for untrusted files disabled (SVG, PDF, ImageMagick's)."""
    import pyvips

    # The log of libvips only repeats its errors.
    logging.getLogger("pyvips").setLevel(logging.ERROR)
    pyvips.block_untrusted_set(True)
    # Its cache is keyed by file names: it would return the old content of a file that was written again.
    pyvips.cache_set_max(0)
    return pyvips


def _check_cost(path: Path, size: tuple[int, int], interlaced: bool) -> None:
    """Raise FigureError for a picture in which reading a window costs more than its file's size suggests."""
    pixels = size[0] * size[1]
    if pixels <= MAX_PIXELS:
        return
    if interlaced:
        found = f"{size[0]}×{size[1]} px, interlaced or progressive: it would have to be decoded whole"
        raise FigureError(path, found, "save it again without, or cut the figure out")
    if pixels > MAX_PIXELS_PER_BYTE * (bytes_ := path.stat().st_size):
        found = f"{size[0]}×{size[1]} px in {bytes_ / 1e3:.0f} kB"
        raise FigureError(path, found, "cut the figure out, or give an intact picture")


def _tiled(image: object) -> bool:
    """Whether a file is tiled; known for TIFF only."""
    loader = image.get("vips-loader")  # type: ignore[attr-defined]
    return bool(str(loader).startswith("tiff") and image.get_typeof("tile-width"))  # type: ignore[attr-defined]
