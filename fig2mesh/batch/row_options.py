"""A row's values as options of the main job: they are read by the main job's own command line.

So every option of the main job is a column, under the same name, with the same checks and messages.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import click

from fig2mesh.batch.collections.rows import Value
from fig2mesh.errors import InputError

# fmt: off
OURS = ("output", "overwrite", "save-stages", "resume-from", "report", "quiet", "verbose", "tiles-version",
        "visible-from")
# fmt: on
"""Options of the main job that no row has: the batch chooses where things go and what is said."""

PAIRS = {"lonlat": ("lon", "lat"), "at": ("x", "y")}
"""Options of two numbers, and the columns of one number each that make them."""

OWN_COLUMNS = ("figure", "format", "date", *(column for pair in PAIRS.values() for column in pair))
"""Columns that are no option of the main job."""

OF_ONE = ("name", "lonlat", "at", "bbox", "mask", "keypoints", "part_labels")
"""Columns of which one value cannot hold for several rows."""

DATUMS = ("ellipsoid", "egm96")
"""Values of --altitude-datum that are no file."""

PATHS = ("mask", "keypoints", "part_labels", "map_sheet")
"""Parameters of the main job that name a file."""


@dataclass(frozen=True)
class RowOptions:
    """values : parameters of the main job by name, `figure` among them; formats : suffixes besides .glb, without dot;
    date : as in the row, None without; attributes : what the row says besides."""

    values: dict[str, Any]
    formats: tuple[str, ...]
    date: str | None
    attributes: dict[str, Value]


@cache
def _command() -> click.Command:
    from fig2mesh.commands.main import make

    return make


@cache
def _options() -> dict[str, click.Option]:
    """Column → option, for those a row may have."""
    return _columns(_command())


def _columns(command: click.Command) -> dict[str, click.Option]:
    found = {}
    for option in command.params:
        if isinstance(option, click.Option):
            name = max(option.opts, key=len).lstrip("-")
            if name not in OURS:
                found[name.replace("-", "_")] = option
    return found


def is_known(column: str) -> bool:
    """Whether a column (lower case, underscores) is an option or ours; else it is an attribute."""
    return column in OWN_COLUMNS or column in _options()


def forbidden(column: str) -> bool:
    """Whether a column names an option of the main job that rows cannot have."""
    return column.replace("_", "-") in OURS


def known_columns() -> list[str]:
    """Columns that are options of the main job."""
    return list(_options())


def defaults_of(main_job: click.Command) -> list[click.Option]:
    """The options of the main job that hold for all rows when they are given on the command line."""
    return [option for column, option in _columns(main_job).items() if column not in OF_ONE]


def row_defaults() -> list[click.Option]:
    """`defaults_of` the main job."""
    return defaults_of(_command())


def given_defaults(context: click.Context) -> dict[str, Any]:
    """Those of `row_defaults` that were given to the command of `context`: column → value."""
    given = {}
    for column, option in _options().items():
        source = context.get_parameter_source(option.name or "")
        if source in (click.core.ParameterSource.COMMANDLINE, click.core.ParameterSource.ENVIRONMENT):
            value = context.params[option.name or ""]
            file = isinstance(value, Path) or (column == "altitude_datum" and value not in DATUMS)
            given[column] = os.path.abspath(value) if file else value
    return given


def options_of(values: Mapping[str, Value], defaults: Mapping[str, Any], name: str) -> RowOptions:
    """What a row asks for.

    values : column → value; defaults : column → value where the row has none; name : of the figure

    Raises InputError naming the column.
    """
    for column in values:
        if forbidden(column):
            raise InputError(f"column {column}", "is chosen by the batch", "remove the column")
    both = {**_without_other_place(defaults, values), **values}
    # Of both, format and date are the batch's own: the main job has no such options.
    merged = {column: value for column, value in both.items() if column in _options()}
    for option, pair in PAIRS.items():
        given = [values[column] for column in pair if column in values]
        if len(given) == 1:
            missing = pair[1] if pair[0] in values else pair[0]
            raise InputError(f"column {missing}", "is empty", f"give both {pair[0]} and {pair[1]}")
        if given:
            if option in values:
                raise InputError(f"column {option}", f"beside {pair[0]} and {pair[1]}", "give it once")
            merged[option] = tuple(given)
    if "figure" not in values:
        raise InputError("column figure", "is empty", "name the picture of the figure")
    words = [*_words({**merged, "name": name}), "--", str(values["figure"])]
    try:
        context = _command().make_context("row", words)
    except click.ClickException as error:
        raise _as_column(error) from None
    formats = values.get("format", defaults.get("format", ()))
    return RowOptions(
        context.params,
        tuple(_listed(formats)),
        None if (date := values.get("date", defaults.get("date"))) is None else str(date),
        {column: value for column, value in values.items() if not is_known(column)},
    )


def _without_other_place(defaults: Mapping[str, Any], values: Mapping[str, Value]) -> dict[str, Any]:
    """The defaults without a place of the other kind than the row's: a row says it better."""
    if "lonlat" in values or "lon" in values or "lat" in values:
        return {column: value for column, value in defaults.items() if column not in ("map", "at")}
    if "map" in values:
        return {column: value for column, value in defaults.items() if column != "lonlat"}
    return dict(defaults)


def _words(merged: Mapping[str, Any]) -> Iterable[str]:
    for column, value in merged.items():
        option = _options()[column]
        flag = max(option.opts, key=len)
        if option.is_flag:
            yield flag if _truth(column, value) else option.secondary_opts[0]
        elif option.multiple:
            for each in _listed(value):
                yield from (flag, each)
        elif option.nargs > 1:
            numbers = _listed(value)
            if len(numbers) != option.nargs:
                found = f"{len(numbers)} values"
                raise InputError(f"column {column}", found, f"give {option.nargs}: {option.metavar}")
            yield from (flag, *numbers)
        else:
            yield from (flag, _text(value))


def _listed(value: Any) -> list[str]:
    """A list, or a text whose items are parted by spaces, commas or semicolons."""
    if isinstance(value, tuple | list):
        return [_text(item) for item in value]
    return _text(value).replace(",", " ").replace(";", " ").split()


def _text(value: Any) -> str:
    if isinstance(value, float) and value.is_integer() and abs(value) < 2**53:
        return str(int(value))  # tables keep whole numbers as floats, where one of them is missing
    return repr(value) if isinstance(value, float) else str(value)


def _truth(column: str, value: Any) -> bool:
    if isinstance(value, bool):
        return value
    text = str(value).strip().lower()
    if text in ("1", "1.0", "true", "yes", "on"):
        return True
    if text in ("0", "0.0", "false", "no", "off"):
        return False
    raise InputError(f"column {column}", f"{text[:40]!r}", "give true or false")


def _as_column(error: click.ClickException) -> InputError:
    """What click says of an option, said of the column."""
    text = " ".join(error.format_message().split()).rstrip(".")
    option = getattr(error, "param", None)
    if isinstance(option, click.Option):
        column = max(option.opts, key=len).lstrip("-").replace("-", "_")
        finding = text.split(": ", 1)[-1] if text.startswith("Invalid value") else text
        return InputError(f"column {column}", finding[:200], "see fig2mesh --help")
    return InputError("row", text[:200], "see fig2mesh --help")
