"""Surroundings of the process: streams, limits, temporary folder; with what to set where they do not suffice."""

from __future__ import annotations

import codecs
import os
import sys
import tempfile
from pathlib import Path
from typing import Any, Final

from exporters.text import plain_text

NEEDED_BYTES: Final = 5_000_000_000
"""Address space that a figure of draft quality needs: PyTorch alone maps more than 3 GB, most of which stays unused."""

_OUT_OF_MEMORY: Final = (
    "failed to map segment",
    "cannot allocate memory",
    "can't allocate memory",
    "bad_alloc",
    "start new thread",
)


def open_streams() -> None:
    """Replace closed standard streams by the null device, and let the others write any text.

    A file opened while descriptor 1 is closed would become the standard output, and receive what others print there.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    for name in ("stdin", "stdout", "stderr"):
        stream: Any = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w", encoding="utf-8"))  # noqa: SIM115
        elif getattr(stream, "errors", None) == "strict" and hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="fig2mesh")


def _encodable(error: UnicodeError) -> tuple[str | bytes, int]:
    """File names as the bytes that they are, other characters that the encoding does not have as escapes."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    try:
        return codecs.lookup_error("surrogateescape")(error)
    except UnicodeError:
        return codecs.lookup_error("backslashreplace")(error)


codecs.register_error("fig2mesh", _encodable)


def address_limit() -> int | None:
    """Limit of the address space in bytes (`ulimit -v`), None where there is none."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def memory_error(error: Exception) -> str | None:
    """Finding and remedy for an error caused by too little memory or too few threads, None for any other error."""
    if not isinstance(error, MemoryError | ImportError | RuntimeError | OSError):
        return None
    if not isinstance(error, MemoryError) and not any(text in str(error).lower() for text in _OUT_OF_MEMORY):
        return None
    if "thread" in str(error).lower():
        return "no more threads can be started; raise ulimit -u, or set FIG2MESH_THREADS=1 and OMP_NUM_THREADS=1"
    limit = address_limit()
    if limit is not None:
        return f"the address space is limited to {limit / 1e9:.1f} GB (ulimit -v); allow {NEEDED_BYTES / 1e9:.0f} GB"
    return "not enough memory; close other programs, or choose a lower --quality"


def name_error(error: Exception) -> str | None:
    """Finding and remedy for a name that the file system or a library cannot take, None for any other error."""
    if not isinstance(error, UnicodeEncodeError):
        return None
    shown = plain_text(error.object)[:200]
    if error.encoding == "ascii":
        return f"{shown}: the name cannot be used in this locale; set PYTHONUTF8=1"
    return None if shown == error.object else f"{shown}: the name is not UTF-8; rename the file or its folder"


def temporary_fault() -> str | None:
    """Finding and remedy where no temporary folder can be written, None where one can."""
    try:
        folder = tempfile.gettempdir()
    except OSError:
        return "no temporary folder can be written; set TMPDIR to a writable folder"
    given = os.environ.get("TMPDIR")
    if given and os.path.realpath(folder) != os.path.realpath(given):
        return f"TMPDIR={given} cannot be written, {Path(folder)} is used; set TMPDIR to a writable folder"
    return None
