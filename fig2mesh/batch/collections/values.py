"""What readers of collections find in a file: points, and values that cannot be used."""

from __future__ import annotations

from dataclasses import dataclass

LON_LAT = "give columns lon and lat"
"""Remedy for places that cannot be read."""

TO_DEGREES = "ogr2ogr -t_srs EPSG:4326"
"""Command that transforms a table to longitude and latitude, for remedies."""

SHOWN = 40
"""Characters of a value in messages."""


@dataclass(frozen=True, slots=True)
class Point:
    """Location of a geometry: WGS 84 degrees; altitude in metres, None where it has none."""

    lon: float
    lat: float
    altitude: float | None = None


@dataclass(frozen=True, slots=True)
class InvalidValue:
    """Stands in for a value, geometry or row that cannot be used."""

    finding: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.finding}; {self.remedy}"

    def in_column(self, name: str) -> InvalidValue:
        """The same problem, with the name of its column."""
        return InvalidValue(f"{shown(name)}: {self.finding}", self.remedy)


def shown(value: object, most: int = SHOWN) -> str:
    """A value as text for messages: short, and always in one line."""
    text = value if isinstance(value, str) else repr(value)
    text = text if len(text) <= most else text[: most - 1] + "…"
    return text if text.isprintable() else repr(text)[1:-1]
