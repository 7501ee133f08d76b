"""Page of a TIFF that is the picture: neither a thumbnail, nor an overview, nor a mask.

Thumbnails come first in files of some scanners and cameras, and overviews after the picture in those of GDAL.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from georef.untrusted.damage import DamagedFile, parsing

NEW_SUBFILE_TYPE, SUBFILE_TYPE = 254, 255
REDUCED, MASK = 1, 4

MAX_PAGES = 1000
"""Limit of pages that are looked at."""

MAX_VALUES, MAX_BYTES = 100_000, 16 << 20
"""Limits of values of a tag, and of bytes in a profile or packet; strips and tiles, which may be more, are left out."""

BLOBS = frozenset((700, 34675))
"""Tags of an XMP packet and of an ICC profile."""

LISTS = frozenset((273, 279, 324, 325, 513, 514, 519, 520, 521))
"""Tags of offsets and lengths of strips, tiles and tables of JPEGs."""


@dataclass(frozen=True)
class TiffPage:
    """Page of a TIFF.

    size : px; index : among the file's pages; subifd : index below that page, None for the page itself
    tags : values by code, numbers as tuples; others : number of further pages that are pictures of their own
    """

    size: tuple[int, int]
    index: int
    subifd: int | None = None
    tags: dict[int, Any] = field(default_factory=dict)
    others: int = 0


def main_page(path: Path) -> TiffPage:
    """Return the first page at full resolution; the first page where all are marked as reduced.

    Raises DamagedFile for files that are no TIFF, or damaged, and OSError for those that cannot be read.
    """
    with _tifffile(path) as file:
        pages = [file.pages[index] for index in range(min(len(file.pages), MAX_PAGES))]
        if not pages:
            raise DamagedFile("a TIFF without pages")
        full: list[tuple[int, int | None, Any]] = [
            (index, None, page) for index, page in enumerate(pages) if not _kind(page)
        ]
        if not full:
            full += [
                (index, number, below)
                for index, page in enumerate(pages)
                for number, below in enumerate(page.pages or () if page.subifds else ())
                if not _kind(below)
            ][:1]
        index, subifd, page = full[0] if full else (0, None, pages[0])
        tags = {tag.code: _value(tag.value) for tag in page.tags if _wanted(tag)}
        return TiffPage((int(page.imagewidth), int(page.imagelength)), index, subifd, tags, max(len(full) - 1, 0))


@contextmanager
def _tifffile(path: Path) -> Iterator[Any]:
    """Open a TIFF; every exception that its parser may raise for damaged files becomes DamagedFile."""
    import tifffile

    # Its log repeats what is refused or ignored here.
    logging.getLogger("tifffile").setLevel(logging.CRITICAL)
    with parsing("damaged TIFF"), tifffile.TiffFile(path) as file:
        yield file


def _kind(page: Any) -> int:
    """Bits of a page that say that it is reduced or a mask."""
    tag, old = page.tags.get(NEW_SUBFILE_TYPE), page.tags.get(SUBFILE_TYPE)
    kind = int(tag.value) if tag is not None else 0
    return (kind & (REDUCED | MASK)) | (REDUCED if old is not None and old.value == 2 else 0)


def _wanted(tag: Any) -> bool:
    most = MAX_BYTES if tag.code in BLOBS else MAX_VALUES
    return tag.count <= most and tag.code not in LISTS


def _value(value: Any) -> Any:
    if isinstance(value, str | bytes | tuple):
        return value
    if hasattr(value, "ravel"):  # an array of NumPy, as palettes are
        return tuple(value.ravel().tolist())
    return (int(value),) if isinstance(value, int) else (value,)  # an int and not the enumeration's member
