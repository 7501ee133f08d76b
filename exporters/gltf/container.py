"""Binary glTF from bytes, or from a file of which only the pages asked for are read.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html#glb-file-format-specification
"""

from __future__ import annotations

import mmap
import struct
from pathlib import Path
from typing import Any, cast

from exporters.errors import DAMAGE, ExportError
from exporters.gltf.reader import Gltf
from georef.untrusted.json_file import parse_json


def open_glb(path: Path) -> Gltf:
    """A .glb file mapped into memory: its JSON is parsed, its buffer read where `view` and `accessor` look.

    `view` gives memoryviews, valid as long as the record. Raises ExportError for what is no binary glTF.
    """
    try:
        if not path.is_file():  # a pipe would be waited for
            raise ValueError("is not there" if not path.exists() else "no plain file")
        with path.open("rb") as stream:
            data = memoryview(mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ExportError(path, f"no readable glTF ({reason})", "check the name") from error
    return glb_of(data, path)


def glb_of(data: bytes | memoryview, path: Path) -> Gltf:
    """The record of a .glb file's bytes; path : for messages. Raises ExportError for what is no binary glTF."""
    try:
        magic, version, length = struct.unpack_from("<4sII", data)
        if magic != b"glTF" or version != 2 or length > len(data):
            raise ValueError(f"starts with {bytes(magic)!r} version {version}, {length} of {len(data)} bytes")
        size, kind = struct.unpack_from("<I4s", data, 12)
        document: dict[str, Any] = parse_json(data[20 : 20 + size])
        if kind != b"JSON" or not isinstance(document, dict):
            raise ValueError("the first chunk is no JSON object")
        place = 20 + size
        buffers: tuple[bytes, ...] = ()
        if place + 8 <= length:
            size, kind = struct.unpack_from("<I4s", data, place)
            if kind != b"BIN\0" or place + 8 + size > length:
                raise ValueError(f"the second chunk is {bytes(kind)!r} of {size} bytes")
            buffers = (cast(bytes, data[place + 8 : place + 8 + size]),)
        if any("uri" in item for item in document.get("buffers", [])):
            raise ValueError("keeps its buffers in other files")
    except DAMAGE as error:
        raise ExportError(path, f"no readable glTF ({error})", "give a .glb") from error
    return Gltf(document, buffers, path)
