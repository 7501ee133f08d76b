"""Make what broke a reader small: `python -m tests.fuzz.minimise READER FOLDER TARGET`, folders of one input each.

Pieces are taken away as long as the reader fails at the same place in the same way: files, members of JSON documents,
ranges of bytes. Only for failures that leave the process alive; it has to be run with the code that still fails.
"""

from __future__ import annotations

import json
import shutil
import struct
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.fuzz.readers import READERS
from tests.fuzz.seeds import Input, taken
from tests.fuzz.worker import outcome

SECONDS = 60.0
"""Longest time for one input."""


def kind_of(found: str) -> str:
    """Invariant of the minimisation: the kind of error and where it was raised."""
    return f"{found.partition(':')[0]}@{found.rpartition('@')[2]}" if "@" in found else found.partition(":")[0]


def smaller_documents(document: Any) -> Iterator[Any]:
    """Copies of a JSON document that lack one member, or have a shorter text or a plain number."""
    text = json.dumps(document)
    places: list[tuple[Any, ...]] = []

    def walk(value: Any, path: tuple[Any, ...]) -> None:
        for key in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
            places.append((*path, key))
            walk(value[key], (*path, key))

    walk(document, ())
    for path in places:
        copy = json.loads(text)
        where = copy
        for key in path[:-1]:
            where = where[key]
        if isinstance(where[path[-1]], str) and len(where[path[-1]]) > 40:
            where[path[-1]] = where[path[-1]][:20]
        else:
            del where[path[-1]]
        yield copy


def smaller_bytes(data: bytes) -> Iterator[bytes]:
    """Copies of bytes that lack a range."""
    length = len(data) // 2
    while length:
        for start in range(0, len(data), length):
            yield data[:start] + data[start + length :]
        length //= 2


def _texts(data: bytes, name: str) -> tuple[Any, Callable[[Any], bytes]] | None:
    """The document in a file, and how another is put in its place; None where there is none."""
    try:
        if name.endswith((".json", ".gltf", ".czml", ".geojson")):
            return json.loads(data), lambda document: json.dumps(document).encode()
        if name.endswith(".glb"):
            (size,) = struct.unpack_from("<I", data, 12)
            rest = data[20 + size :]

            def packed(document: Any) -> bytes:
                text = json.dumps(document).encode()
                text += b" " * (-len(text) % 4)
                head = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(rest), len(text), b"JSON")
                return head + text + rest

            return json.loads(data[20 : 20 + size]), packed
    except (ValueError, RecursionError, struct.error):
        pass
    return None


def minimised(reader: str, case: Input, seconds: float = SECONDS) -> tuple[Input, str]:
    """The input with all taken away that its failure does not need, and what that is."""
    end = time.monotonic() + seconds
    with tempfile.TemporaryDirectory() as folder:

        def fails(tried: Input) -> str:
            room = Path(folder) / "input"
            shutil.rmtree(room, ignore_errors=True)
            room.mkdir()
            return outcome(READERS[reader], tried.put(room))

        finding = fails(case)
        wanted = kind_of(finding)

        def shrunk(now: Input, tries: Iterator[Input]) -> Input | None:
            for tried in tries:
                if time.monotonic() > end:
                    return None
                if kind_of(fails(tried)) == wanted:
                    return tried
            return None

        while True:
            others = [name for name in case.files if name != case.main]
            fewer = (replace(case, files={k: v for k, v in case.files.items() if k != name}) for name in others)
            found = shrunk(case, fewer)
            for name in case.files if found is None else ():
                document = _texts(case.files[name], name)
                if document is not None:
                    value, back = document
                    tries = (replace(case, files=case.files | {name: back(each)}) for each in smaller_documents(value))
                    found = shrunk(case, tries)
                if found is None:
                    less = smaller_bytes(case.files[name])
                    found = shrunk(case, (replace(case, files=case.files | {name: each}) for each in less))
                if found is not None:
                    break
            if found is None:
                return case, finding
            case = found


if __name__ == "__main__":
    made, why = minimised(sys.argv[1], taken(Path(sys.argv[2])))
    Path(sys.argv[3]).mkdir(parents=True, exist_ok=True)
    made.put(Path(sys.argv[3]))
    print(f"{sum(map(len, made.files.values()))} bytes: {why}")
