"""The plan of a request, before it runs."""

from __future__ import annotations

import json
from itertools import product

import pytest

from fig2mesh.commands.main import main
from fig2mesh.conversion.plan import plan
from fig2mesh.settings import settings_for
from fig2mesh.stages.table import STAGES


@pytest.mark.parametrize(
    ("mesher", "textures", "parts"),
    list(product(["ball-pivot", "isosurface"], ["wrap", "none"], ["network", "outline"])),
)
def test_the_pipeline_runs_what_is_planned(mesher: str, textures: str, parts: str) -> None:
    settings = settings_for("draft", mesher=mesher, textures=textures, parts=parts)
    planned = plan(settings, ["a.glb"])
    assert [stage.name for stage in planned.stages] == [stage.name for stage in STAGES]
    assert [stage.runs for stage in planned.stages] == [stage.left_out(settings) is None for stage in STAGES]
    runs = {stage.name: stage.runs for stage in planned.stages}
    assert runs["cloud"] == (mesher == "ball-pivot")
    assert runs["unwrap"] == runs["textures"] == runs["bake"] == (textures != "none")
    assert all(each.why for each in (*planned.stages, *planned.effects))


@pytest.mark.parametrize(
    ("output", "textures", "light", "expected"),
    [
        ("a.glb", "none", False, False),
        ("tiles/tileset.json", "none", False, False),
        ("a.glb", "none", True, True),
        ("a.glb", "none", None, True),
        ("a.ply", "none", False, True),
        ("a.usdz", "none", False, True),
        ("a.glb", "wrap", None, True),
    ],
)
def test_normals_are_for_what_is_lit(output: str, textures: str, light: bool | None, expected: bool) -> None:
    settings = settings_for("draft", textures=textures, light=light)
    effects = {each.name: each.runs for each in plan(settings, [output]).effects}
    assert effects["normals"] is expected


def test_one_output_that_needs_normals_is_enough() -> None:
    settings = settings_for("draft", textures="none", light=False)
    assert any(each.runs for each in plan(settings, ["a.glb", "b.obj"]).effects)


def test_the_command_reads_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "no-such-figure.png", "--textures", "none", "--effect", "none"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "skip  bake      no texture is requested" in lines
    assert main(["plan", "no-such-figure.png", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {stage["name"] for stage in found["stages"] if stage["runs"]} == {stage.name for stage in STAGES}


def test_effects_that_exclude_each_other(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "figure.png", "--effect", "none", "--effect", "light"]) == 2
    assert "--effect" in capsys.readouterr().err
