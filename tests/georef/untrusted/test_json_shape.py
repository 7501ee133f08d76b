"""Shapes of JSON documents: what fits, and how the first member that does not is named."""

from __future__ import annotations

from typing import Any

import pytest

from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_shape import NUMBER, WHOLE, Needed, Nullable, Numbers, Values, check_shape

SHAPE = {"items": [{"count": Needed(WHOLE), "name": str, "at": Numbers(2), "scale": NUMBER}], "scene": Nullable(WHOLE)}


@pytest.mark.parametrize(
    "value",
    [
        {},
        {"items": [], "scene": None, "other": 3},
        {"items": [{"count": 0, "name": "", "at": [1, 2.5], "scale": -1}, {"count": 2**53}], "scene": 1},
    ],
)
def test_what_fits(value: Any) -> None:
    check_shape(value, SHAPE)


@pytest.mark.parametrize(
    ("value", "finding"),
    [
        ([], "the document is no object"),
        ({"items": {}}, "/items is no array"),
        ({"items": [3]}, "/items/0 is no object"),
        ({"items": [{}]}, "/items/0 has no count"),
        ({"items": [{"count": 1}, {"count": -1}]}, "/items/1/count is no whole number"),
        ({"items": [{"count": True}]}, "/items/0/count is no whole number"),
        ({"items": [{"count": 1.0}]}, "/items/0/count is no whole number"),
        ({"items": [{"count": 2**53 + 1}]}, "/items/0/count is no whole number"),
        ({"items": [{"count": 1, "name": None}]}, "/items/0/name is no text"),
        ({"items": [{"count": 1, "at": [1]}]}, "/items/0/at is no array of 2 numbers"),
        ({"items": [{"count": 1, "at": [1, "2"]}]}, "/items/0/at is no array of 2 numbers"),
        ({"items": [{"count": 1, "scale": False}]}, "/items/0/scale is no number"),
        ({"scene": []}, "/scene is no whole number"),
    ],
)
def test_what_does_not_fit_is_named_by_its_path(value: Any, finding: str) -> None:
    with pytest.raises(DamagedFile, match=f"^{finding}$"):
        check_shape(value, SHAPE)


def test_members_of_any_name() -> None:
    check_shape({"a": True, "b": False}, Values(bool))
    with pytest.raises(DamagedFile, match=r"^/b is no true or false$"):
        check_shape({"a": True, "b": 0}, Values(bool))
