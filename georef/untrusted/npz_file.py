"""Arrays of an untrusted .npz archive: sizes are checked in the headers before anything is decompressed.

https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html
"""

from __future__ import annotations

import math
import struct
import zipfile
import zlib
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from georef.untrusted.damage import DamagedFile, decoding

MAX_STAGE_BYTES = 2 << 30
"""Decompressed size of all arrays of a stage. The largest stage, the parts of fine quality, has 0.5 GB."""

BROKEN_ZIP = (zipfile.BadZipFile, zlib.error, struct.error, EOFError, LookupError, RuntimeError, ValueError)
"""Exceptions of `zipfile` for damaged or encrypted archives and unknown compression methods."""

MAX_ARRAYS = 10_000
"""Number of arrays of a stage; each part of the figure has some 20."""


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Read the arrays of an archive by name: booleans, numbers and strings.

    Raises OSError where it cannot be read; DamagedFile for damaged archives, those that decompress to more than
    `MAX_STAGE_BYTES`, and arrays of objects.
    """
    if not path.is_file():
        raise FileNotFoundError(path)
    with decoding("not a readable archive", *BROKEN_ZIP):
        archive = zipfile.ZipFile(path)
    with archive:
        members = archive.infolist()
        names = {member.filename for member in members}
        if len(members) > MAX_ARRAYS or len(names) < len(members):
            raise DamagedFile(f"{len(members)} arrays with {len(names)} different names")
        if (size := sum(member.file_size for member in members)) > MAX_STAGE_BYTES:
            raise DamagedFile(f"unpacks to {size / 1e9:.3g} GB, more than {MAX_STAGE_BYTES / 1e9:.3g} GB")
        return {member.filename.removesuffix(".npy"): _array(archive, member) for member in members}


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    with decoding("not a readable archive", *BROKEN_ZIP):
        stream = archive.open(member)
    with stream:
        shape, fortran, dtype = _head(stream)
        length = member.file_size - stream.tell()
        if dtype.kind not in "biufU" or math.prod(shape) * dtype.itemsize != length:
            raise DamagedFile(f"{member.filename[:40]}: {shape} of {dtype} in {length} bytes")
        # Writable, as from np.load; the decompressed size is that in the archive's directory, or an error.
        with decoding("not a readable archive", *BROKEN_ZIP):
            data = bytearray(stream.read())
    if len(data) != length:
        raise DamagedFile(f"{member.filename[:40]} is truncated")
    if not length:
        if max(shape, default=0) > MAX_STAGE_BYTES:
            raise DamagedFile(f"{member.filename[:40]}: shape {shape}")
        return np.empty(shape, dtype)
    return np.frombuffer(data, dtype).reshape(shape, order="F" if fortran else "C")


def _head(stream: Any) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    file: BinaryIO = stream
    with decoding("not an array header", Exception):  # numpy raises all kinds of exceptions for malformed literals
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, fortran, dtype = read(file)
    if any(side < 0 for side in shape):
        raise DamagedFile(f"shape {shape}")
    return tuple(map(int, shape)), fortran, dtype  # numpy accepts true and false as sizes


def text_of(array: NDArray[Any]) -> str:
    """Return the string in a zero-dimensional array. Raises DamagedFile for other arrays and for invalid Unicode."""
    if array.dtype.kind != "U" or array.shape != ():
        raise DamagedFile(f"{array.shape} of {array.dtype}, expected a string")
    codes = array.reshape(1).astype(array.dtype.newbyteorder("<")).view("<u4")
    if codes.size and int(codes.max()) > 0x10FFFF:
        raise DamagedFile("a string of invalid characters")
    return str(array)
