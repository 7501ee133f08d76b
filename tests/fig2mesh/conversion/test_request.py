"""Requests as values: accepted and rejected values, messages, and options derived from their fields."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from fig2mesh.batch.request import BatchRequest
from fig2mesh.commands.options import request_options
from fig2mesh.conversion.fields import as_plain, request_fields
from fig2mesh.conversion.request import Request
from fig2mesh.errors import InputError
from fig2mesh.render.request import RenderRequest
from fig2mesh.view.request import ViewRequest


def parsed(request: type, words: list[str]) -> Any:
    found: list[Any] = []
    done = CliRunner().invoke(click.command()(request_options(request)(found.append)), words)
    assert done.exit_code == 0, done.output
    return found[0]


def test_paths_may_be_texts_and_lists_tuples() -> None:
    request = Request("a/farmer.png", keypoints="k.json", lonlat=[8, 47], outputs="x.glb", effects=["light"])
    assert (request.figure, request.keypoints) == (Path("a/farmer.png"), Path("k.json"))
    assert (request.lonlat, request.outputs, request.effects) == ((8.0, 47.0), ("x.glb",), ("light",))
    assert request.title == "farmer"
    assert Request("a/farmer.png").targets == ("farmer.glb",)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"quality": "best"}, "--quality: unknown value 'best'; choose from draft, standard, fine"),
        ({"triangles": 3}, "--triangles: 3 is out of range; give a value between 200 and 2e+06"),
        ({"triangles": "many"}, "--triangles: unexpected str 'many'; give a whole number"),
        ({"lonlat": (1.0,)}, "--lonlat: 1 values; give 2: LON LAT"),
        ({"lonlat": 8.5}, "--lonlat: unexpected float 8.5; give 2 values, each a number"),
        ({"overwrite": 1}, "--overwrite: unexpected int 1; give True or False"),
        ({"effects": ("light", "none")}, "--effect: none cannot be combined with light; give one of them"),
        ({"outputs": ("a.glb", "-")}, "-o -: writing to stdout is not supported; name a file or a folder"),
        ({"visible_from": -5}, "--visible-from: -5 m; give a positive distance in metres"),
    ],
)
def test_what_cannot_be_is_rejected_by_name(values: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        Request("a.png", **values)
    assert str(caught.value) == message


@pytest.mark.parametrize("kind", [Request, RenderRequest, ViewRequest, BatchRequest])
def test_every_field_has_a_help_and_is_an_option(kind: type) -> None:
    command = click.command()(request_options(kind)(lambda request: None))
    text = CliRunner().invoke(command, ["--help"]).output
    for field in request_fields(kind):
        assert field.option.help
        assert field.option.argument or f"{field.flag}" in text
    described = {field.field for field in request_fields(kind)}
    assert {each.name for each in dataclasses.fields(kind)} - described <= {"defaults"}


def test_the_command_line_without_options_is_the_defaults() -> None:
    assert parsed(Request, ["a.png"]) == Request("a.png")
    assert parsed(RenderRequest, ["a.png", "-o", "b.png"]) == RenderRequest("a.png", output="b.png")


OPTIONS = st.fixed_dictionaries(
    {},
    optional={
        "lonlat": st.tuples(st.floats(-180, 180), st.floats(-90, 90)),
        "quality": st.sampled_from(["draft", "standard", "fine"]),
        "textures": st.sampled_from(["wrap", "none"]),
        "triangles": st.integers(200, 2_000_000),
        "bbox": st.tuples(*[st.integers(0, 9999)] * 4),
        "evidence": st.sampled_from(["parts", "pixels", "none"]),
        "overwrite": st.booleans(),
        "outputs": st.lists(st.sampled_from(["a.glb", "b.usdz", "tiles/"]), max_size=3).map(tuple),
        "mask": st.sampled_from([Path("m.png"), Path("/x/m.png")]),
        "credit": st.sampled_from(["", "Anna", "a, b"]),
    },
)


@given(OPTIONS)
def test_requests_survive_the_command_line_and_json(values: dict[str, Any]) -> None:
    request = Request("a.png", **values)
    assert Request(**json.loads(json.dumps(as_plain(request)))) == request
    words = ["a.png"]
    for field in request_fields(Request):
        value = getattr(request, field.field)
        if field.option.argument or value == field.default:
            continue
        if field.type.kind is bool:
            words.append(field.flag if value else f"--no-{field.flag[2:]}")
        elif field.type.many:
            words += [word for item in value for word in (field.flag, str(item))]
        elif field.type.count > 1:
            words += [field.flag, *map(repr, value)]
        else:
            words += [field.flag, str(value)]
    assert parsed(Request, words) == request
