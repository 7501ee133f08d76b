"""Processes without semaphores and without the caller's main module, and errors that come back from them."""

from __future__ import annotations

import multiprocessing.popen_spawn_posix
import os
import pickle
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from exporters.errors import ExportError
from fig2mesh.batch.local_engine import LocalEngine
from fig2mesh.batch.task import Outcome
from fig2mesh.system.processes import ProcessLost, run_apart
from georef.errors import InputError, PlacementError
from tests.fig2mesh.batch.small import batch_of, task_of
from tests.node import ROOT

SCRIPT = """
import multiprocessing.synchronize, os
def fail(*_, **__): raise OSError(38, "Function not implemented")
multiprocessing.synchronize.SemLock.__init__ = fail
print("once")
from fig2mesh.system.processes import run_apart
print(run_apart(len, "abc"), run_apart(os.getpid) != os.getpid())
"""


@pytest.mark.parametrize("how", ["file", "-c", "stdin"])
def test_a_script_without_guard_or_semaphores_runs_once(tmp_path: Path, how: str) -> None:
    (tmp_path / "script.py").write_text(SCRIPT)
    words = {"file": [str(tmp_path / "script.py")], "-c": ["-c", SCRIPT], "stdin": ["-"]}[how]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, *words], input=SCRIPT, capture_output=True, text=True, check=True, env=environment
    )
    assert (done.stdout.split(), done.stderr) == (["once", "3", "True"], "")


@pytest.mark.parametrize("kind", [InputError, ExportError, PlacementError])
def test_errors_come_back_whole(kind: type[InputError]) -> None:
    again = pickle.loads(pickle.dumps(kind("a.png", "is odd", "mend it")))
    assert (type(again), again.source, str(again)) == (kind, "a.png", "a.png: is odd; mend it")
    with pytest.raises(ZeroDivisionError):
        run_apart(divmod, 1, 0)


def test_a_killed_process_is_named() -> None:
    with pytest.raises(ProcessLost, match="-9"):
        run_apart(signal.raise_signal, signal.SIGKILL)


@pytest.mark.parametrize("code", [1, 11, 12, 38])
def test_without_processes_work_is_done_here(monkeypatch: pytest.MonkeyPatch, code: int) -> None:
    def fail(*_: Any) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(multiprocessing.popen_spawn_posix.Popen, "_launch", fail)
    assert run_apart(os.getpid) == os.getpid()


@pytest.mark.parametrize("how", ["none starts", "all die at once"])
def test_rows_are_processed_here_and_it_is_said_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, how: str) -> None:
    def fail(*_: Any) -> None:
        raise OSError(11, os.strerror(11))

    if how == "none starts":
        monkeypatch.setattr(multiprocessing.popen_spawn_posix.Popen, "_launch", fail)
    else:
        monkeypatch.setattr("fig2mesh.batch.local_engine._work", os._exit)
    logged: list[str] = []
    monkeypatch.setattr("fig2mesh.batch.local_engine.log.warning", logged.append)
    tasks = [task_of({"figure": "none.png"}, f"row{n}", n) for n in range(1, 4)]
    outcomes = list(LocalEngine(batch_of(tmp_path, tmp_path / "out"), 2, 60.0, dry=True).run(tasks))
    assert sorted(each.number for each in outcomes if isinstance(each, Outcome)) == [1, 2, 3]
    assert all(isinstance(each, Outcome) and "none.png" in (each.error or "") for each in outcomes)
    assert logged == ["no worker processes can be started here; rows are processed in this one, one at a time"]
