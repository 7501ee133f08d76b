"""Untrusted JSON: limited size and depth, no duplicate keys, only finite numbers.

Python's `json` is laxer than the format: it accepts NaN and Infinity, numbers beyond float64, duplicate keys (the last
one wins), and lone surrogates, which cannot be encoded; and deep nesting exhausts its stack.
https://www.rfc-editor.org/rfc/rfc8259
"""

from __future__ import annotations

import json
import math
import re
import stat
from pathlib import Path
from typing import Any

import numpy as np

from georef.errors import InputError
from georef.untrusted.damage import DamagedFile

MAX_DEPTH = 200
"""Levels of nested arrays and objects. Tilesets and scenes have tens; recursive code can handle 1000."""

MAX_INTEGER = 2**64
"""Largest integer: identifiers have 64 bits, and NumPy has no arrays of larger integers."""

MAX_JSON_BYTES = 256 << 20
"""Largest JSON file that is read. An index of 100,000 figures has 60 MB; in memory a document takes up to 30 times its
bytes, usually 5 to 10 times."""

BLOCK = 1 << 20

_STEPS = np.zeros(256, np.int64)
"""Change of the nesting depth by each byte."""
_STEPS[list(b"[{")] = 1
_STEPS[list(b"]}")] = -1


def parse_json(data: bytes | bytearray | memoryview | str) -> Any:
    """Parse a JSON text in UTF-8, or in UTF-16 or 32 as detected from its first bytes; a byte order mark is skipped.

    Raises DamagedFile with a one-line message for text that is not JSON or exceeds the limits of this module.
    """
    text = data if isinstance(data, str) else _decoded(bytes(data))
    text = text.removeprefix("\ufeff")
    if _too_deep(text):
        raise DamagedFile(f"nested too deeply: more than {MAX_DEPTH} levels")
    try:
        document = json.loads(
            text, object_pairs_hook=_object, parse_int=_integer, parse_float=_number, parse_constant=_constant
        )
    except json.JSONDecodeError as error:
        raise DamagedFile(f"not JSON: {error.msg} at line {error.lineno}, column {error.colno}") from None
    except RecursionError:
        raise DamagedFile("nested too deeply") from None
    if re.search(r"\\u[dD][89a-fA-F]", text):
        try:
            json.dumps(document, ensure_ascii=False).encode()
        except UnicodeEncodeError:
            raise DamagedFile("a lone surrogate in a string") from None
    return document


def read_json(path: Path, remedy: str, error: type[InputError] = InputError, max_bytes: int = MAX_JSON_BYTES) -> Any:
    """Read the document in a JSON file, see `parse_json`.

    remedy, error : remedy and type of the error that is raised where the file is missing, too large or not valid
    """
    try:
        return parse_json(read_bytes(path, max_bytes))
    except OSError as problem:
        raise error(path, problem.strerror or "cannot be read", remedy) from None
    except DamagedFile as problem:
        raise error(path, str(problem), remedy) from None


def is_plain_file(path: Path) -> bool:
    """Whether a path is an existing file; False for names that are too long or contain invalid characters."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_bytes(path: Path, max_bytes: int) -> bytes:
    """Read the bytes of a regular file of limited size.

    Raises OSError where it cannot be read; DamagedFile for larger files, and for devices, pipes and folders, whose
    data may never end.
    """
    try:
        found = path.stat()
    except ValueError:  # a zero byte, or a lone surrogate
        raise DamagedFile("not a valid file name") from None
    if stat.S_ISDIR(found.st_mode):
        raise DamagedFile("a folder, not a file")
    if not stat.S_ISREG(found.st_mode):
        raise DamagedFile("not a regular file")
    if found.st_size > max_bytes:
        raise DamagedFile(f"{found.st_size / 1e6:.0f} MB, more than the limit of {max_bytes / 1e6:.0f} MB")
    with path.open("rb") as stream:
        # Not `max_bytes`, which would be allocated before anything is read.
        return stream.read(found.st_size + 1)


def _decoded(data: bytes) -> str:
    coding = json.detect_encoding(data)
    try:
        return data.decode("utf-8" if coding == "utf-8-sig" else coding)
    except UnicodeDecodeError as error:
        raise DamagedFile(f"not {coding.upper()} text: {error.reason} at byte {error.start}") from None


def _too_deep(text: str) -> bool:
    """Whether arrays and objects are nested more than `MAX_DEPTH` deep; brackets within strings do not count."""
    if text.count("[") + text.count("{") <= MAX_DEPTH:
        return False
    # Non-ASCII and escaped characters do not count, in particular escaped quotation marks.
    plain = re.sub(rb"\\.", b"", text.encode("ascii", "replace"), flags=re.DOTALL)
    level, quoted = 0, 0
    for start in range(0, len(plain), BLOCK):
        block = np.frombuffer(plain, np.uint8, min(BLOCK, len(plain) - start), start)
        marks = np.cumsum(block == ord('"')) + quoted
        levels = level + np.cumsum(np.where(marks & 1, 0, _STEPS[block]))
        if levels.max() > MAX_DEPTH:
            return True
        level, quoted = int(levels[-1]), int(marks[-1] & 1)
    return False


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        known: set[str] = set()
        for key, _ in pairs:
            if key in known:
                break
            known.add(key)
        raise DamagedFile(f"duplicate key {key[:40]!r} in an object")
    return found


def _integer(digits: str) -> int:
    value = int(digits) if len(digits) <= 21 else MAX_INTEGER + 1
    if abs(value) > MAX_INTEGER:
        raise DamagedFile(f"the integer {digits[:24]}… is larger than 2^64")
    return value


def _number(digits: str) -> float:
    value = float(digits)
    if not math.isfinite(value):
        raise DamagedFile(f"the number {digits[:24]} is beyond the range of float64")
    return value


def _constant(name: str) -> float:
    raise DamagedFile(f"{name} is not a number in JSON")
