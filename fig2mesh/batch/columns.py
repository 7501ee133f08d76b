"""Columns of a collection as fields of requests.

Every field of `fig2mesh.conversion.request.Request` is a column under its option's name, except for those that the
batch sets itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from fig2mesh.batch.collections.rows import Value
from fig2mesh.batch.collections.values import TO_DEGREES
from fig2mesh.conversion.fields import RequestField, parse_value, request_fields
from fig2mesh.conversion.request import Request
from fig2mesh.errors import InputError

PAIRS = {"lonlat": ("lon", "lat"), "at": ("x", "y")}
"""Fields of two numbers, and the two columns that make up each."""

# fmt: off
LIKELY_PLACES = frozenset((
    "easting", "northing", "east", "north", "e", "n", "utm_e", "utm_n", "xcoord", "ycoord", "x_coord", "y_coord",
    "point_x", "point_y", "coord_x", "coord_y", "longitud", "latitud", "longitude_deg", "latitude_deg", "laenge",
    "länge", "breite", "lon_dd", "lat_dd", "lonx", "laty", "rechtswert", "hochwert", "coordinates", "coords",
    "location", "latlon", "lat_lon", "latlong", "lat_long", "geometry", "geom", "the_geom", "shape",
))
# fmt: on
"""Names of columns that may hold a place, but of which kind is not clear."""

OWN_COLUMNS = ("figure", "format", "date", *(column for pair in PAIRS.values() for column in pair))
"""Columns that are not options of the main command."""


@cache
def fields_by_column() -> dict[str, RequestField]:
    """Field of each column that is an option of the main command."""
    fields = request_fields(Request)
    return {field.name: field for field in fields if field.option.column and not field.option.argument}


@cache
def _refused() -> frozenset[str]:
    return frozenset(field.name for field in request_fields(Request) if not field.option.column)


def shared_fields() -> list[RequestField]:
    """Fields whose value can be given on the command line for all rows."""
    return [field for field in fields_by_column().values() if field.option.shared]


def is_known(column: str) -> bool:
    """Whether a column is an option or one of `OWN_COLUMNS`; else it is an attribute."""
    return column in OWN_COLUMNS or column in fields_by_column()


def request_of(values: Mapping[str, Value], defaults: Mapping[str, Any], name: str) -> Request:
    """Request of a row.

    values : by column; defaults : by column, where the row has none; name : of the figure

    Raises InputError naming the column.
    """
    for column in values:
        if column in _refused():
            raise InputError(f"column {column}", "is set by the batch", "remove the column")
    fields = fields_by_column()
    found = _without_other_place({column: defaults[column] for column in defaults if column in fields}, values)
    found |= {
        column: parse_value(fields[column], value, f"column {column}")
        for column, value in values.items()
        if column in fields
    }
    found |= _pairs(values)
    if "figure" not in values:
        raise InputError("column figure", "is empty", "name the picture of the figure")
    given = {fields[column].field: value for column, value in found.items()}
    try:
        return Request(**given | {"figure": str(values["figure"]), "name": name})
    except InputError as error:
        raise InputError(_column_of(error.source), error.finding, error.remedy) from None


def attributes_of(values: Mapping[str, Value]) -> dict[str, Value]:
    """Values of a row that are not options."""
    return {column: value for column, value in values.items() if not (is_known(column) or column in _refused())}


def _pairs(values: Mapping[str, Value]) -> dict[str, Any]:
    found = {}
    for name, pair in PAIRS.items():
        given = [values[column] for column in pair if column in values]
        if len(given) == 1:
            missing = pair[1] if pair[0] in values else pair[0]
            raise InputError(f"column {missing}", "is empty", f"give both {pair[0]} and {pair[1]}")
        if given:
            if name in values:
                raise InputError(
                    f"column {name}", f"cannot be combined with {pair[0]} and {pair[1]}", "give one of them"
                )
            if name == "lonlat":
                _check_degrees(*given)
            found[name] = parse_value(fields_by_column()[name], tuple(given), f"column {pair[0]}")
    return found


def _check_degrees(lon: Value, lat: Value) -> None:
    """Raise InputError for numbers that cannot be longitude and latitude, WGS 84 degrees."""
    for column, value, limit, other in (("lat", lat, 90, lon), ("lon", lon, 180, lat)):
        if isinstance(value, int | float) and abs(value) > limit:
            swapped = column == "lat" and isinstance(other, int | float) and abs(value) <= 180 and abs(other) <= 90
            remedy = "are lon and lat swapped?" if swapped else f"give degrees, or transform it first ({TO_DEGREES})"
            name = "latitude" if column == "lat" else "longitude"
            raise InputError(f"column {column}", f"{name} {value:.15g} is outside -{limit}..{limit}", remedy)


def no_place(request: Request, attributes: Mapping[str, Value]) -> InputError:
    """Error of a row without a place; it names what could be meant as one."""
    if request.at is not None:
        x, y = request.at
        if abs(x) <= 180 and abs(y) <= 90:
            remedy = "give map; or name the columns lon and lat, if they are degrees"
        else:
            remedy = f"give map; or, if they are metres, transform them ({TO_DEGREES}) and name them lon and lat"
        return InputError("columns x, y", f"{x:.15g} and {y:.15g} are pixels, but of no map", remedy)
    if found := [column for column in attributes if column in LIKELY_PLACES]:
        remedy = f"name them lon and lat if they are degrees (WGS 84); transform them first if not ({TO_DEGREES})"
        return InputError(f"columns {', '.join(found[:4])}", "are not read as a place, and there is no other", remedy)
    return InputError("columns lon, lat", "no place", "give lon and lat, or map, x and y; or use --unplaced")


def _without_other_place(defaults: dict[str, Any], values: Mapping[str, Value]) -> dict[str, Any]:
    """Defaults without a place of another kind than the row's, which takes precedence."""
    if "lonlat" in values or "lon" in values or "lat" in values:
        return {column: value for column, value in defaults.items() if column not in ("map", "at")}
    if "map" in values:
        return {column: value for column, value in defaults.items() if column != "lonlat"}
    return defaults


def _column_of(source: str) -> str:
    """Source of a message: an option becomes the column of the same name."""
    return f"column {source[2:].replace('-', '_')}" if source.startswith("--") else source
