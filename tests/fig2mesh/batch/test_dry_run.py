"""A dry run finds what the run would find, before anything is converted."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from fig2mesh.batch import job, local_engine
from fig2mesh.batch.job import check_output
from fig2mesh.batch.ledger import WORK, Ledger
from fig2mesh.batch.request import BatchRequest
from fig2mesh.batch.row_job import check_row, convert_row
from fig2mesh.commands.main import main
from fig2mesh.errors import OutputError
from tests.fig2mesh.batch.small import QUICK, batch_of, task_of, write_csv, write_pictures


@pytest.fixture
def row(tmp_path: Path) -> dict[str, Any]:
    """A row that converts."""
    (found,) = write_pictures(tmp_path / "in", 1)
    return {**found, **QUICK}


def _both(tmp_path: Path, values: dict[str, Any], name: str = "person") -> tuple[str | None, str | None]:
    """Errors of a row in a dry run and in a run."""
    out = tmp_path / "out"
    batch = batch_of(tmp_path / "in", out)
    task = task_of(values, name)
    dry = check_row(batch_of(tmp_path / "in", tmp_path / "dry", target=out), task)
    return dry.error, convert_row(batch, task).error


def test_a_folder_of_another_program_is_found(tmp_path: Path, row: dict[str, Any]) -> None:
    (tmp_path / "out" / "person").mkdir(parents=True)
    dry, run = _both(tmp_path, row)
    assert dry is not None
    assert "already exists, and is not from an earlier batch" in dry
    assert dry == run


def test_a_link_is_found(tmp_path: Path, row: dict[str, Any]) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "person").symlink_to(tmp_path / "in")
    dry, run = _both(tmp_path, row)
    assert dry is not None
    assert "is a link" in dry
    assert dry == run


def test_the_folder_of_the_batch_itself_is_accepted(tmp_path: Path, row: dict[str, Any]) -> None:
    out = tmp_path / "out"
    (out / "person").mkdir(parents=True)
    Ledger(out).write("person", {"status": "failed", "claimed": True})
    assert check_row(batch_of(tmp_path / "in", tmp_path / "dry", target=out), task_of(row)).status == "done"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x": 5000, "y": 10}, "columns x, y: 5000 10 is not on the sheet of 300×200 px"),
        ({"x": -3, "y": 10}, "columns x, y: -3 10 is not on the sheet"),
        ({}, "person0.png is not the picture of map.pgw"),
        ({"x": 5, "y": 5, "format": "usdc", "profile": "cesiumjs"}, "person.usdc"),
    ],
)
def test_places_off_the_map_and_formats_are_found(
    tmp_path: Path, row: dict[str, Any], change: dict[str, Any], message: str
) -> None:
    Image.new("RGB", (300, 200)).save(tmp_path / "in" / "map.png")
    (tmp_path / "in" / "map.pgw").write_text("5 0 0 -5 2680002.5 1249997.5")
    (tmp_path / "in" / "map.prj").write_text("EPSG:2056")
    values = {name: value for name, value in row.items() if name not in ("lon", "lat")} | {"map": "map.png"} | change
    dry, run = _both(tmp_path, values)
    assert message in str(dry)
    assert dry == run
    assert not (tmp_path / "out" / "person").exists()


@pytest.mark.parametrize("name", ["tileset.json", "index.gpkg", "collection.json"])
def test_the_output_of_another_command_is_found(
    tmp_path: Path, row: dict[str, Any], name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    table = write_csv(tmp_path / "in" / "people.csv", [row])
    (tmp_path / "city").mkdir()
    (tmp_path / "city" / name).write_text("mine")
    printed = []
    for words in (["--dry-run"], []):
        assert main(["batch", str(table), "-o", str(tmp_path / "city"), *words]) == 2
        printed.append(capsys.readouterr().err)
    assert printed[0] == printed[1]
    assert f"{name}: already exists, and is not from an earlier batch" in printed[0]
    assert not (tmp_path / "city" / WORK).exists()


def test_folders_that_cannot_be_written_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="file is not a directory; give -o a folder"):
        check_output(tmp_path / "file" / "out", False)
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with pytest.raises(OutputError, match="no permission to write in"):
        check_output(tmp_path / "new" / "out", False)


def test_tracebacks_of_rows_are_logged_if_asked_for(
    tmp_path: Path, row: dict[str, Any], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    class Here(local_engine.LocalEngine):
        """Rows are checked in this process."""

        def run(self, tasks: Any) -> Any:
            yield from (check_row(self._batch, task) for task in tasks)

    monkeypatch.setattr(job, "LocalEngine", Here)
    table = write_csv(tmp_path / "in" / "people.csv", [{**row, "figure": "nobody.png"}])
    request = BatchRequest(table, dry_run=True, progress="none")
    monkeypatch.setattr(job.log, "propagate", True)
    for verbose, expected in ((1, False), (2, True)):
        caplog.clear()
        with caplog.at_level("DEBUG", logger="fig2mesh"):
            assert job.run(request, verbose=verbose) == 2
        assert ("Traceback (most recent call last)" in caplog.text) is expected
        assert json.dumps(caplog.text).count("nobody.png: No such file") >= 1
