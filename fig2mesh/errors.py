"""Errors of the pipeline; see `georef.errors` for the rule they follow."""

from __future__ import annotations

from georef.errors import InputError

__all__ = ["FigureError", "InputError", "OutputError"]


SYSTEM_LIBRARIES = "apt-get install -y --no-install-recommends libgl1 libegl1 libopengl0 libusb-1.0-0"
"""Brings the system libraries that Open3D and MeshLab load; part of remedies."""


class FigureError(InputError):
    """The picture, mask, joints or part labels of a figure cannot be used."""

    permanent = True


class OutputError(InputError):
    """A result cannot be written to the requested place."""
