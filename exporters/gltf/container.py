"""Container format of binary glTF: a header and two chunks, the document and its buffer.

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
    """Map the bytes of a file into memory; only the pages that are accessed are read.

    Raises DamagedFile for an empty file or one that is not regular; OSError where it cannot be read.
    """
    try:
        if not path.is_file():  # opening a pipe would block
            raise DamagedFile("no such file" if not path.exists() else "not a regular file")
        with path.open("rb") as stream:
            return memoryview(mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ))
    except ValueError as error:  # an empty file cannot be mapped
        raise DamagedFile(str(error)) from error


def split_glb(data: Bytes) -> tuple[Bytes, Bytes | None]:
    """Split a file into the JSON text and the binary chunk, None without one.

    Raises DamagedFile for an invalid header or chunks.
    """
    if len(data) < HEADER.size:
        raise DamagedFile(f"{len(data)} bytes, less than the header")
    magic, version, length = HEADER.unpack_from(data)
    if magic != MAGIC or version != 2:
        raise DamagedFile(f"starts with {magic!r} version {version}, expected b'glTF' version 2")
    if length != len(data):
        raise DamagedFile(f"header declares {length} bytes, file has {len(data)}")
    chunks: list[Bytes] = []
    offset = HEADER.size
    for kind in (b"JSON", b"BIN\0"):
        if offset == length:
            break
        if offset + CHUNK.size > length:
            raise DamagedFile(f"chunk at byte {offset} is truncated")
        size, found = CHUNK.unpack_from(data, offset)
        if found != kind or size % 4 or offset + CHUNK.size + size > length:
            raise DamagedFile(f"chunk at byte {offset} is {found!r} of {size} bytes, expected {kind!r} within the file")
        chunks.append(data[offset + CHUNK.size : offset + CHUNK.size + size])
        offset += CHUNK.size + size
    if not chunks:
        raise DamagedFile("no JSON chunk")
    return chunks[0], chunks[1] if len(chunks) > 1 else None


def join_glb(text: bytes, binary: bytes) -> bytes:
    """Return a binary glTF of a document and its buffer, both padded to multiples of four bytes."""
    length = HEADER.size + CHUNK.size + len(text) + CHUNK.size + len(binary)
    head = HEADER.pack(MAGIC, 2, length)
    return b"".join([head, CHUNK.pack(len(text), b"JSON"), text, CHUNK.pack(len(binary), b"BIN\0"), binary])
