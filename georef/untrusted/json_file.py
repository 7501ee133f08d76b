"""JSON from elsewhere: of limited size and depth, each key once, every number one that arithmetic can use.

Python's `json` is laxer than the format: it takes NaN and Infinity, numbers that no float64 holds, the last of several
values of one key, and halves of surrogate pairs, which no text can be written with; and nesting exhausts its stack.
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
"""Levels of arrays and objects. Tilesets and scenes have tens; what walks a document by recursion stands 1000."""

MAX_WHOLE = 2**64
"""Whole numbers reach no further: identifiers have 64 bits, and arrays of larger ones are no arrays of numbers."""

MAX_JSON_BYTES = 256 << 20
"""Largest JSON file that is read. An index of 100,000 figures has 60 MB; in memory a document takes up to 30 times its
bytes, usually 5 to 10 times."""

BLOCK = 1 << 20

_STEPS = np.zeros(256, np.int64)
"""By how much each byte changes the depth."""
_STEPS[list(b"[{")] = 1
_STEPS[list(b"]}")] = -1


def parse_json(data: bytes | bytearray | memoryview | str) -> Any:
    """The document in a JSON text, UTF-8, or UTF-16 or 32 as told by its first bytes; a byte order mark is skipped.

    Raises DamagedFile with one line for everything that the module's first line rules out, and for what is no JSON.
    """
    text = data if isinstance(data, str) else _decoded(bytes(data))
    text = text.removeprefix("\ufeff")
    if _too_deep(text):
        raise DamagedFile(f"nested too deeply: more than {MAX_DEPTH} levels")
    try:
        document = json.loads(
            text, object_pairs_hook=_object, parse_int=_whole, parse_float=_number, parse_constant=_constant
        )
    except json.JSONDecodeError as error:
        raise DamagedFile(f"not JSON: {error.msg} at line {error.lineno}, column {error.colno}") from None
    except RecursionError:
        raise DamagedFile("nested too deeply") from None
    if re.search(r"\\u[dD][89a-fA-F]", text):
        try:
            json.dumps(document, ensure_ascii=False).encode()
        except UnicodeEncodeError:
            raise DamagedFile("a text with half of a surrogate pair") from None
    return document


def read_json(path: Path, remedy: str, error: type[InputError] = InputError, max_bytes: int = MAX_JSON_BYTES) -> Any:
    """The document in a JSON file, see `parse_json`.

    remedy, error : of the error that is raised where the file is not there, too large or not such JSON
    """
    try:
        return parse_json(read_bytes(path, max_bytes))
    except OSError as problem:
        raise error(path, problem.strerror or "cannot be read", remedy) from None
    except DamagedFile as problem:
        raise error(path, str(problem), remedy) from None


def is_there(path: Path) -> bool:
    """Whether a path is a plain file. A name out of a file may be longer than any, or hold what no name can."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_bytes(path: Path, max_bytes: int) -> bytes:
    """The bytes of a plain file of limited size.

    Raises OSError where it cannot be read; DamagedFile for larger ones and for what is no file but a device, a pipe or
    a folder, which may never end.
    """
    try:
        found = path.stat()
    except ValueError:  # a zero byte, or half of a surrogate pair
        raise DamagedFile("no name of a file") from None
    if stat.S_ISDIR(found.st_mode):
        raise DamagedFile("a folder, not a file")
    if not stat.S_ISREG(found.st_mode):
        raise DamagedFile("no plain file")
    if found.st_size > max_bytes:
        raise DamagedFile(f"{found.st_size / 1e6:.0f} MB are more than the {max_bytes / 1e6:.0f} MB that are read")
    with path.open("rb") as stream:
        # Not `max_bytes`, which would be allocated before anything is read.
        return stream.read(found.st_size + 1)


def _decoded(data: bytes) -> str:
    coding = json.detect_encoding(data)
    try:
        return data.decode("utf-8" if coding == "utf-8-sig" else coding)
    except UnicodeDecodeError as error:
        raise DamagedFile(f"no {coding.upper()} text: {error.reason} at byte {error.start}") from None


def _too_deep(text: str) -> bool:
    """Whether arrays and objects are nested more than `MAX_DEPTH` deep, brackets within strings not counted."""
    if text.count("[") + text.count("{") <= MAX_DEPTH:
        return False
    # Of what is no ASCII nothing counts; of what is escaped neither, above all no quotation mark.
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
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                break
            seen.add(key)
        raise DamagedFile(f"the key {key[:40]!r} twice in one object")
    return found


def _whole(digits: str) -> int:
    value = int(digits) if len(digits) <= 21 else MAX_WHOLE + 1
    if abs(value) > MAX_WHOLE:
        raise DamagedFile(f"the whole number {digits[:24]}… is larger than 2^64")
    return value


def _number(digits: str) -> float:
    value = float(digits)
    if not math.isfinite(value):
        raise DamagedFile(f"the number {digits[:24]} is larger than any float64")
    return value


def _constant(name: str) -> float:
    raise DamagedFile(f"{name} is no number of JSON")
