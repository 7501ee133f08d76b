"""Dates of tables as spans of time."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta, timezone

import pytest
from hypothesis import given
from hypothesis import strategies as st

from exporters.errors import ExportError
from exporters.gis.time_span import stamp, time_span


@pytest.mark.parametrize(
    ("text", "start", "end"),
    [
        ("1893", "1893-01-01T00:00:00Z", "1893-12-31T23:59:59Z"),
        ("1893-05", "1893-05-01T00:00:00Z", "1893-05-31T23:59:59Z"),
        ("1892-02", "1892-02-01T00:00:00Z", "1892-02-29T23:59:59Z"),
        ("1900-02", "1900-02-01T00:00:00Z", "1900-02-28T23:59:59Z"),
        ("1893-05-17", "1893-05-17T00:00:00Z", "1893-05-17T23:59:59Z"),
        ("1893/1895-02", "1893-01-01T00:00:00Z", "1895-02-28T23:59:59Z"),
        (" 0793 ", "0793-01-01T00:00:00Z", "0793-12-31T23:59:59Z"),
        ("9999", "9999-01-01T00:00:00Z", "9999-12-31T23:59:59Z"),
        ("2024-05-17T12:00:00Z", "2024-05-17T12:00:00Z", "2024-05-17T12:00:00Z"),
        ("2024-05-17t12:00:00z", "2024-05-17T12:00:00Z", "2024-05-17T12:00:00Z"),
        ("2024-05-17 12:00", "2024-05-17T12:00:00Z", "2024-05-17T12:00:00Z"),
        ("2024-05-17T00:30:00+02:00", "2024-05-16T22:30:00Z", "2024-05-16T22:30:00Z"),
        ("2024-05-17T12:00:00.25-0130", "2024-05-17T13:30:00.250000Z", "2024-05-17T13:30:00.250000Z"),
    ],
)
def test_dates(text: str, start: str, end: str) -> None:
    found = time_span(text)
    assert (stamp(found.start), stamp(found.end)) == (start, end)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "ca. 1893",
        "93",
        "18930",
        "1893-13",
        "1893-02-29",
        "1893-5",
        "0000",
        "1893-05-17T25:00",
        "1895/1893",
        "1893/",
        "1893/1894/1895",
        "1893-W05",
        "today",
        "１８９３",
        "0001-01-01T00:00:00+02:00",
        "9999-12-31T23:00:00-02:00",
    ],
)
def test_invalid_dates(text: str) -> None:
    with pytest.raises(ExportError, match=r"date of anna: .* (is not an ISO 8601 date|ends before it starts)"):
        time_span(text, "date of anna")


@given(st.datetimes(timezones=st.just(UTC)), st.integers(-14 * 60, 14 * 60))
def test_a_moment_is_the_same_in_every_zone(moment: datetime, minutes: int) -> None:
    try:
        local = moment.astimezone(timezone(timedelta(minutes=minutes)))
    except OverflowError:
        return
    found = time_span(local.isoformat())
    assert found.start == found.end == moment
    assert datetime.fromisoformat(stamp(found.start)) == moment


@given(st.dates())
def test_a_day_lies_in_its_month_and_year(day: date) -> None:
    text = day.isoformat()
    inner, middle, outer = time_span(text), time_span(text[:7]), time_span(text[:4])
    assert outer.start <= middle.start <= inner.start < inner.end <= middle.end <= outer.end
    if day < date(9999, 12, 31):
        following = time_span((day + timedelta(days=1)).isoformat())
        assert following.start - inner.end == timedelta(seconds=1)
