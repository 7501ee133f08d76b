"""Fields of requests: name, meaning and permitted values of each, defined once.

The options of the command line and the columns of collections are read from them; see `fig2mesh.commands.options` and
`fig2mesh.batch.columns`. Nothing heavy is imported.
"""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, cast, dataclass_transform, get_args, get_origin, get_type_hints

from fig2mesh.conversion.cells import FALSE, TRUE, NotNumber, number_of, whole_number_of
from fig2mesh.errors import InputError

T = TypeVar("T")

OPTION = "option"
"""Key of the metadata of a field."""


@dataclass(frozen=True)
class Option:
    """Description of a field for the command line.

    help : one or two sentences
    name : of the option and the column, without leading dashes; "" for the field's own name
    short : letter, such as "o" for -o
    metavar : placeholder for the value in the help; "" to derive it from the type
    low, high : limits of a number, inclusive
    default_text : shown as the default in place of the field's own
    negative : name of the option that sets a Boolean to false, if not --no-NAME
    argument : whether it is a positional argument of the command line
    column : whether a row of a collection can have it
    shared : whether one value can hold for all rows of a collection
    """

    help: str
    name: str = ""
    short: str = ""
    metavar: str = ""
    low: float | None = None
    high: float | None = None
    default_text: str = ""
    negative: str = ""
    argument: bool = False
    column: bool = True
    shared: bool = True


def option(*, default: Any = dataclasses.MISSING, kw_only: bool = True, **facts: Any) -> Any:
    """A field of a request; facts : fields of its `Option`."""
    return dataclasses.field(default=default, kw_only=kw_only, metadata={OPTION: Option(**facts)})


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(option,))
def request_class(made: type[T]) -> type[T]:
    """Make a class a frozen dataclass whose fields are made by `option`; its docstring gets a line for each."""
    request = dataclass(frozen=True, kw_only=True)(made)
    lines = [f"{each.name} : {each.type}\n    {each.metadata[OPTION].help}" for each in _options_of(request)]
    request.__doc__ = "\n".join([made.__doc__ or "", "", "Parameters", "----------", *lines])
    return request


def _options_of(request: Any) -> list[dataclasses.Field[Any]]:
    """Fields with an option, the positional ones first."""
    found = [each for each in dataclasses.fields(request) if OPTION in each.metadata]
    return sorted(found, key=lambda each: each.kw_only is True)


@dataclass(frozen=True)
class FieldType:
    """Type of a field's value.

    kind : of one item: str, int, float, bool or Path
    choices : the values that a text may have; () where any is allowed
    count : items of a tuple of fixed length; 1 for a single value
    many : whether the value is a tuple of any length
    optional : whether it may be None
    """

    kind: type
    choices: tuple[str, ...] = ()
    count: int = 1
    many: bool = False
    optional: bool = False


@dataclass(frozen=True)
class RequestField:
    """A field of a request: its name in Python, type, default and option."""

    field: str
    type: FieldType
    default: Any
    option: Option

    @property
    def name(self) -> str:
        """Name of the column, with underscores."""
        return self.option.name or self.field

    @property
    def flag(self) -> str:
        """Name of the option, with dashes."""
        return "--" + self.name.replace("_", "-")


@functools.cache
def request_fields(request: type) -> tuple[RequestField, ...]:
    """Fields of a request in the order in which they are defined, those of its base classes first."""
    hints = get_type_hints(request)
    found = []
    for each in dataclasses.fields(cast(Any, request)):
        if OPTION in each.metadata:
            found.append(RequestField(each.name, _type_of(hints[each.name]), each.default, each.metadata[OPTION]))
    return tuple(found)


def _type_of(hint: Any) -> FieldType:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        (inner,) = (each for each in arguments if each is not NoneType)
        return dataclasses.replace(_type_of(inner), optional=True)
    if origin is tuple:
        inner = _type_of(arguments[0])
        if arguments[-1] is Ellipsis:
            return dataclasses.replace(inner, many=True)
        return dataclasses.replace(inner, count=len(arguments))
    if origin is Literal:
        return FieldType(str, arguments)
    if hint not in (str, int, float, bool, Path):
        raise TypeError(f"{hint}: expected text, a number, a truth value, a path, a choice, or a tuple of these")
    return FieldType(hint)


def check_fields(request: Any) -> None:
    """Convert the fields of a request to their types (text to paths, integers to floats) and check their values.

    Raises InputError naming the option.
    """
    kind: type = type(request)
    for each in request_fields(kind):
        value = _checked(each, getattr(request, each.field))
        object.__setattr__(request, each.field, value)


def _checked(field: RequestField, value: Any) -> Any:
    if value is None and field.type.optional:
        return None
    if field.type.many or field.type.count > 1:
        if isinstance(value, str | Path) and field.type.many:
            value = (value,)
        try:
            items = tuple(value)
        except TypeError:
            raise _unexpected(field, value) from None
        if field.type.count > 1 and len(items) != field.type.count:
            raise InputError(field.flag, f"{len(items)} values", f"give {field.type.count}: {field.option.metavar}")
        return tuple(_item(field, item) for item in items)
    return _item(field, value)


def _item(field: RequestField, value: Any) -> Any:
    kind = field.type.kind
    if kind is Path and isinstance(value, str | Path):
        return Path(value)
    if kind is float and isinstance(value, int | float) and not isinstance(value, bool):
        value = float(value)
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise _unexpected(field, value)
    if field.type.choices and value not in field.type.choices:
        raise InputError(field.flag, f"unknown value {value!r}", f"choose from {', '.join(field.type.choices)}")
    low, high, number = field.option.low, field.option.high, cast(float, value)
    if (low is not None and not number >= low) or (high is not None and not number <= high):
        raise InputError(field.flag, f"{value} is out of range", f"give a value {_range(low, high)}")
    return value


def _unexpected(field: RequestField, value: Any) -> InputError:
    return InputError(field.flag, f"unexpected {type(value).__name__} {value!r:.40}", f"give {_described(field.type)}")


def _described(kind: FieldType) -> str:
    name = {Path: "a path", float: "a number", int: "a whole number", bool: "True or False", str: "text"}[kind.kind]
    if kind.count > 1:
        return f"{kind.count} values, each {name}"
    return f"a tuple, each item {name}" if kind.many else name


def _range(low: float | None, high: float | None) -> str:
    if low is None:
        return f"of at most {high:g}"
    return f"of at least {low:g}" if high is None else f"between {low:g} and {high:g}"


def parse_value(field: RequestField, raw: object, source: str) -> Any:
    """Parse a field's value from a cell of a table: a text, a number, a truth value, or a tuple of these.

    Items of a list in a text are separated by spaces, commas or semicolons. source : named in messages

    Raises InputError.
    """
    if field.type.many or field.type.count > 1:
        items = list_of(raw)
        if field.type.count > 1 and len(items) != field.type.count:
            raise InputError(source, f"{len(items)} values", f"give {field.type.count}: {field.option.metavar}")
        return tuple(_parse_item(field, item, source) for item in items)
    return _parse_item(field, raw, source)


def _parse_item(field: RequestField, raw: object, source: str) -> Any:
    kind, text = field.type.kind, cell_text(raw)
    if kind is bool:
        return _truth(raw, source)
    if kind is Path:
        return Path(text)
    if kind is str:
        return text
    try:
        return whole_number_of(text.strip(), text[:40]) if kind is int else number_of(text.strip(), text[:40])
    except NotNumber as error:
        raise InputError(source, error.finding, error.remedy) from None


def list_of(raw: object) -> list[str]:
    """Items of a list, or of a text in which spaces, commas or semicolons separate them."""
    if isinstance(raw, tuple | list):
        return [cell_text(item) for item in raw]
    return cell_text(raw).replace(",", " ").replace(";", " ").split()


def cell_text(raw: object) -> str:
    """Text of a cell; whole numbers without a point."""
    if isinstance(raw, float) and raw.is_integer() and abs(raw) < 2**53:
        return str(int(raw))  # tables keep whole numbers as floats, where one of them is missing
    return repr(raw) if isinstance(raw, float) else str(raw)


def _truth(raw: object, source: str) -> bool:
    text = str(raw).strip().lower()
    if text in TRUE:
        return True
    if text in FALSE:
        return False
    raise InputError(source, f"{text[:40]!r} is not a truth value", "give true or false")


def as_plain(request: Any) -> dict[str, Any]:
    """Fields of a request that differ from their defaults, as JSON values that the class accepts as arguments."""
    found: dict[str, Any] = {}
    kind: type = type(request)
    for field in request_fields(kind):
        value = getattr(request, field.field)
        if value != field.default:
            found[field.field] = str(value) if isinstance(value, Path) else value
    return found
