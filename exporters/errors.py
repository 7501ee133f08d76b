"""Errors of the writers and readers whose cause is the user's input or disk."""

from __future__ import annotations

import struct
import zlib

from georef.errors import InputError

# fmt: off
DAMAGE: tuple[type[Exception], ...] = (
    ArithmeticError, AttributeError, EOFError, LookupError, RecursionError, SyntaxError, TypeError, ValueError,
    struct.error, zlib.error,
)
# fmt: on
"""What code that looks into files from elsewhere raises where they are damaged: in more ways than can be listed."""


class ExportError(InputError):
    """An output that cannot be written, or a file that cannot be read back: names it, the finding and the remedy."""
