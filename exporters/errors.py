"""Errors of the writers and readers whose cause is the user's input or disk."""

from __future__ import annotations

import struct
import zlib

from georef.errors import InputError
from georef.untrusted.damage import DamagedFile

# fmt: off
DAMAGE: tuple[type[Exception], ...] = (
    DamagedFile, struct.error, zlib.error, ArithmeticError, AttributeError, EOFError, LookupError, RecursionError,
    SyntaxError, TypeError, ValueError,
)
# fmt: on
"""What code that looks into files from elsewhere raises where they are damaged: in more ways than can be listed."""


class ExportError(InputError):
    """An output that cannot be written, or a file that cannot be read back: names it, the finding and the remedy."""
