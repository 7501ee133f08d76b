"""Check of a record's fields against their annotations: records read from files are not trusted."""

from __future__ import annotations

import dataclasses
import functools
import types
from collections.abc import Mapping
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from georef.untrusted.damage import DamagedFile


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


@functools.cache
def _needed(kind: type) -> frozenset[str]:
    none = dataclasses.MISSING
    fields = dataclasses.fields(kind)
    return frozenset(each.name for each in fields if each.default is none and each.default_factory is none)


def check_fields(kind: type, fields: Mapping[str, Any]) -> None:
    """Raise DamagedFile unless the fields are those of a dataclass and each fits its annotation.

    Arrays must have the annotated dtype; the record itself checks their shapes.
    """
    hints = _hints(kind)
    known = {field.name for field in dataclasses.fields(kind)}
    if unknown := fields.keys() - known:
        raise DamagedFile(f"{kind.__name__} has no {sorted(map(str, unknown))[0][:40]}")
    if missing := _needed(kind) - fields.keys():
        raise DamagedFile(f"{kind.__name__} without {sorted(missing)[0]}")
    for name, value in fields.items():
        if not fits(value, hints[name]):
            raise DamagedFile(f"{kind.__name__}.{name} is {type(value).__name__}")


def fits(value: Any, hint: Any) -> bool:
    """Whether a value is of an annotated type: a class, a union, or a tuple, mapping, array or choice of such."""
    origin, arguments = get_origin(hint), get_args(hint)
    if hint is Any:
        return True
    if origin in (Union, types.UnionType):
        return any(fits(value, each) for each in arguments)
    if origin is Literal:
        return value in arguments
    if origin is tuple:
        if not isinstance(value, tuple):
            return False
        if arguments[-1:] == (Ellipsis,):
            return all(fits(each, arguments[0]) for each in value)
        return len(value) == len(arguments) and all(map(fits, value, arguments))
    if origin is np.ndarray:
        return isinstance(value, np.ndarray) and value.dtype == np.dtype(get_args(arguments[1])[0])
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return isinstance(value, Mapping) and all(
            fits(key, arguments[0]) and fits(item, arguments[1]) for key, item in value.items()
        )
    if hint is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if hint is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return isinstance(value, type(None) if hint is None else hint)


def records_in(hint: Any) -> dict[str, type]:
    """Every record (dataclass) in values of an annotated type, by its name."""
    found: dict[str, type] = {}
    pending = [hint]
    while pending:
        each = pending.pop()
        if isinstance(each, type) and dataclasses.is_dataclass(each):
            if found.setdefault(each.__name__, each) is not each:
                raise TypeError(f"two records are named {each.__name__}")
            pending += [kind for kind in _hints(each).values() if kind not in found.values()]
        else:
            pending += get_args(each)
    return found
