"""One row: stages run, results kept and made again, and no traces of failures."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from exporters.validate import validate
from fig2mesh.batch import row_job
from fig2mesh.batch.ledger import DAMAGED, WORK, Ledger
from fig2mesh.batch.row_job import check_row, convert_row
from fig2mesh.batch.task import Batch, Outcome
from fig2mesh.commands.main import main
from tests.fig2mesh.batch.small import QUICK, batch_of, task_of, write_pictures

WHOLE = ("figure", "lift", "parts", "body", "solid", "simplify", "surface", "model", "measures")
"""Stages of a row of `QUICK`."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pictures with joints."""
    path = tmp_path_factory.mktemp("collection")
    write_pictures(path, 2)
    return path


@pytest.fixture
def row(folder: Path) -> dict[str, Any]:
    """A row that converts."""
    return {"figure": "person0.png", "keypoints": "person0.json", "lon": 8.5, "lat": 47.4, **QUICK}


@pytest.fixture(scope="module")
def kept(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Outputs of one row, converted once for all tests that copy or read them."""
    out = tmp_path_factory.mktemp("kept")
    values = {"figure": "person0.png", "keypoints": "person0.json", "lon": 8.5, "lat": 47.4, **QUICK}
    assert convert_row(batch_of(folder, out), task_of(values)).status == "done"
    return out


@pytest.fixture
def batch(folder: Path, kept: Path, tmp_path: Path) -> Batch:
    """A batch that has converted `row` already."""
    import shutil

    shutil.copytree(kept, tmp_path / "out")
    return batch_of(folder, tmp_path / "out")


def _done(outcome: Outcome) -> Outcome:
    assert (outcome.status, outcome.error) == ("done", None)
    return outcome


def test_a_row_is_what_the_main_job_makes(batch: Batch, folder: Path, tmp_path: Path) -> None:
    target = tmp_path / "person.glb"
    words = [str(folder / "person0.png"), "--keypoints", str(folder / "person0.json"), "--lonlat", "8.5", "47.4", "-q"]
    words += [word for name, value in QUICK.items() for word in (f"--{name}", str(value))]
    assert main([*words, "--name", "person", "-o", str(target)]) == 0
    assert target.read_bytes() == (batch.folder / "person" / "person.glb").read_bytes()


def test_the_record_lists_inputs_and_outputs(batch: Batch, folder: Path) -> None:
    record = Ledger(batch.folder).read("person")
    assert record is not None
    assert set(record["inputs"]) == {"person0.png", "person0.json"}
    assert record["outputs"].keys() == {"person/person.glb"}
    assert record["measures"]["watertight"]
    assert (record["placement"]["lon_deg"], record["placement"]["lat_deg"]) == (8.5, 47.4)
    assert tuple(record["work"]["ran"]) == WHOLE


def test_a_second_run_does_nothing(batch: Batch, row: dict[str, Any]) -> None:
    before = (batch.folder / "person" / "person.glb").stat().st_mtime_ns
    outcome = _done(convert_row(batch, task_of(row)))
    assert (outcome.unchanged, outcome.ran, outcome.reused, outcome.counts) == (True, (), (), {})
    assert (batch.folder / "person" / "person.glb").stat().st_mtime_ns == before


@pytest.mark.parametrize(
    ("change", "ran"),
    [
        ({"lon": 9.0}, ("model",)),
        ({"height_m": 3.0}, ("model", "measures")),
        ({"facing": "N", "credit": "Anna"}, ("model",)),
        ({"artist": "Anna"}, ("model",)),
        ({"format": "ply"}, ("model",)),
        (
            {"effect": "none", "format": "glb"},
            ("parts", "body", "surface", "model", "measures"),
        ),
        ({"triangles": 600}, ("parts", "body", "simplify", "surface", "model", "measures")),
        ({"quality": "standard", "triangles": 800}, WHOLE[2:]),
        ({"keypoints": "person1.json"}, ("figure", "model")),  # other bytes, the same joints
        ({"figure": "person1.png"}, WHOLE),
    ],
)
def test_a_changed_row_runs_what_the_change_reaches(
    batch: Batch, row: dict[str, Any], folder: Path, change: dict[str, Any], ran: tuple[str, ...]
) -> None:
    if "keypoints" in change:
        (folder / "person1.json").write_text((folder / "person0.json").read_text() + "\n")
    assert set(_done(convert_row(batch, task_of(row | change))).ran) == set(ran)


def test_fresh_makes_everything_anew_and_the_same(batch: Batch, row: dict[str, Any], folder: Path) -> None:
    before = (batch.folder / "person" / "person.glb").read_bytes()
    outcome = _done(convert_row(batch_of(folder, batch.folder, fresh=True), task_of(row)))
    assert (outcome.ran, outcome.unchanged) == (WHOLE, False)
    assert (batch.folder / "person" / "person.glb").read_bytes() == before


def _stages(batch: Batch) -> list[Path]:
    return sorted((batch.folder / WORK / "stages").glob("*/*.npz"))


@pytest.mark.parametrize("harm", ["truncated", "flipped", "empty", "foreign", "folder"])
def test_damaged_stages_are_made_again(batch: Batch, row: dict[str, Any], harm: str) -> None:
    before = (batch.folder / "person" / "person.glb").read_bytes()
    for path in _stages(batch):
        data = bytearray(path.read_bytes())
        if harm == "truncated":
            path.write_bytes(data[: len(data) // 2])
        elif harm == "flipped":
            data[len(data) // 2] ^= 255
            path.write_bytes(data)
        elif harm == "empty":
            path.write_bytes(b"")
        elif harm == "foreign":
            np.savez(path, something=np.zeros(3))
        else:
            path.unlink()
            path.mkdir()
    (batch.folder / "person" / "person.glb").unlink()
    ran = set(_done(convert_row(batch, task_of(row))).ran)
    # A bit of an archive's padding does not matter.
    assert ran == set(WHOLE) or (harm == "flipped" and ran >= {"figure", "solid", "model"})
    assert (batch.folder / "person" / "person.glb").read_bytes() == before


@pytest.mark.parametrize("harm", ["gone", "truncated", "flipped"])
def test_damaged_outputs_are_made_again_from_stages(batch: Batch, row: dict[str, Any], harm: str) -> None:
    path = batch.folder / "person" / "person.glb"
    before = path.read_bytes()
    if harm == "gone":
        path.unlink()
    else:
        path.write_bytes(before[:-7] if harm == "truncated" else before[:-1] + bytes([before[-1] ^ 1]))
    assert _done(convert_row(batch, task_of(row))).ran == ("model",)
    assert path.read_bytes() == before


@pytest.mark.parametrize("text", ["", "{", '[{"status": "done"}, "0"]', "[]", "null", "\0\0\0"])
def test_a_damaged_record_is_a_row_that_was_begun(batch: Batch, row: dict[str, Any], text: str) -> None:
    ledger = Ledger(batch.folder)
    ledger.path("person").write_text(text)
    assert ledger.read("person") == DAMAGED
    assert _done(convert_row(batch, task_of(row))).ran == ("model",)


def test_formats_come_and_go(batch: Batch, row: dict[str, Any]) -> None:
    _done(convert_row(batch, task_of(row | {"format": "usdz, czml", "lods": 2})))
    names = {path.name for path in (batch.folder / "person").iterdir()}
    assert names == {"person.glb", "person_lod1.glb", "person.usdz", "person.czml"}
    for name in names:
        assert not [f for f in validate(batch.folder / "person" / name) if f.severity == "error"]
    _done(convert_row(batch, task_of(row)))
    assert {path.name for path in (batch.folder / "person").iterdir()} == {"person.glb"}


def test_files_of_others_are_neither_replaced_nor_removed(folder: Path, row: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / "person").mkdir()
    (tmp_path / "person" / "person.glb").write_text("mine")
    for _ in range(2):  # the refusal itself must not claim the folder
        outcome = convert_row(batch_of(folder, tmp_path), task_of(row))
        assert outcome.error == (
            f"{tmp_path}/person: already exists, and is not from an earlier batch; "
            "use --overwrite or choose another -o DIR"
        )
        assert (tmp_path / "person" / "person.glb").read_text() == "mine"
    (tmp_path / "person" / "notes.txt").write_text("mine")
    _done(convert_row(batch_of(folder, tmp_path, overwrite=True), task_of(row)))
    assert (tmp_path / "person" / "notes.txt").read_text() == "mine"


def test_a_link_in_place_of_the_folder_is_not_followed(folder: Path, row: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "person").symlink_to(tmp_path / "elsewhere")
    outcome = convert_row(batch_of(folder, tmp_path / "out", overwrite=True), task_of(row))
    assert "is a link" in str(outcome.error)
    assert not list((tmp_path / "elsewhere").iterdir())


def test_what_a_worker_that_died_has_left_is_cleared_away(batch: Batch, row: dict[str, Any]) -> None:
    stale = batch.folder / "person" / ".fig2mesh-1-abcd.tmp"
    stale.mkdir()
    (stale / "half.glb").touch()
    _done(convert_row(batch, task_of(row | {"lon": 8.6})))
    assert {path.name for path in (batch.folder / "person").iterdir()} == {"person.glb"}


BAD = {
    "No such file": {"figure": "nobody.png"},
    "leads out of": {"figure": "../person0.png"},
    "no place": {"lon": None, "lat": None},
    "latitude 147.4 is outside": {"lat": 147.4},
    "is not inside": {"bbox": "0 0 9999 9999"},
    "not a picture that can be read": {"figure": "person0.json"},
    "choose from glb, gltf": {"format": "docx"},
    "ca. 1893": {"date": "ca. 1893"},
    "unknown value 'superb'": {"quality": "superb"},
    "none cannot be combined with light": {"effect": "none light"},
}


@pytest.fixture
def bad(request: pytest.FixtureRequest, row: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """A message, and a row that causes it."""
    changed = row | BAD[request.param]
    return request.param, {column: value for column, value in changed.items() if value is not None}


@pytest.mark.parametrize("bad", BAD, indirect=True)
def test_bad_rows_fail_in_one_line_and_leave_nothing(
    folder: Path, tmp_path: Path, bad: tuple[str, dict[str, Any]]
) -> None:
    message, values = bad
    batch = batch_of(folder, tmp_path)
    checked, converted = check_row(batch, task_of(values)), convert_row(batch, task_of(values))
    record = Ledger(tmp_path).read("person")
    assert convert_row(batch, task_of(values)).error == converted.error
    assert Ledger(tmp_path).read("person") == record
    for outcome in (checked, converted):
        assert outcome.status == "failed"
        assert message in str(outcome.error)
        assert "\n" not in str(outcome.error)
        assert str(folder) + os.sep not in str(outcome.error)
        assert not outcome.internal
    assert not (tmp_path / "person").exists()


def test_a_check_of_a_good_row_finds_nothing_and_writes_nothing(
    folder: Path, row: dict[str, Any], tmp_path: Path
) -> None:
    assert _done(check_row(batch_of(folder, tmp_path), task_of(row))).ran == ()
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_reported_and_the_next_run_completes(
    folder: Path, row: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*arguments: Any, **more: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr("exporters.write.os.replace", full)
        outcome = convert_row(batch_of(folder, tmp_path), task_of(row))
    assert (outcome.status, outcome.full) == ("failed", True)
    assert "No space left on device" in str(outcome.error)
    assert ".tmp" not in str(outcome.error)
    assert not any((tmp_path / "person").glob("*")) or not (tmp_path / "person").exists()
    _done(convert_row(batch_of(folder, tmp_path), task_of(row)))


def test_a_fault_of_ours_is_recorded_as_such_and_tried_again(
    folder: Path, row: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*arguments: Any, **more: Any) -> None:
        raise RuntimeError("a bug")

    with monkeypatch.context() as patch:
        patch.setattr(row_job, "_write", broken)
        outcome = convert_row(batch_of(folder, tmp_path), task_of(row))
    assert outcome.internal
    assert outcome.error == "internal error: RuntimeError: a bug"
    assert _done(convert_row(batch_of(folder, tmp_path), task_of(row))).ran == ("model", "measures")
