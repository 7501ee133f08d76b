"""ISO 8601 dates as spans of time, such as a whole year.

https://www.rfc-editor.org/rfc/rfc3339
"""

from __future__ import annotations

import re
from calendar import monthrange
from dataclasses import dataclass
from datetime import UTC, datetime

from exporters.errors import ExportError

_DAY = re.compile(r"(\d{4})(?:-(\d\d)(?:-(\d\d))?)?", re.ASCII)
_INSTANT = re.compile(r"\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d(:\d\d(\.\d+)?)?([Zz]|[+-]\d\d:?\d\d)?", re.ASCII)


@dataclass(frozen=True, slots=True)
class TimeSpan:
    """Span from the first to the last instant, both in UTC; equal for a single instant."""

    start: datetime
    end: datetime


def time_span(text: str, source: str = "date") -> TimeSpan:
    """Parse the span of time of an ISO 8601 date.

    text : a year, "1893", a month, "1893-05", a day, "1893-05-17", an instant, "1893-05-17T12:00:00Z" (UTC without an
        offset), or the interval from the start of one to the end of another, "1893/1895"
    source : origin of the text, for the error message

    A year, month or day ends one second before the next.

    Raises ExportError for anything else, such as "around 1893", and for an end before its start.
    """
    try:
        spans = [_span(part.strip()) for part in text.split("/", 1)]
        found = TimeSpan(spans[0].start, spans[-1].end)
    except (ValueError, OverflowError) as error:
        remedy = "give a date such as 1893, 1893-05-17 or 1893/1895, or an instant such as 2024-05-17T12:00:00Z"
        raise ExportError(source, f"{text!r} is not an ISO 8601 date", remedy) from error
    if found.end < found.start:
        raise ExportError(source, f"{text!r} ends before it starts", "give the earlier date first")
    return found


def _span(text: str) -> TimeSpan:
    if match := _DAY.fullmatch(text):
        year, month, day = int(match[1]), int(match[2] or 0), int(match[3] or 0)
        last_month = month or 12
        last_day = day or monthrange(year, last_month)[1]
        end = datetime(year, last_month, last_day, 23, 59, 59, tzinfo=UTC)
        return TimeSpan(datetime(year, month or 1, day or 1, tzinfo=UTC), end)
    if not _INSTANT.fullmatch(text):
        raise ValueError(text)
    instant = datetime.fromisoformat(text.upper())
    instant = instant.replace(tzinfo=UTC) if instant.tzinfo is None else instant.astimezone(UTC)
    return TimeSpan(instant, instant)


def stamp(instant: datetime) -> str:
    """Format an instant in UTC as in RFC 3339, with a Z."""
    return instant.isoformat().replace("+00:00", "Z")
