"""Options of commands, derived from the fields of their requests; imports nothing but click."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, TypeVar

import click

from fig2mesh.conversion.fields import RequestField, request_fields

F = TypeVar("F", bound=Callable[..., Any])

FILE = click.Path(path_type=Path)


def request_options(request: type, without: Collection[str] = ()) -> Callable[[F], Callable[..., Any]]:
    """Decorator that gives a command the options of a request's fields.

    The function gets the request as its first argument, and the values of its other options by name.

    without : names of fields that the command does not offer; they keep their defaults
    """
    fields = [field for field in request_fields(request) if field.field not in without]

    def decorate(function: F) -> Callable[..., Any]:
        @functools.wraps(function)
        def command(*args: Any, **values: Any) -> Any:
            return function(*args, request(**{field.field: values.pop(field.field) for field in fields}), **values)

        # The one applied last is listed first; arguments come in the order of their definition.
        for field in reversed(fields):
            command = parameter_of(field)(command)
        return command

    return decorate


def parameter_of(field: RequestField) -> Callable[[F], F]:
    """Decorator that adds a field to a command as an option or an argument."""
    facts, kind = field.option, field.type
    if facts.argument:
        return click.argument(field.field, type=value_type(field), metavar=facts.metavar or None)
    off = facts.negative or f"no-{field.flag[2:]}"
    names = [field.field, f"{field.flag}/--{off}" if field.default is True else field.flag]
    if facts.short:
        names.insert(1, f"-{facts.short}")
    if kind.kind is bool:
        shown = bool(field.default)
        return click.option(*names, default=field.default, help=facts.help, show_default=shown, is_flag=True)
    required = field.default is dataclasses.MISSING
    # To click a default of None is a value, and nothing is missing then.
    default: dict[str, Any] = {"required": True} if required else {"default": field.default}
    return click.option(
        *names,
        type=value_type(field),
        **default,
        nargs=kind.count,
        multiple=kind.many,
        metavar=facts.metavar or None,
        show_default=not facts.default_text and not required and field.default not in (None, "", ()),
        help=f"{facts.help}  [default: {facts.default_text}]" if facts.default_text else facts.help,
    )


def value_type(field: RequestField) -> Any:
    """Click type of one value of a field."""
    kind, low, high = field.type, field.option.low, field.option.high
    if kind.choices:
        return click.Choice(kind.choices)
    if kind.kind is Path:
        return FILE
    if kind.kind is int and (low is not None or high is not None):
        return click.IntRange(None if low is None else int(low), None if high is None else int(high))
    if kind.kind is float and (low is not None or high is not None):
        return click.FloatRange(low, high)
    return {int: click.INT, float: click.FLOAT, bool: click.BOOL, str: click.STRING}[kind.kind]


def messages(command: F) -> F:
    """Add the options --quiet and --verbose to a command."""
    command = click.option("-v", "--verbose", count=True, help="Print more messages; twice: also tracebacks.")(command)
    return click.option("-q", "--quiet", is_flag=True, help="Print errors only.")(command)
