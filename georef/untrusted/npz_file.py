"""The arrays of an .npz archive from anywhere: nothing is unpacked before its head has said how much it is.

https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html
"""

from __future__ import annotations

import math
import tokenize
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

MAX_STAGE_BYTES = 2 << 30
"""All arrays of a stage, unpacked. Those of the largest stage, the parts of fine quality, have 0.5 GB."""

MAX_ARRAYS = 10_000
"""Arrays of a stage: some 20 for each part of the figure."""


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of an archive by name: booleans, numbers and texts.

    Raises OSError where it cannot be read; ValueError, zipfile's or zlib's own errors for damaged archives, those that
    unpack to more than `MAX_STAGE_BYTES` and arrays of objects.
    """
    if not path.is_file():
        raise FileNotFoundError(path)
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            names = {member.filename for member in members}
            if len(members) > MAX_ARRAYS or len(names) < len(members):
                raise ValueError(f"{len(members)} arrays, {len(names)} of different names")
            if (size := sum(member.file_size for member in members)) > MAX_STAGE_BYTES:
                raise ValueError(f"unpacks to {size / 1e9:.3g} GB, more than {MAX_STAGE_BYTES / 1e9:.3g} GB")
            return {member.filename.removesuffix(".npy"): _array(archive, member) for member in members}
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:  # encrypted, or packed in another way
        raise ValueError(str(error)) from None


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    with archive.open(member) as stream:
        shape, fortran, dtype = _head(stream)
        length = member.file_size - stream.tell()
        if dtype.kind not in "biufU" or math.prod(shape) * dtype.itemsize != length:
            raise ValueError(f"{member.filename[:40]}: {shape} of {dtype} in {length} bytes")
        # Writable, as np.load gives them; what is unpacked is what the archive's directory says, or an error.
        data = bytearray(stream.read())
    if len(data) != length:
        raise ValueError(f"{member.filename[:40]} is cut off")
    return np.frombuffer(data, dtype).reshape(shape, order="F" if fortran else "C")


def _head(stream: Any) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    file: BinaryIO = stream
    try:
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, fortran, dtype = read(file)
    except (MemoryError, tokenize.TokenError, SyntaxError) as error:  # of texts that are no literals
        raise ValueError(f"no head of an array ({type(error).__name__})") from None
    if any(side < 0 for side in shape):
        raise ValueError(f"a shape of {shape}")
    return shape, fortran, dtype


def text_of(array: NDArray[Any]) -> str:
    """The text in an array without axes. Raises ValueError for other arrays, and for what is no Unicode."""
    if array.dtype.kind != "U" or array.shape != ():
        raise ValueError(f"{array.shape} of {array.dtype}, expected a text")
    codes = array.reshape(1).astype(array.dtype.newbyteorder("<")).view("<u4")
    if codes.size and int(codes.max()) > 0x10FFFF:
        raise ValueError("a text of what are no characters")
    return str(array)
