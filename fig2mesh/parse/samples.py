"""Samples of pictures, decoded by Pillow or libvips: which channels they are, and which value is white.

Both give bands of rows, so that a window of a large picture takes the memory of the window.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fig2mesh.parse.profiles import BANDS, Kind, SourceColours, to_bytes, to_srgb
from fig2mesh.records import ByteArray
from fig2mesh.system.libvips import libvips
from georef.untrusted.image_file import pillow
from georef.untrusted.picture_header import PictureHeader

Box = tuple[int, int, int, int]

BAND_PX: Final = 512
"""Rows decoded and converted at a time."""

PHOTOMETRIC: Final[dict[int, Kind]] = {0: "grey", 1: "grey", 2: "rgb", 3: "rgb", 5: "cmyk", 6: "rgb", 8: "lab"}
"""Kinds of samples by the tag of a TIFF; palettes and YCbCr are decoded to RGB."""

PHOTOMETRIC_TAG, EXTRA_SAMPLES, MAX_SAMPLE, SAMPLE_FORMAT, BITS, COMPRESSION = 262, 338, 281, 339, 258, 259
ASSOCIATED, UNASSOCIATED, SIGNED = 1, 2, 2
YCBCR, LAB, JPEGS = 6, 8, (6, 7)

WHITES_16: Final = (255, 1023, 4095, 65535)
"""Values of white of 16-bit samples: some programs put 8, 10 and 12 bits into them as they are."""

MAX_UNIT_FLOAT: Final = 2.0
"""Largest sample of floats from 0 to 1: sharpening overshoots, and a picture from 0 to 255 has brighter ones."""

MAX_BYTE_FLOAT: Final = 260.0
"""The same of floats from 0 to 255."""


@dataclass(frozen=True)
class Samples:
    """Samples of a picture, or of a window of it.

    size : width and height; kind : of its colours
    read : (top, bottom) → (H, W, N) colours, and (H, W) alpha, straight, or None; in the file's own type, from the top
        down, each row once
    white : value of white, and of opaque; notes : remarks, one line each
    """

    size: tuple[int, int]
    kind: Kind
    read: Callable[[int, int], tuple[NDArray[Any], NDArray[Any] | None]]
    white: float = 255.0
    notes: tuple[str, ...] = ()


def to_rgba(samples: Samples, source: SourceColours) -> ByteArray:
    """(H, W, 4) uint8 sRGB with straight alpha."""
    width, height = samples.size
    rgba = np.empty((height, width, 4), np.uint8)
    for top, bottom in bands(height):
        colours, alpha = samples.read(top, bottom)
        deep = colours.dtype != np.uint8 or samples.white != 255
        if samples.kind == "lab":
            rgba[top:bottom, :, :3] = to_srgb(colours, source)
        else:
            rgba[top:bottom, :, :3] = to_srgb(_scaled(colours, samples.white) if deep else colours, source)
        if alpha is None:
            rgba[top:bottom, :, 3] = 255
        else:
            rgba[top:bottom, :, 3] = alpha if alpha.dtype == np.uint8 else to_bytes(_scaled(alpha, samples.white))
    return rgba


def bands(height: int) -> Iterator[tuple[int, int]]:
    for top in range(0, height, BAND_PX):
        yield top, min(top + BAND_PX, height)


def _scaled(values: NDArray[Any], white: float) -> NDArray[np.uint16]:
    """Samples as 16 bits; NaN becomes 0."""
    if values.dtype == np.uint16 and white == 65535:
        return values
    finite = np.nan_to_num(values.astype(np.float64), nan=0.0, posinf=white, neginf=0.0)
    return np.rint(np.clip(finite * (65535.0 / white), 0, 65535)).astype(np.uint16)


def white_of(dtype: np.dtype[Any], brightest: float, stated: float | None = None) -> tuple[float, str | None]:
    """Value of white of samples of a type, and a remark where it had to be inferred from the brightest sample.

    stated : MaxSampleValue of a TIFF
    """
    if dtype == np.uint8:
        return 255.0, None
    full = 1.0 if dtype.kind == "f" else float(np.iinfo(dtype).max)
    if stated is not None and brightest <= stated < full and dtype.kind != "f":
        return float(stated), None
    if dtype.kind == "f":
        if brightest <= MAX_UNIT_FLOAT:
            return 1.0, None
        white = 255.0 if brightest <= MAX_BYTE_FLOAT else 65535.0
    else:
        white = next((float(white) for white in WHITES_16 if brightest <= white and dtype.itemsize > 1), full)
        white = full if dtype.kind == "i" and dtype.itemsize == 2 and brightest > WHITES_16[-2] else min(white, full)
    return white, None if white == full else f"samples up to {brightest:g}: {white:g} is taken for white"


def of_pillow(image: Image.Image) -> Samples:
    """Samples of a picture that Pillow has decoded. Raises DamagedFile."""
    width, height = image.size
    mode = image.mode
    if mode.startswith(("I", "F")):
        brightest = max((_brightest(_crop(image, top, bottom)) for top, bottom in bands(height)), default=0.0)
        white, note = white_of(_crop(image, 0, 1).dtype, brightest)
        notes = () if note is None else (note,)
        return Samples((width, height), "grey", lambda *rows: (_crop(image, *rows), None), white, notes)
    if mode == "CMYK":
        return Samples((width, height), "cmyk", lambda *rows: (_crop(image, *rows), None))
    if mode == "LAB":
        return Samples((width, height), "lab", lambda *rows: (_lab(_crop(image, *rows)), None))
    grey = mode in ("1", "L", "LA", "La")
    wanted = ("LA" if grey else "RGBA") if image.has_transparency_data else ("L" if grey else "RGB")

    def read(top: int, bottom: int) -> tuple[NDArray[Any], NDArray[Any] | None]:
        values = _crop(image, top, bottom, wanted)
        return (values[..., :-1], values[..., -1]) if wanted.endswith("A") else (values, None)

    return Samples((width, height), "grey" if grey else "rgb", read)


def _crop(image: Image.Image, top: int, bottom: int, mode: str | None = None) -> NDArray[Any]:
    """(H, W, N) rows of a picture, in another mode."""
    with pillow():
        band = image.crop((0, top, image.width, bottom))
        values = np.asarray(band if mode in (None, band.mode) else band.convert(mode))
    return values if values.ndim == 3 else values[..., None]


def _lab(values: NDArray[Any]) -> NDArray[Any]:
    """L from 0 to 100, a and b from Pillow's bytes, which are signed."""
    return np.concatenate([values[..., :1] * (100 / 255), values[..., 1:].astype(np.int8).astype(np.float64)], axis=2)


def _brightest(values: NDArray[Any]) -> float:
    if values.dtype.kind == "f":
        values = values[np.isfinite(values)]
    return float(values.max(initial=0))


def of_vips(path: Path, header: PictureHeader, box: Box | None = None) -> Samples:
    """Samples of a window of a file that libvips decodes.

    Raises pyvips.Error for files that it cannot read.
    """
    image = open_vips(path, header)
    x0, y0, x1, y1 = box or (0, 0, image.width, image.height)
    kind, alpha = _channels(image, header)
    read = _reader(image, (x0, y0, x1, y1), kind, alpha)
    if image.interpretation == "labs":
        return Samples(
            (x1 - x0, y1 - y0), "lab", lambda *rows: (read(*rows)[0] * (100 / 32767, 1 / 256, 1 / 256), None)
        )
    samples = Samples((x1 - x0, y1 - y0), kind, read)
    if image.format == "uchar":
        return samples
    # Of the whole picture, so that a window of it has the same white.
    whole = open_vips(path, header)
    every = _reader(whole, (0, 0, whole.width, whole.height), kind, alpha)
    brightest, darkest, dtype = 0.0, 0.0, np.dtype(np.uint8)
    for rows in bands(whole.height):
        for values in every(*rows):
            if values is not None:
                brightest, dtype = max(brightest, _brightest(values)), values.dtype
                darkest = min(darkest, 0.0 if dtype.kind == "u" else -_brightest(-values.astype(np.float64)))
    stated = header.tags.get(MAX_SAMPLE, ())
    white, note = white_of(dtype, brightest, max(stated) if stated and not isinstance(stated, str | bytes) else None)
    black = f"samples down to {darkest:g}: negative ones are black" if darkest < 0 else None
    return replace(samples, white=white, notes=tuple(each for each in (note, black) if each))


def open_vips(path: Path, header: PictureHeader) -> Any:
    """Open a file with libvips, the page of its header; rows can be read from the top down, tiles in any order."""
    pyvips = libvips()
    options: dict[str, Any] = {"fail_on": "error" if header.tiff is not None else "truncated"}
    if header.tiff is not None:
        options["page"] = header.tiff.index
        if header.tiff.subifd is not None:
            options["subifd"] = header.tiff.subifd
    head = pyvips.Image.new_from_file(str(path), access="sequential", **options)
    tiled = header.tiff is not None and bool(head.get_typeof("tile-width"))
    return pyvips.Image.new_from_file(str(path), access="random", **options) if tiled else head


def _channels(image: Any, header: PictureHeader) -> tuple[Kind, int | None]:
    """Kind of the colours of a picture, and the number of its channel of alpha."""
    if header.tiff is None:
        kind: Kind = "cmyk" if image.interpretation == "cmyk" else "rgb" if image.bands > 2 else "grey"
        return kind, BANDS[kind] if image.bands > BANDS[kind] else None
    photometric = next(iter(header.tags.get(PHOTOMETRIC_TAG, ())), 1)
    kind = PHOTOMETRIC.get(photometric, "grey")
    kind = "grey" if image.bands < BANDS[kind] else kind
    extra = header.tags.get(EXTRA_SAMPLES, ())
    alpha = next((n for n, value in enumerate(extra) if value in (ASSOCIATED, UNASSOCIATED)), None)
    alpha = None if alpha is None or BANDS[kind] + alpha >= image.bands else BANDS[kind] + alpha
    return kind, alpha


def _reader(
    image: Any, box: Box, kind: Kind, alpha: int | None
) -> Callable[[int, int], tuple[NDArray[Any], NDArray[Any] | None]]:
    pyvips = libvips()
    region = pyvips.Region.new(image)
    x0, y0, x1, _ = box
    dtype = np.dtype(VIPS_TYPES[image.format])

    def read(top: int, bottom: int) -> tuple[NDArray[Any], NDArray[Any] | None]:
        data = region.fetch(x0, y0 + top, x1 - x0, bottom - top)
        values = np.frombuffer(data, dtype).reshape(bottom - top, x1 - x0, image.bands)
        return values[..., : BANDS[kind]], None if alpha is None else values[..., alpha]

    return read


VIPS_TYPES: Final = {
    "uchar": "u1", "char": "i1", "ushort": "u2", "short": "i2", "uint": "u4", "int": "i4", "float": "f4",
    "double": "f8",
}  # fmt: skip


def pillow_only(header: PictureHeader) -> bool:
    """Whether libvips cannot read a TIFF, or reads it wrong: YCbCr without JPEG, Lab of 8 bits, samples of 12 bits."""
    tags = header.tags
    photometric = next(iter(tags.get(PHOTOMETRIC_TAG, ())), 1)
    compression = next(iter(tags.get(COMPRESSION, ())), 1)
    bits = next(iter(tags.get(BITS, ())), 8)
    return (photometric == YCBCR and compression not in JPEGS) or (photometric == LAB and bits == 8) or bits == 12
