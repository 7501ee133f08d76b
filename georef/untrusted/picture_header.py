"""Header of a picture file: the one answer to its size, orientation, page and colour space, for all readers.

Nothing is decoded, so pictures may have any size.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from georef.untrusted.damage import DamagedFile
from georef.untrusted.image_file import NotAPicture, open_any_size, pillow
from georef.untrusted.orientation import ORIENTATION, exif_orientation, first_stated, xmp_orientation
from georef.untrusted.png_chunks import PngFacts, read_png
from georef.untrusted.tiff_pages import TiffPage, main_page

if TYPE_CHECKING:
    from PIL import Image

FORMATS = ("PNG", "JPEG", "TIFF", "WEBP", "AVIF", "JPEG2000", "GIF", "BMP", "PPM")
"""Formats of drawings and scans. Pillow knows forty more, one of which starts another program (EPS)."""

XMP_TAG, PROFILE_TAG = 700, 34675
EXIF_WIDTH, EXIF_HEIGHT = 40962, 40963


@dataclass(frozen=True)
class PictureHeader:
    """Header of a picture.

    format : as Pillow names it; size : width and height as stored, px; mode : Pillow's, empty for a TIFF
    orientation : 1 to 8 as in EXIF, 1 is upright
    profile : ICC profile, None without; png, tiff : facts of these formats
    original : width and height that EXIF states, px, which programs that resize a picture tend to leave as they were
    frames : of an animation; tags : of a TIFF's page
    notes : remarks of one line each, about what the file contradicts itself in or holds besides
    """

    format: str
    size: tuple[int, int]
    mode: str = ""
    orientation: int = 1
    profile: bytes | None = None
    png: PngFacts | None = None
    tiff: TiffPage | None = None
    original: tuple[int, int] | None = None
    frames: int = 1
    notes: tuple[str, ...] = ()
    tags: dict[int, Any] = field(default_factory=dict)

    @property
    def upright_size(self) -> tuple[int, int]:
        """Width and height of the picture as it is shown, px."""
        return self.size if self.orientation < 5 else self.size[::-1]


def read_header(path: Path) -> PictureHeader:
    """Read the header of a picture.

    Raises NotAPicture for files in none of `FORMATS`, DamagedFile for damaged headers, OSError where it cannot be read.
    """
    with path.open("rb") as file:
        head = file.read(16)
    if head[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return _tiff_header(main_page(path))
    if not head:
        raise NotAPicture("an empty file")
    with open_any_size(path, FORMATS) as image:
        return _header(path, image)


def _tiff_header(page: TiffPage) -> PictureHeader:
    stated = [
        ("EXIF", next(iter(page.tags.get(ORIENTATION, ())), None)),
        ("XMP", xmp_orientation(_bytes(page.tags.get(XMP_TAG)))),
    ]
    orientation, contradiction = first_stated(stated)
    more = f"it holds {page.others + 1} pictures; the first is read" if page.others else None
    profile = _bytes(page.tags.get(PROFILE_TAG)) or None
    notes = tuple(note for note in (contradiction, more) if note)
    return PictureHeader(
        "TIFF", page.size, orientation=orientation, profile=profile, tiff=page, notes=notes, tags=page.tags
    )


def _header(path: Path, image: Image.Image) -> PictureHeader:
    png = read_png(path) if image.format == "PNG" else None
    info = image.info
    exif = info.get("exif") or b""
    if png is None:
        xmp = info.get("xmp") or b""
        # The boxes of an AVIF decide, also by their absence; Pillow gives what they state as EXIF.
        boxes = image.format == "AVIF"
        own = exif_orientation(exif) if exif else None
        stated = [
            ("its boxes", own or 1) if boxes else ("EXIF", own),
            ("XMP", xmp_orientation(xmp.encode() if isinstance(xmp, str) else xmp)),
        ]
    else:
        stated = list(png.orientations)
    orientation, contradiction = first_stated(stated)
    with pillow():
        frames = 1 if image.format == "MPO" else int(getattr(image, "n_frames", 1))
    more = f"it holds {frames} frames; the first is read" if frames > 1 else None
    return PictureHeader(
        str(image.format),
        (int(image.size[0]), int(image.size[1])),
        mode=image.mode,
        orientation=orientation,
        profile=info.get("icc_profile") or None,
        png=png,
        original=_original_size(exif),
        frames=frames,
        notes=tuple(note for note in (contradiction, more) if note),
    )


def _original_size(data: bytes) -> tuple[int, int] | None:
    """Width and height in EXIF data, px."""
    from PIL.ExifTags import IFD
    from PIL.Image import Exif

    if not data:
        return None
    exif = Exif()
    try:
        with pillow():
            exif.load(data)
            inner = exif.get_ifd(IFD.Exif)
    except DamagedFile:
        return None
    width, height = inner.get(EXIF_WIDTH), inner.get(EXIF_HEIGHT)
    if not (isinstance(width, int) and isinstance(height, int) and min(width, height) > 0):
        return None
    return width, height


def _bytes(value: Any) -> bytes:
    """Value of a tag of bytes."""
    if isinstance(value, tuple) and len(value) == 1 and isinstance(value[0], bytes):
        return value[0]
    if isinstance(value, tuple) and all(isinstance(number, int) and 0 <= number < 256 for number in value):
        return bytes(value)
    return value if isinstance(value, bytes) else b""
