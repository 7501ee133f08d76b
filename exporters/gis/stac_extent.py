"""Spatial and temporal extent of a collection of figures, accumulated one figure at a time in constant memory."""

from __future__ import annotations

import itertools
import math
from typing import Any

from exporters.gis.time_span import TimeSpan, stamp

BINS = 3600
"""Number of longitude bins, a tenth of a degree each."""


class Longitudes:
    """Shortest interval that contains all longitudes; it may cross the antimeridian.

    The lowest and highest longitude of each bin are stored, so the ends are exact; gaps shorter than a bin are
    ignored.
    """

    def __init__(self) -> None:
        self._lowest = [math.inf] * BINS
        self._highest = [-math.inf] * BINS

    def add(self, lon_deg: float) -> None:
        """Add a longitude; lon_deg : in [-180, 180]."""
        index = min(int((lon_deg + 180.0) * (BINS / 360.0)), BINS - 1)
        self._lowest[index] = min(self._lowest[index], lon_deg)
        self._highest[index] = max(self._highest[index], lon_deg)

    def ends(self) -> tuple[float, float]:
        """West and east end, degrees; west is greater than east across the antimeridian (RFC 7946, 5.2).

        Raises ValueError without any longitude.
        """
        used = [(low, high) for low, high in zip(self._lowest, self._highest, strict=True) if low <= high]
        if not used:
            raise ValueError("no longitude")
        west, east = used[0][0], used[-1][1]
        widest = west + 360.0 - east
        for (_, before), (after, _) in itertools.pairwise(used):
            if after - before > widest:
                west, east, widest = after, before, after - before
        return west, east


class Extent:
    """Extent of a STAC collection."""

    def __init__(self) -> None:
        self._longitudes = Longitudes()
        self._latitudes = (math.inf, -math.inf)
        self._heights = (math.inf, -math.inf)
        self._span: TimeSpan | None = None
        self._flat = False
        self.count = 0

    def add(self, coordinates: list[float], span: TimeSpan) -> None:
        """Add a figure; coordinates : longitude, latitude, degrees, and optionally the height, metres."""
        lon, lat, *height = coordinates
        self._longitudes.add(lon)
        self._latitudes = _widened(self._latitudes, lat)
        for each in height:
            self._heights = _widened(self._heights, each)
        self._flat = self._flat or not height
        old = self._span or span
        self._span = TimeSpan(min(old.start, span.start), max(old.end, span.end))
        self.count += 1

    def document(self) -> dict[str, Any]:
        """Return the extent object; without figures, the whole earth and any time.

        The bounding box has heights if every figure has one.
        """
        if self._span is None:
            box: list[float] = [-180.0, -90.0, 180.0, 90.0]
            interval: list[str | None] = [None, None]
        else:
            west, east = self._longitudes.ends()
            low, high = ([], []) if self._flat else ([self._heights[0]], [self._heights[1]])
            box = [west, self._latitudes[0], *low, east, self._latitudes[1], *high]
            interval = [stamp(self._span.start), stamp(self._span.end)]
        return {"spatial": {"bbox": [box]}, "temporal": {"interval": [interval]}}


def _widened(ends: tuple[float, float], value: float) -> tuple[float, float]:
    return min(ends[0], value), max(ends[1], value)
