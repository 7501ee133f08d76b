"""Errors of the pipeline; see `georef.errors` for the rule they follow."""

from __future__ import annotations

from georef.errors import InputError

__all__ = ["FigureError", "InputError", "OutputError"]


class FigureError(InputError):
    """The picture, mask, joints or part labels of a figure cannot be used."""

    permanent = True


class OutputError(InputError):
    """A result cannot be written where it was asked for."""
