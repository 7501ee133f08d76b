"""Columns of a user's table on a figure: what values become, and what names in the properties of a feature."""

from __future__ import annotations

import json
import math
from dataclasses import FrozenInstanceError, replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from exporters.figure_reader import describe
from exporters.gis.geojson import OWN_PROPERTIES, feature, free_names
from exporters.placed_figure import PlacedFigure, plain_attributes
from fig2mesh.batch.collections.rows import MAX_INTEGER
from tests.exporters.analytic import ZURICH
from tests.exporters.tables import column_names, figure, tables, values


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(column_names, values), max_size=8))
def test_values_are_plain_and_stay_so(pairs: list[tuple[str, object]]) -> None:
    found = plain_attributes(pairs)
    assert plain_attributes(found) == found
    json.dumps(found, allow_nan=False, ensure_ascii=False).encode()
    for (_, given_value), (name, value) in zip(pairs, found, strict=True):
        assert "\0" not in name
        if isinstance(given_value, float) and not math.isfinite(given_value):
            assert value is None
        elif type(given_value) is int and not -(2**63) <= given_value < 2**63:
            assert value == str(given_value)
        elif not isinstance(given_value, str):
            assert value is given_value or (value == given_value and type(value) is type(given_value))


@pytest.mark.parametrize(
    ("given_value", "wanted"),
    [
        (np.int64(3), 3),
        (np.uint8(3), 3),
        (np.float32(0.5), 0.5),
        (np.bool_(True), True),
        (np.float64("nan"), None),
        (np.uint64(2**63 - 1), 2**63 - 1),
        (np.uint64(2**63), "9223372036854775808"),
        (-(2**63), -(2**63)),
        (-(2**63) - 1, "-9223372036854775809"),
        (MAX_INTEGER, "18446744073709551616"),
        (np.str_("a"), "a"),
        (Fraction(1, 2), 0.5),
        ("a\0b", "ab"),
        ("a\ud800b", "a\ufffdb"),
        (float("inf"), None),
    ],
)
def test_scalars_of_other_types(given_value: object, wanted: object) -> None:
    ((_, found),) = plain_attributes({"x": given_value})
    assert found == wanted
    assert type(found) is type(wanted)


def test_other_types_are_refused() -> None:
    with pytest.raises(ValueError, match="attribute 'x' is of type list"):
        plain_attributes({"x": [1]})


def test_a_record_with_attributes_is_frozen_and_a_key() -> None:
    one = figure("a", ZURICH, {"year": 1893, "artist": None})
    assert one.attributes == (("year", 1893), ("artist", None))
    assert {one: 1}[replace(one)] == 1
    assert describe(one) == describe(replace(one, contents=("other.glb",)))
    assert describe(one) != describe(replace(one, attributes=(("year", 1894), ("artist", None))))
    assert not hasattr(one, "__dict__")
    with pytest.raises(FrozenInstanceError):
        one.attributes = ()  # type: ignore[misc]


@given(st.lists(column_names, max_size=8).map(tuple), st.lists(column_names, max_size=4).map(tuple))
def test_names_are_free_and_kept_where_they_can(names: tuple[str, ...], taken: tuple[str, ...]) -> None:
    found = free_names(names, taken)
    folded = [name.casefold() for name in found]
    assert len(set(folded)) == len(found) == len(names)
    assert not set(folded) & {name.casefold() for name in taken}
    assert all(found)
    assert free_names(found, taken) == found
    for name, new in zip(names, found, strict=True):
        alike = [each for each in (*names, *taken) if each.casefold() == name.casefold()]
        if len(alike) == 1 and name:
            assert new == name


def test_names_of_a_clash() -> None:
    names = ("Name", "name", "name_2", "", "x", "MODEL")
    assert free_names(names, tuple(OWN_PROPERTIES)) == ("Name_3", "name_4", "name_2", "column", "x", "MODEL_2")


@settings(max_examples=30, deadline=None)
@given(tables())
def test_own_properties_win_and_all_rows_have_the_same(figures: list[PlacedFigure]) -> None:
    for each in figures:
        properties = feature(each, "a.glb")["properties"]
        plain = feature(replace(each, attributes=()), "a.glb")["properties"]
        assert list(properties)[: len(plain)] == list(plain) == list(OWN_PROPERTIES)
        assert {name: properties[name] for name in plain} == plain
        assert list(properties.values())[len(plain) :] == [value for _, value in each.attributes]
    assert len({tuple(feature(each, None)["properties"]) for each in figures}) <= 1


def test_the_declared_types_are_those_of_the_values() -> None:
    doubtful = replace(figure("a", ZURICH), score=0.5, doubts="unsure of l_hand")
    properties = feature(doubtful, "a.glb")["properties"]
    assert all(isinstance(properties[name], kind) for name, kind in OWN_PROPERTIES.items())
