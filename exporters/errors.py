"""Errors of the writers and readers caused by the user's input or disk."""

from __future__ import annotations

from georef.errors import InputError


class ExportError(InputError):
    """An output that cannot be written, or a file that cannot be read."""
