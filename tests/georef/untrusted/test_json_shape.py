"""Shapes of JSON documents: valid ones, and the message for the first invalid member."""

from __future__ import annotations

from typing import Any

import pytest

from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_shape import INDEX, NUMBER, Nullable, Numbers, Required, Values, check_shape

SHAPE = {
    "items": [{"count": Required(INDEX), "name": str, "at": Numbers(2), "scale": NUMBER}],
    "scene": Nullable(INDEX),
}


@pytest.mark.parametrize(
    "value",
    [
        {},
        {"items": [], "scene": None, "other": 3},
        {"items": [{"count": 0, "name": "", "at": [1, 2.5], "scale": -1}, {"count": 2**53}], "scene": 1},
    ],
)
def test_valid_documents(value: Any) -> None:
    check_shape(value, SHAPE)


@pytest.mark.parametrize(
    ("value", "finding"),
    [
        ([], "the document is not an object"),
        ({"items": {}}, "/items is not an array"),
        ({"items": [3]}, "/items/0 is not an object"),
        ({"items": [{}]}, "/items/0 has no count"),
        ({"items": [{"count": 1}, {"count": -1}]}, "/items/1/count is not a non-negative integer"),
        ({"items": [{"count": True}]}, "/items/0/count is not a non-negative integer"),
        ({"items": [{"count": 1.0}]}, "/items/0/count is not a non-negative integer"),
        ({"items": [{"count": 2**53 + 1}]}, "/items/0/count is not a non-negative integer"),
        ({"items": [{"count": 1, "name": None}]}, "/items/0/name is not a string"),
        ({"items": [{"count": 1, "at": [1]}]}, "/items/0/at is not an array of 2 numbers"),
        ({"items": [{"count": 1, "at": [1, "2"]}]}, "/items/0/at is not an array of 2 numbers"),
        ({"items": [{"count": 1, "scale": False}]}, "/items/0/scale is not a number"),
        ({"scene": []}, "/scene is not a non-negative integer"),
    ],
)
def test_invalid_members_are_named_by_their_path(value: Any, finding: str) -> None:
    with pytest.raises(DamagedFile, match=f"^{finding}$"):
        check_shape(value, SHAPE)


def test_members_of_any_name() -> None:
    check_shape({"a": True, "b": False}, Values(bool))
    with pytest.raises(DamagedFile, match=r"^/b is not true or false$"):
        check_shape({"a": True, "b": 0}, Values(bool))
