"""Validation of the headers of geoid grids before PROJ reads them: its GeoTIFF reader may divide by zero there,
which kills the process.

https://vdatum.noaa.gov/docs/gtx_info.html
https://proj.org/en/stable/specifications/geodetictiffgrids.html
https://www.adobe.io/open/standards/TIFF.html, https://www.awaresystems.be/imaging/tiff/bigtiff.html
"""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import BinaryIO

MAX_SIDE = 100_000
"""Nodes along a side of a grid: a resolution of 13 arc seconds around the whole earth."""

MAX_BLOCK_BYTES = 64 << 20
"""Size of a decompressed tile or strip, which is kept in memory."""

MAX_GRIDS = 1000
"""Grids in one file, each a directory of the TIFF."""

MAX_ENTRIES = 200

WIDTH, HEIGHT, BITS, ROWS_PER_STRIP, SAMPLES = 256, 257, 258, 278, 277
TILE_WIDTH, TILE_HEIGHT, STRIP_OFFSETS, STRIP_BYTES, TILE_OFFSETS, TILE_BYTES = 322, 323, 273, 279, 324, 325
PLANAR = 284

_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4, 16: 8, 17: 8, 18: 8}
_WHOLE = {1: "B", 3: "H", 4: "I", 13: "I", 16: "Q"}


def check_grid(path: Path) -> None:
    """Raise ValueError for a grid file whose header is damaged; OSError where it cannot be read.

    path : a .gtx by its suffix, otherwise a TIFF
    """
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(0)
        if path.suffix.lower() == ".gtx":
            _check_gtx(stream.read(40), size)
        else:
            _check_tiff(stream, size)


def _check_gtx(head: bytes, size: int) -> None:
    if len(head) < 40:
        raise ValueError(f"{size} bytes, less than the header of a GTX grid")
    south, west, step_lat, step_lon, rows, columns = struct.unpack(">4d2i", head)
    if not (0 < rows <= MAX_SIDE and 0 < columns <= MAX_SIDE and size >= 40 + 4 * rows * columns):
        raise ValueError(f"its header declares {rows} rows of {columns} nodes, but the file has {size} bytes")
    if not (0 < step_lat <= 180 and 0 < step_lon <= 360 and abs(south) <= 90 and abs(west) <= 360):
        raise ValueError(
            f"its header declares a corner at {west:g} {south:g} and steps of {step_lon:g} {step_lat:g} degrees"
        )


def _check_tiff(stream: BinaryIO, size: int) -> None:
    head = stream.read(16)
    order = {b"II": "<", b"MM": ">"}.get(head[:2])
    if order is None or len(head) < 16:
        raise ValueError("not a TIFF file")
    version = struct.unpack_from(order + "H", head, 2)[0]
    if version not in (42, 43):
        raise ValueError("not a TIFF file")
    big = version == 43
    offset = struct.unpack_from(order + "Q", head, 8)[0] if big else struct.unpack_from(order + "I", head, 4)[0]
    visited: set[int] = set()
    while offset:
        if offset in visited or len(visited) >= MAX_GRIDS:
            raise ValueError(f"more than {MAX_GRIDS} grids, or a cycle of directories")
        visited.add(offset)
        entries, offset = _directory(stream, offset, order, big, size)
        _check_blocks(entries)
    if not visited:
        raise ValueError("a TIFF without a directory")


Entries = dict[int, tuple[int, int | None]]
"""Tag → number of its values, and the first value where it is an integer."""


def _directory(stream: BinaryIO, start: int, order: str, big: bool, size: int) -> tuple[Entries, int]:
    """Entries of a directory, and the offset of the next one, 0 after the last."""
    count_kind, entry_kind, word = ("Q", "HHQ", 8) if big else ("H", "HHI", 4)
    stream.seek(min(start, size))
    count = _unpacked(stream, order + count_kind)[0]
    if count > MAX_ENTRIES:
        raise ValueError(f"a directory of {count} entries")
    entries: Entries = {}
    for _ in range(count):
        tag, kind, number = _unpacked(stream, order + entry_kind)
        value = stream.read(word)
        if len(value) < word:
            raise ValueError("the file is truncated")
        length = _SIZES.get(kind, 1) * number
        offset = struct.unpack(order + ("Q" if big else "I"), value)[0]
        if length > word and offset + length > size:
            raise ValueError(f"tag {tag} ends at byte {offset + length} of {size}")
        if tag in entries:
            raise ValueError(f"duplicate tag {tag}")
        first = None
        if number >= 1 and kind in _WHOLE:
            if length <= word:
                first = struct.unpack_from(order + _WHOLE[kind], value)[0]
            else:
                after = stream.tell()
                stream.seek(offset)
                first = _unpacked(stream, order + _WHOLE[kind])[0]
                stream.seek(after)
        entries[tag] = (number, first)
    return entries, int(_unpacked(stream, order + ("Q" if big else "I"))[0])


def _unpacked(stream: BinaryIO, kind: str) -> tuple[int, ...]:
    data = stream.read(struct.calcsize(kind))
    if len(data) < struct.calcsize(kind):
        raise ValueError("the file is truncated")
    return struct.unpack(kind, data)


def _check_blocks(entries: Entries) -> None:
    def first(tag: int, default: int = 0) -> int:
        value = entries.get(tag, (0, None))[1]
        return default if value is None else value

    width, height, samples, bits = first(WIDTH), first(HEIGHT), first(SAMPLES, 1), first(BITS, 1)
    if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE and 0 < samples <= 16 and bits in (8, 16, 32, 64)):
        raise ValueError(f"a grid of {width} x {height} nodes with {samples} values of {bits} bits")
    tiled = TILE_WIDTH in entries or TILE_HEIGHT in entries
    if tiled:
        across, down = first(TILE_WIDTH), first(TILE_HEIGHT)
    else:
        across, down = width, min(first(ROWS_PER_STRIP), height)
    planes = samples if first(PLANAR, 1) == 2 else 1
    if not (0 < across <= 2 * MAX_SIDE and 0 < down <= 2 * MAX_SIDE):
        raise ValueError(f"blocks of {across} x {down} nodes")
    if across * down * bits // 8 * (samples // planes) > MAX_BLOCK_BYTES:
        raise ValueError(f"blocks of {across} x {down} nodes, more than {MAX_BLOCK_BYTES >> 20} MiB")
    blocks = math.ceil(width / across) * math.ceil(height / down) * planes
    for tag in (TILE_OFFSETS, TILE_BYTES) if tiled else (STRIP_OFFSETS, STRIP_BYTES):
        if entries.get(tag, (0, None))[0] < blocks:
            raise ValueError(f"{entries.get(tag, (0, None))[0]} of {blocks} blocks")
