"""Where and when a collection of figures is, gathered one figure at a time in constant memory."""

from __future__ import annotations

import itertools
import math
from typing import Any

from exporters.gis.time_span import TimeSpan, stamp

BINS = 3600
"""Of longitude, a tenth of a degree each."""


class Longitudes:
    """The shortest stretch of the parallel that holds all longitudes; it may cross the antimeridian.

    Kept are the lowest and the highest longitude in each bin, so the ends are exact; a gap shorter than a bin counts
    as none.
    """

    def __init__(self) -> None:
        self._lowest = [math.inf] * BINS
        self._highest = [-math.inf] * BINS

    def add(self, lon_deg: float) -> None:
        """lon_deg : in [-180, 180]"""
        place = min(int((lon_deg + 180.0) * (BINS / 360.0)), BINS - 1)
        self._lowest[place] = min(self._lowest[place], lon_deg)
        self._highest[place] = max(self._highest[place], lon_deg)

    def ends(self) -> tuple[float, float]:
        """West and east end, degrees; west is above east where the stretch crosses the antimeridian (RFC 7946, 5.2).

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
    """The extent of a STAC collection."""

    def __init__(self) -> None:
        self._longitudes = Longitudes()
        self._latitudes = (math.inf, -math.inf)
        self._heights = (math.inf, -math.inf)
        self._span: TimeSpan | None = None
        self._flat = False
        self.count = 0

    def add(self, coordinates: list[float], span: TimeSpan) -> None:
        """coordinates : longitude, latitude, degrees, and the height, metres, where there is one"""
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
        """The extent object; of no figures, the whole earth and any time.

        The box has heights where every figure has one.
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
