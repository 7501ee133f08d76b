"""Columns of collections as fields of requests."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from fig2mesh.batch.collections.rows import Row
from fig2mesh.batch.columns import OWN_COLUMNS, fields_by_column, is_known, request_of, shared_fields
from fig2mesh.batch.task import RowTask
from fig2mesh.batch.tasks import FORMATS, make_task
from fig2mesh.commands.options import request_options
from fig2mesh.conversion.fields import parse_value, request_fields
from fig2mesh.conversion.request import Request
from fig2mesh.errors import InputError


def task_of(values: dict[str, Any], defaults: dict[str, Any]) -> RowTask:
    return make_task(Row(1, "line 2", values), "n", "n", defaults)


def test_every_field_of_a_request_is_a_column_or_chosen_by_the_batch() -> None:
    names = {field.name for field in request_fields(Request)}
    chosen = {"output", "overwrite", "save_stages", "resume_from", "report", "tiles_version", "visible_from"}
    assert names - chosen - {"figure"} == set(fields_by_column())
    assert chosen <= names
    assert all(is_known(column) for column in (*fields_by_column(), *OWN_COLUMNS))
    assert not is_known("artist")


@given(st.floats(-180, 180), st.floats(-90, 90), st.integers(200, 2_000_000), st.floats(0.5, 100))
def test_values_arrive_as_on_the_command_line(lon: float, lat: float, triangles: int, height: float) -> None:
    import click

    found: list[Request] = []
    command = click.command()(request_options(Request)(found.append))
    words = ["a.png", "--lonlat", repr(lon), repr(lat), "--triangles", str(triangles), "--height-m", repr(height)]
    assert CliRunner().invoke(command, [*words, "--name", "n"]).exit_code == 0
    row = {"figure": "a.png", "lon": lon, "lat": lat, "triangles": triangles, "height_m": height}
    assert found == [request_of(row, {}, "n")]


@pytest.mark.parametrize(
    ("column", "value", "parameter", "expected"),
    [
        ("bbox", "1 2 30 40", "bbox", (1, 2, 30, 40)),
        ("bbox", (1, 2, 30.0, 40), "bbox", (1, 2, 30, 40)),
        ("lonlat", "8.5, 47.4", "lonlat", (8.5, 47.4)),
        ("effect", "light;light", "effects", ("light", "light")),
        ("effect", ("light",), "effects", ("light",)),
        ("evidence", "pixels", "evidence", "pixels"),
        ("seed", 7.0, "seed", 7),
        ("height_m", "2.5", "height_m", 2.5),
        ("mask", "m.png", "mask", Path("m.png")),
        ("map", "sheet.tif", "map", Path("sheet.tif")),
        ("credit", "-not an option", "credit", "-not an option"),
        ("facing", "NE", "facing", "NE"),
    ],
)
def test_values_of_any_kind(column: str, value: Any, parameter: str, expected: Any) -> None:
    assert getattr(request_of({"figure": "a.png", column: value}, {}, "n"), parameter) == expected


@pytest.mark.parametrize(("value", "expected"), [("no", False), (True, True), (0.0, False), ("yes", True)])
def test_truth_values_of_tables(value: Any, expected: bool) -> None:
    (field,) = [each for each in request_fields(Request) if each.field == "overwrite"]
    assert parse_value(field, value, "column x") is expected
    with pytest.raises(InputError, match="column x: 'maybe' is not a truth value; give true or false"):
        parse_value(field, "maybe", "column x")


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({}, "column figure: is empty; name the picture of the figure"),
        ({"figure": "a", "lon": 8.0}, "column lat: is empty; give both lon and lat"),
        ({"figure": "a", "y": 8.0}, "column x: is empty; give both x and y"),
        (
            {"figure": "a", "lon": 1, "lat": 2, "lonlat": "1 2"},
            "column lonlat: cannot be combined with lon and lat; give one of them",
        ),
        ({"figure": "a", "lonlat": "1"}, "column lonlat: 1 values; give 2: LON LAT"),
        (
            {"figure": "a", "quality": "superb"},
            "column quality: unknown value 'superb'; choose from draft",
        ),
        ({"figure": "a", "triangles": "many"}, "column triangles: 'many' is not a whole number"),
        ({"figure": "a", "seed": -1}, "column seed: -1 is out of range"),
        ({"figure": "a", "evidence": "maybe"}, "column evidence: unknown value 'maybe'; choose from parts"),
        ({"figure": "a", "output": "b.glb"}, "column output: is set by the batch; remove the column"),
        ({"figure": "a", "overwrite": True}, "column overwrite: is set by the batch"),
        ({"figure": "a", "save_stages": "x"}, "column save_stages: is set by the batch"),
    ],
)
def test_errors_name_the_column(row: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        request_of(row, {}, "n")
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_a_row_goes_before_the_defaults() -> None:
    defaults = {"quality": "fine", "map": "/sheet.tif", "effect": ("none",), "seed": 3}
    bare = request_of({"figure": "a", "x": 1, "y": 2}, defaults, "n")
    assert (bare.quality, bare.map, bare.effects, bare.at) == ("fine", Path("/sheet.tif"), ("none",), (1.0, 2.0))
    own = request_of({"figure": "a", "lon": 1, "lat": 2, "quality": "draft", "effect": "light"}, defaults, "n")
    assert (own.quality, own.map, own.effects, own.seed) == ("draft", None, ("light",), 3)
    other = request_of({"figure": "a", "map": "other.tif"}, {"lonlat": (1.0, 2.0)}, "n")
    assert (other.lonlat, other.map) == (None, Path("other.tif"))


@pytest.mark.parametrize("suffix", FORMATS)
def test_format_and_date_of_the_command_line_hold_for_rows_without(suffix: str) -> None:
    bare = task_of({"figure": "a"}, {"format": (suffix,), "date": "1893"})
    assert (bare.formats, bare.date) == ((suffix,), "1893")
    own = task_of({"figure": "a", "format": "ply", "date": 1895}, {"format": (suffix,), "date": "1893"})
    assert (own.formats, own.date) == (("ply",), "1895")
    assert bare.request == task_of({"figure": "a"}, {}).request


def test_what_is_no_option_is_an_attribute() -> None:
    found = task_of({"figure": "a", "artist": "Anna", "year": 1893, "date": 1893, "format": "usdz ply"}, {})
    assert found.attributes == {"artist": "Anna", "year": 1893}
    assert (found.date, found.formats) == ("1893", ("usdz", "ply"))


def test_options_of_one_figure_are_no_defaults() -> None:
    names = {field.name for field in shared_fields()}
    assert {"quality", "map", "facing", "height_m", "credit"} <= names
    assert not names & {"name", "bbox", "mask", "keypoints", "lonlat", "at", "output", "overwrite"}


@given(
    st.dictionaries(st.sampled_from(list(fields_by_column())), st.text() | st.floats() | st.integers() | st.booleans())
)
def test_any_values_are_taken_or_rejected(values: dict[str, Any]) -> None:
    with suppress(InputError):
        assert request_of({"figure": "a.png", **values}, {}, "n").figure == Path("a.png")
