"""Validation of JSON documents against a shape before a reader uses them.

A shape defines the allowed type of each member:

- `str`, `bool`, `dict`, `list`: a string, true or false, any object, any array; `INDEX`: an integer, 0 or more;
  `NUMBER`: any number; `Numbers(n)`: an array of n numbers
- `{"name": shape}`: an object; members that are not named here are ignored, and named ones may be missing unless
  their shape is `Required(shape)`
- `Values(shape)`: an object with members of any names; `[shape]`: an array of such values
- `Nullable(shape)`: the same, or null
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from georef.untrusted.damage import DamagedFile

MAX_INDEX = 2**53
"""Limit of integers that count bytes and items: the largest that a float64 holds exactly."""


@dataclass(frozen=True)
class Required:
    """A required member."""

    shape: Any


@dataclass(frozen=True)
class Nullable:
    """A value that may be null instead."""

    shape: Any


@dataclass(frozen=True)
class Values:
    """An object whose members all have one shape, under any names."""

    shape: Any


@dataclass(frozen=True)
class Numbers:
    """An array of numbers; count : its length, None for any."""

    count: int | None = None


@dataclass(frozen=True)
class _Kind:
    name: str


INDEX, NUMBER = _Kind("a non-negative integer"), _Kind("a number")

KINDS = {str: "a string", bool: "true or false", dict: "an object", list: "an array"}


def check_shape(value: Any, shape: Any, where: str = "") -> None:
    """Raise DamagedFile, naming the JSON path, unless a value has the shape; where : the path of the value."""
    match shape:
        case Required():
            check_shape(value, shape.shape, where)
        case Nullable():
            if value is not None:
                check_shape(value, shape.shape, where)
        case dict():
            _require(isinstance(value, dict), where, "an object")
            for name, inner in shape.items():
                if name in value:
                    check_shape(value[name], inner, f"{where}/{name}")
                elif isinstance(inner, Required):
                    raise DamagedFile(f"{where or '/'} has no {name}")
        case Values():
            _require(isinstance(value, dict), where, "an object")
            for name, each in value.items():
                check_shape(each, shape.shape, f"{where}/{name[:40]}")
        case list():
            _require(isinstance(value, list), where, "an array")
            for index, each in enumerate(value):
                check_shape(each, shape[0], f"{where}/{index}")
        case Numbers():
            right = isinstance(value, list) and (shape.count is None or len(value) == shape.count)
            _require(
                right and all(map(is_number, value)),
                where,
                f"an array of {shape.count} numbers" if shape.count else "an array of numbers",
            )
        case _Kind():
            _require(is_index(value) if shape is INDEX else is_number(value), where, shape.name)
        case _:
            _require(isinstance(value, shape), where, KINDS[shape])


def is_number(value: Any) -> bool:
    """Whether a value is a number; true and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_index(value: Any) -> bool:
    """Whether a value is an integer from 0 to `MAX_INDEX`."""
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= MAX_INDEX


def _require(right: bool, where: str, name: str) -> None:
    if not right:
        raise DamagedFile(f"{where or 'the document'} is not {name}")
