"""The members of a JSON document that a reader is going to use, checked before it does.

A shape says of each member which kind of value it may be:

- `str`, `bool`, `dict`, `list`: a text, true or false, any object, any array; `WHOLE`: a whole number, 0 or more;
  `NUMBER`: any number; `Numbers(n)`: an array of so many numbers
- `{"name": shape}`: an object; members that are not named here are left alone, and those that are may be missing
  unless their shape is `Needed(shape)`
- `Values(shape)`: an object with members of any names; `[shape]`: an array
- `Nullable(shape)`: the same, or null
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from georef.untrusted.damage import DamagedFile

MAX_INDEX = 2**53
"""Whole numbers count bytes and items; more than this no other program can count either."""


@dataclass(frozen=True)
class Needed:
    """A member that has to be there."""

    shape: Any


@dataclass(frozen=True)
class Nullable:
    """A value that may be null instead."""

    shape: Any


@dataclass(frozen=True)
class Values:
    """An object whose members have one shape, whatever their names."""

    shape: Any


@dataclass(frozen=True)
class Numbers:
    """An array of numbers; count : of how many, None for any."""

    count: int | None = None


@dataclass(frozen=True)
class _Kind:
    name: str


WHOLE, NUMBER = _Kind("whole number"), _Kind("number")

KINDS = {str: "text", bool: "true or false", dict: "object", list: "array"}


def check_shape(value: Any, shape: Any, where: str = "") -> None:
    """Raise DamagedFile, naming the JSON path, where a value has not the shape; where : the path of the value."""
    match shape:
        case Needed():
            check_shape(value, shape.shape, where)
        case Nullable():
            if value is not None:
                check_shape(value, shape.shape, where)
        case dict():
            _demand(isinstance(value, dict), where, "object")
            for name, inner in shape.items():
                if name in value:
                    check_shape(value[name], inner, f"{where}/{name}")
                elif isinstance(inner, Needed):
                    raise DamagedFile(f"{where or '/'} has no {name}")
        case Values():
            _demand(isinstance(value, dict), where, "object")
            for name, each in value.items():
                check_shape(each, shape.shape, f"{where}/{name[:40]}")
        case list():
            _demand(isinstance(value, list), where, "array")
            for index, each in enumerate(value):
                check_shape(each, shape[0], f"{where}/{index}")
        case Numbers():
            right = isinstance(value, list) and (shape.count is None or len(value) == shape.count)
            _demand(right and all(map(is_number, value)), where, f"array of {shape.count or ''} numbers")
        case _Kind():
            _demand(is_whole(value) if shape is WHOLE else is_number(value), where, shape.name)
        case _:
            _demand(isinstance(value, shape), where, KINDS[shape])


def is_number(value: Any) -> bool:
    """Whether a value is a number: true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_whole(value: Any) -> bool:
    """Whether a value is a whole number from 0 on that can count something."""
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= MAX_INDEX


def _demand(right: bool, where: str, name: str) -> None:
    if not right:
        raise DamagedFile(f"{where or 'the document'} is no {name}")
