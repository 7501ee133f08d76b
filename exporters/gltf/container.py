"""The container of binary glTF: a header and two chunks, the document and its buffer.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html#glb-file-format-specification
"""

from __future__ import annotations

import mmap
import struct
from pathlib import Path

from georef.untrusted.damage import DamagedFile

MAGIC = b"glTF"
HEADER, CHUNK = struct.Struct("<4sII"), struct.Struct("<I4s")

Bytes = bytes | memoryview


def mapped(path: Path) -> memoryview:
    """The bytes of a file, of which only the pages that are looked at are read; valid as long as it is referred to.

    Raises DamagedFile for what is no plain file, or empty; OSError where it cannot be read.
    """
    try:
        if not path.is_file():  # a pipe would be waited for
            raise DamagedFile("is not there" if not path.exists() else "no plain file")
        with path.open("rb") as stream:
            return memoryview(mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ))
    except ValueError as error:  # no memory can be mapped to an empty file
        raise DamagedFile(str(error)) from error


def split_glb(data: Bytes) -> tuple[Bytes, Bytes | None]:
    """The JSON text and the binary chunk, None where there is none.

    Raises DamagedFile for a header or chunks that break the rules.
    """
    if len(data) < HEADER.size:
        raise DamagedFile(f"{len(data)} bytes, less than the header")
    magic, version, length = HEADER.unpack_from(data)
    if magic != MAGIC or version != 2:
        raise DamagedFile(f"starts with {magic!r} version {version}, expected b'glTF' version 2")
    if length != len(data):
        raise DamagedFile(f"header says {length} bytes, file has {len(data)}")
    chunks: list[Bytes] = []
    place = HEADER.size
    for kind in (b"JSON", b"BIN\0"):
        if place == length:
            break
        if place + CHUNK.size > length:
            raise DamagedFile(f"chunk at byte {place} is cut off")
        size, found = CHUNK.unpack_from(data, place)
        if found != kind or size % 4 or place + CHUNK.size + size > length:
            raise DamagedFile(f"chunk at byte {place} is {found!r} of {size} bytes, expected {kind!r} within the file")
        chunks.append(data[place + CHUNK.size : place + CHUNK.size + size])
        place += CHUNK.size + size
    if not chunks:
        raise DamagedFile("no chunk of JSON")
    return chunks[0], chunks[1] if len(chunks) > 1 else None


def join_glb(text: bytes, binary: bytes) -> bytes:
    """A binary glTF of a document and its buffer, both padded to multiples of four bytes."""
    length = HEADER.size + CHUNK.size + len(text) + CHUNK.size + len(binary)
    head = HEADER.pack(MAGIC, 2, length)
    return b"".join([head, CHUNK.pack(len(text), b"JSON"), text, CHUNK.pack(len(binary), b"BIN\0"), binary])
