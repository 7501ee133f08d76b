"""The table of stages: names, order, and what it takes to add one."""

from __future__ import annotations

import inspect
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from fig2mesh.conversion.keys import stage_keys
from fig2mesh.conversion.observer import Observer
from fig2mesh.conversion.plan import plan
from fig2mesh.conversion.record_types import records_in
from fig2mesh.conversion.runner import Inputs, Runner
from fig2mesh.conversion.stores import FolderStore, KeyedStore, MemoryStore
from fig2mesh.records import Figure, Pose3D
from fig2mesh.settings import Settings
from fig2mesh.stages.stage import Kept, Stage
from fig2mesh.stages.table import STAGES

INPUTS = ("figure", "pieces", "height_m")


@pytest.mark.parametrize("stage", STAGES, ids=lambda stage: stage.name)
def test_stage_function_and_file_have_one_name(stage: Stage) -> None:
    file = inspect.getsourcefile(stage.function)
    assert file is not None
    assert Path(file).stem == stage.name
    assert stage.function.__module__ == f"fig2mesh.stages.{stage.name}"


def test_stages_come_after_what_they_need() -> None:
    known = set(INPUTS)
    for stage in STAGES:
        assert set(stage.needs) <= known
        known.add(stage.name)


def test_settings_that_stages_read_are_settings() -> None:
    fields = set(Settings.__dataclass_fields__)
    assert all(set(stage.reads) <= fields for stage in STAGES)
    # What no stage reads is for the writers.
    assert fields - {name for stage in STAGES for name in stage.reads} == {"light"}


def test_what_is_kept_consists_of_records() -> None:
    assert all(records_in(stage.makes) for stage in STAGES if stage.kept is not Kept.NEVER)


@dataclass(frozen=True)
class MirrorSettings(Settings):
    """Settings with one for a stage that is not shipped."""

    shift: float = 1.0


def lift(figure: Figure) -> Pose3D:
    return Pose3D(np.zeros((21, 3), np.float32))


def mirror(lift: Pose3D, *, shift: float) -> Pose3D:
    return Pose3D(lift.joints * np.float32([-1, 1, 1]) + np.float32(shift))


def sum_of(mirror: Pose3D) -> float:
    return float(mirror.joints.sum())


TOY = (
    Stage(lift, lambda settings: "depths"),
    Stage(mirror, lambda settings: "the other side"),
    Stage(sum_of, lambda settings: "a number", Kept.NEVER),
)


@pytest.fixture
def inputs() -> Inputs:
    mask = np.ones((8, 8), np.bool_)
    figure = Figure(
        "toy", np.zeros((8, 8, 4), np.uint8), mask, np.zeros((21, 2)), np.ones(21, bool), np.zeros((8, 8), np.uint8)
    )
    return Inputs(figure, 1)


def test_a_stage_is_added_by_an_entry(inputs: Inputs, tmp_path: Path) -> None:
    settings = MirrorSettings()
    assert [each.name for each in plan(settings, ["a.glb"], TOY).stages] == ["lift", "mirror", "sum_of"]
    found = Runner(settings, TOY, FolderStore(tmp_path)).run((sum_of,), inputs)
    assert found[sum_of] == 63.0
    assert {path.name for path in tmp_path.iterdir()} == {"lift.npz", "mirror.npz"}
    again = Observer()
    Runner(settings, TOY, FolderStore(tmp_path, frozenset({"lift", "mirror"})), again).run((sum_of,), inputs)
    assert [timing.name for timing in again.timings if timing.runs] == ["sum_of"]


def test_the_setting_of_an_added_stage_changes_its_key_and_those_after_it() -> None:
    key = {"figure": "f", "pieces": "1", "height_m": "2"}
    before, after = (stage_keys(TOY, MirrorSettings(shift=shift), key) for shift in (1.0, 2.0))
    assert before["lift"] == after["lift"]
    assert before["mirror"] != after["mirror"]
    assert before["sum_of"] != after["sum_of"]
    # A setting that none of them reads changes nothing.
    assert stage_keys(TOY, MirrorSettings(voxel=0.1), key) == before


@pytest.mark.parametrize("kind", ["memory", "keyed"])
def test_stores_run_again_only_what_a_change_reaches(kind: str, inputs: Inputs, tmp_path: Path) -> None:
    store = MemoryStore() if kind == "memory" else KeyedStore(tmp_path)

    def ran(settings: MirrorSettings) -> list[str]:
        observer = Observer()
        Runner(settings, TOY, store, observer).run((mirror,), inputs)
        return [timing.name for timing in observer.timings if timing.runs]

    assert ran(MirrorSettings()) == ["lift", "mirror"]
    assert ran(MirrorSettings()) == []
    assert ran(MirrorSettings(shift=3.0)) == ["mirror"]
    assert ran(MirrorSettings()) == []
    changed = replace(inputs, figure=replace(inputs.figure, joints_px=np.ones((21, 2))))
    observer = Observer()
    Runner(MirrorSettings(), TOY, store, observer).run((mirror,), changed)
    assert [timing.name for timing in observer.timings if timing.runs] == ["lift", "mirror"]


def test_what_is_not_asked_for_is_not_run(inputs: Inputs) -> None:
    observer = Observer()
    found = Runner(MirrorSettings(), TOY, observer=observer).run((lift,), inputs)
    assert lift in found
    assert mirror not in found
    assert {timing.name: timing.runs for timing in observer.timings} == {"lift": True, "mirror": False, "sum_of": False}


def test_the_observer_is_told_of_each_stage_before_it_runs(inputs: Inputs) -> None:
    names: list[str] = []
    Runner(MirrorSettings(), TOY, observer=Observer(names.append)).run((sum_of,), inputs)
    assert names == ["lift", "mirror", "sum_of"]
