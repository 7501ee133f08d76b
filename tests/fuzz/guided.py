"""Damage guided by coverage: `python -m tests.fuzz.guided READER [libFuzzer's options]`, for readers in pure Python.

Atheris records which branches of our packages an input takes and continues from those that take new ones. What it finds
is written to the current folder as crash-…; the seeds are those of `tests.fuzz.readers`. `-max_total_time=60` ends it.
"""

from __future__ import annotations

import logging
import sys
import tempfile
from pathlib import Path

import atheris

PURE = ("joints", "world-file", "points", "annotation", "glb", "b3dm", "tileset", "entities")


def main() -> None:
    """Fuzz one reader until it fails, or until a limit of libFuzzer's options."""
    if len(sys.argv) < 2 or sys.argv[1] not in PURE:
        raise SystemExit(f"python -m tests.fuzz.guided READER, one of {', '.join(PURE)}")
    name = sys.argv.pop(1)
    room = Path(tempfile.mkdtemp(prefix="guided-"))
    work = room / "input"
    work.mkdir()
    with atheris.instrument_imports(include=["georef", "exporters", "fig2mesh"]):
        from georef.errors import InputError
        from tests.fuzz.readers import READERS, assert_one_line

        reader = READERS[name]
        intact = list(reader.seeds())
        for each in intact:  # readers import what they need when they need it: now, so that it is watched
            reader.read(each.put(work))
    logging.disable()
    corpus = room / "corpus"
    corpus.mkdir()
    for number, each in enumerate(intact):
        (corpus / f"{number}").write_bytes(bytes([number]) + each.files[each.main])

    def one(data: bytes) -> None:
        # The first byte selects the seed whose other files accompany the main one.
        base = intact[data[0] % len(intact)] if data else intact[0]
        path = type(base)(base.main, base.files | {base.main: data[1:]}).put(work)
        try:
            reader.read(path)
        except InputError as error:
            assert_one_line(str(error))

    atheris.Setup([sys.argv[0], "-timeout=20", "-rss_limit_mb=3000", *sys.argv[1:], str(corpus)], one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
