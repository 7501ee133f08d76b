"""Exception of readers for files that violate their format.

It is neither a ValueError nor a TypeError: those are raised by bugs as well, and a bug must not be reported as a
damaged file.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class DamagedFile(Exception):
    """Violation of a rule of the file format, or of a limit set here; the message states it without naming the file."""


def reason_of(error: BaseException, max_length: int = 120) -> str:
    """Message of an error in one line of limited length, or its type where it has none."""
    return " ".join(str(error).split())[:max_length] or type(error).__name__


@contextmanager
def decoding(what: str, *kinds: type[Exception]) -> Iterator[None]:
    """Convert exceptions of a decoder to DamagedFile; only the call of the decoder belongs in the block.

    what : beginning of the message, "not a readable archive"; kinds : exceptions that the decoder is known to raise
    """
    try:
        yield
    except kinds as error:
        if isinstance(error, DamagedFile):
            raise
        raise DamagedFile(f"{what} ({reason_of(error)})") from error


@contextmanager
def parsing(what: str) -> Iterator[None]:
    """Convert all exceptions of a parser to DamagedFile; only calls of the parser belong in the block.

    For parsers that raise exceptions of all kinds for damaged files. Errors of the disk pass through.
    what : beginning of the message, "damaged picture"
    """
    try:
        yield
    except DamagedFile:
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.strerror:
            raise
        raise DamagedFile(f"{what} ({reason_of(error, 80)})") from error
