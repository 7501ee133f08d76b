"""Facing text, bearings and the placement record."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from georef.bearing import COMPASS_POINTS, normalized_bearing, parse_facing
from georef.errors import InputError, PlacementError
from georef.placement import GeoPlacement

finite = st.floats(allow_nan=False, allow_infinity=False)


@given(finite)
@example(-1e-20)
@example(-0.0)
@example(360.0)
def test_bearings_are_normalized_once_and_keep_their_direction(angle):
    bearing = normalized_bearing(angle)
    assert 0.0 <= bearing < 360.0
    assert math.copysign(1.0, bearing) == 1.0
    assert normalized_bearing(bearing) == bearing
    # Adding 360 to a negative remainder rounds once, at most by half a step of 360: 3e-14.
    difference = math.fmod(angle, 360.0) - bearing
    assert min(abs(difference), abs(difference + 360.0)) < 1e-13 or abs(difference + 360.0 - 720.0) < 1e-13
    assert GeoPlacement(0, 0, heading_deg=angle).heading_deg == bearing


@given(st.integers(0, 15), st.booleans())
def test_compass_points_are_16_equal_steps(index, lower):
    text = COMPASS_POINTS[index].lower() if lower else COMPASS_POINTS[index]
    assert parse_facing(f" {text} ") == 22.5 * index


def test_each_compass_point_is_the_mean_of_its_letters():
    """From the names alone: the second half of a name pulls the main direction half-way towards the other."""
    quarter = {"N": 0.0, "E": 90.0, "S": 180.0, "W": 270.0}

    def direction(name: str) -> float:
        if len(name) == 1:
            return quarter[name]
        near, far = quarter[name[0]], direction(name[1:])
        return (near + ((far - near + 180.0) % 360.0 - 180.0) / 2.0) % 360.0

    assert [parse_facing(name) for name in COMPASS_POINTS] == [direction(name) for name in COMPASS_POINTS]


@given(st.floats(-1e6, 1e6))
def test_degrees_are_read_as_numbers(angle):
    assert parse_facing(repr(angle)) == normalized_bearing(angle)


def test_viewer_looks_south():
    assert parse_facing("viewer") == parse_facing("Viewer") == parse_facing("S") == 180.0


@pytest.mark.parametrize("text", ["", "north", "NEN", "nan", "inf", "1e999", "1_0", "12,5", "NE 3", "0x10", "٣"])
def test_other_facings_name_input_finding_and_remedy(text):
    with pytest.raises(PlacementError) as caught:
        parse_facing(text)
    error = caught.value
    assert isinstance(error, InputError)
    assert error.source == "--facing"
    assert repr(text) in error.finding
    assert "compass point" in error.remedy
    assert "\n" not in str(error)


def test_the_source_of_a_facing_can_be_named():
    with pytest.raises(PlacementError, match=r"^people\.csv row 3: 'up' is not a direction"):
        parse_facing("up", source="people.csv row 3")


@pytest.mark.parametrize(
    ("values", "finding"),
    [
        ({"lat_deg": 91.0}, "latitude 91 is outside.*latitude"),
        ({"lat_deg": 120.0}, "longitude first"),
        ({"lon_deg": 180.00000001}, "longitude 180.00000001 is outside"),
        ({"lon_deg": math.nan}, "not a finite number"),
        ({"heading_deg": math.inf}, "not a finite number"),
        ({"figure_height_m": 0.0}, "positive height"),
    ],
)
def test_placements_that_cannot_be(values, finding):
    with pytest.raises(PlacementError, match=finding):
        GeoPlacement(**({"lon_deg": 0.0, "lat_deg": 0.0} | values))
