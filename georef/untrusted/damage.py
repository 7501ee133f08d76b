"""What readers raise where a file from elsewhere is not what its format demands.

An error of its own, neither a ValueError nor a TypeError: those are raised by mistakes in our code as well, and a
mistake of ours must not be reported as a damaged file.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class DamagedFile(Exception):
    """The file breaks a rule of its format, or a limit of ours; the message says which, without naming the file."""


def reason_of(error: BaseException, most: int = 120) -> str:
    """An error's own words in one line of limited length, or its kind where it has none."""
    return " ".join(str(error).split())[:most] or type(error).__name__


@contextmanager
def decoding(what: str, *kinds: type[Exception]) -> Iterator[None]:
    """Make DamagedFile of what a decoder raises; only the call of the decoder belongs into the block.

    what : begins the message, "no picture that can be read"; kinds : what the decoder is known to raise
    """
    try:
        yield
    except kinds as error:
        if isinstance(error, DamagedFile):
            raise
        raise DamagedFile(f"{what} ({reason_of(error)})") from error
