"""Reading part of a picture, without decoding the rest into memory: scans of maps have hundreds of megapixels.

libvips streams rows past the window (JPEG, PNG, WebP) or reads the tiles that it touches (tiled TIFF).
https://www.libvips.org/API/current/how-it-opens-files.html
"""

from __future__ import annotations

from pathlib import Path

from fig2mesh.errors import FigureError
from fig2mesh.parse.profiles import SourceColours, source_colours
from fig2mesh.parse.samples import Box, Samples, of_vips, open_vips, pillow_only, to_rgba
from fig2mesh.records import ByteArray
from fig2mesh.system.libvips import libvips
from georef.untrusted.damage import DamagedFile
from georef.untrusted.picture_header import PictureHeader, read_header

LARGE_PX = 16_000_000
"""Threshold, pixels; smaller pictures are read whole, so that almost all take one path."""

MAX_PIXELS = 178_956_970
"""Limit for pictures decoded whole, twice Pillow's warning level: 1.5 GB with what is derived from them."""

MAX_PIXELS_PER_BYTE = 1000
"""Limit for larger pictures; a decompression bomb has more. Black and white scans have 200, nearly empty JPEGs 80."""

STREAMED = ("PNG", "JPEG", "MPO", "TIFF", "WEBP", "AVIF", "GIF")
"""Formats that libvips reads as well."""


def is_large(path: Path) -> bool:
    """Whether a picture is worth reading in part, and can be: not where it must be turned, or its header is damaged."""
    try:
        header = read_header(path)
    except (DamagedFile, OSError):  # reading it whole reports the error
        return False
    width, height = header.size
    streamed = header.format in STREAMED and not (header.format == "TIFF" and pillow_only(header))
    return streamed and width * height > LARGE_PX and header.orientation == 1


def read_window(path: Path, bbox: Box, colours: bool = True) -> tuple[ByteArray, tuple[int, int]]:
    """Read the pixels of a window, and the size of the whole picture.

    bbox : x0, y0, x1, y1 in IMAGE pixels, x1 and y1 exclusive; colours : as of `read_rgba`
    returns : (y1 - y0, x1 - x0, 4) uint8, straight alpha, sRGB; (width, height)

    Memory is that of the window and some rows. Raises FigureError for a window that is not inside, and for files that
    cannot be read.
    """
    header = _header(path)
    pixels, _ = read_window_of(path, header, bbox, colours)
    return pixels, header.size


def read_window_of(
    path: Path, header: PictureHeader, bbox: Box, colours: bool = True
) -> tuple[ByteArray, tuple[str, ...]]:
    """Read the pixels of a window as `read_window` does; and remarks about the picture, one line each."""
    pyvips = libvips()
    x0, y0, x1, y1 = bbox
    size = header.size
    if not (0 <= x0 < x1 <= size[0] and 0 <= y0 < y1 <= size[1]):
        found = f"{x0} {y0} {x1} {y1} is not inside {size[0]}×{size[1]} px"
        raise FigureError("--bbox", found, "give X0 Y0 X1 Y1")
    if (area := (x1 - x0) * (y1 - y0)) > MAX_PIXELS:
        found = f"a window of {area / 1e6:.0f} Mpx, more than {MAX_PIXELS / 1e6:.0f} Mpx"
        raise FigureError("--bbox", found, "give one round the figure")
    intact = "give an intact PNG, JPEG, TIFF or WebP"
    try:
        interlaced = bool(open_vips(path, header).get_typeof("interlaced"))
        _check_cost(path, size, interlaced)
        samples = of_vips(path, header, bbox)
        return rgba_of(samples, header, colours)
    except pyvips.Error as error:
        reason = str(error).strip().split("\n")[0][:100]
        raise FigureError(path, f"cannot be read ({reason})", intact) from None
    except DamagedFile as error:
        raise FigureError(path, f"cannot be read ({error})", intact) from None


def rgba_of(samples: Samples, header: PictureHeader, colours: bool) -> tuple[ByteArray, tuple[str, ...]]:
    """(H, W, 4) uint8 of samples, and remarks; colours : convert them to sRGB by the picture's profile."""
    source = source_colours(header, samples.kind) if colours else SourceColours(samples.kind)
    return to_rgba(samples, source), (*header.notes, *samples.notes, *source.notes)


def size_of(path: Path) -> tuple[int, int]:
    """(width, height) of a picture of any size, upright; decodes nothing. Raises FigureError."""
    return _header(path).upright_size


def _header(path: Path) -> PictureHeader:
    try:
        return read_header(path)
    except DamagedFile as error:
        raise FigureError(path, f"cannot be read ({error})", "give an intact PNG, JPEG, TIFF or WebP") from None
    except OSError as error:
        raise FigureError(path, f"cannot be read ({error.strerror})", "check the path") from None


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
