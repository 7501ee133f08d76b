"""Facing directions as text, parsed to compass bearings."""

from __future__ import annotations

import math
import re

from georef.errors import PlacementError

# fmt: off
COMPASS_POINTS = (
    "N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE",
    "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW",
)
# fmt: on
"""The 16 points of the compass, clockwise from north in steps of 22.5 degrees."""

VIEWER_BEARING_DEG = 180.0
"""A drawn figure faces the reader, and the reader of a map with north at the top views it from the south."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE | re.ASCII)


def normalized_bearing(bearing_deg: float) -> float:
    """Return the same direction in [0, 360) degrees, for any finite number of degrees."""
    wrapped = math.fmod(bearing_deg, 360.0)
    if wrapped < 0.0:
        wrapped += 360.0
    # -1e-20 + 360 rounds to 360, which is north again; adding zero makes north +0.0, never -0.0.
    return 0.0 if wrapped == 360.0 else wrapped + 0.0


def parse_facing(text: str, source: str = "--facing", viewer_deg: float = VIEWER_BEARING_DEG) -> float:
    """Compass bearing of a facing.

    text : one of `COMPASS_POINTS` in any case, a number of degrees clockwise from north, or "viewer"
    source : origin of the text, for the error message
    viewer_deg : the bearing towards the reader of the map; the default is for a map with north at the top
    returns : degrees clockwise from north in [0, 360)

    Raises PlacementError for anything else.

    >>> parse_facing("NNE"), parse_facing("-90"), parse_facing("viewer")
    (22.5, 270.0, 180.0)
    """
    word = text.strip()
    if word.lower() == "viewer":
        return viewer_deg
    if word.upper() in COMPASS_POINTS:
        return COMPASS_POINTS.index(word.upper()) * 22.5
    if _NUMBER.fullmatch(word) and math.isfinite(float(word)):
        return normalized_bearing(float(word))
    raise PlacementError(
        source,
        f"{text!r} is not a direction",
        "give a compass point (N, NNE, NE, ...), degrees clockwise from north, or viewer",
    )
