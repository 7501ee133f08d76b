"""`fig2mesh batch --engine dask`: a scheduler and two worker processes on the loopback."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from fig2mesh.commands.main import main
from tests.fig2mesh.batch.small import QUICK, tree, write_csv, write_pictures

pytest.importorskip("distributed")
pytestmark = pytest.mark.slow


class Cluster:
    """A scheduler and its workers, each a process of its own, as one starts them on machines."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.processes: list[subprocess.Popen[str]] = []
        quiet = ("--no-dashboard", "--host", "127.0.0.1")
        scheduler = self._start("scheduler", *quiet, "--port", "0")
        self.address = _wait_for(scheduler, r"Scheduler at:\s+(tcp://\S+)")

    def worker(self) -> None:
        """One more worker, without a nanny: what is killed stays dead."""
        process = self._start(
            "worker",
            self.address,
            "--nthreads",
            "1",
            "--no-nanny",
            "--no-dashboard",
            "--memory-limit",
            "0",
            "--name",
            f"w{len(self.processes)}",
            "--local-directory",
            str(self.folder),
        )
        _wait_for(process, r"(Registered to)")

    def _start(self, *words: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]], stderr=subprocess.PIPE, text=True
        )
        self.processes.append(process)
        return process

    def kill(self, number: int) -> None:
        """Kill a process; 0 is the scheduler."""
        self.processes[number].send_signal(signal.SIGKILL)

    def close(self) -> None:
        """End them all."""
        for process in self.processes:
            with suppress(ProcessLookupError):
                process.kill()
            process.wait()
            assert process.stderr is not None
            process.stderr.close()


def _wait_for(process: subprocess.Popen[str], pattern: str) -> str:
    assert process.stderr is not None
    for line in process.stderr:
        if found := re.search(pattern, line):
            return found[1]
    raise AssertionError(f"the process ended with {process.wait()}")


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """A scheduler with two workers."""
    running = Cluster(tmp_path)
    try:
        running.worker()
        running.worker()
        yield running
    finally:
        running.close()


@pytest.fixture(scope="module")
def collection(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six rows that convert and one that does not."""
    folder = tmp_path_factory.mktemp("collection")
    rows = [{**row, **QUICK} for row in write_pictures(folder, 6)]
    return write_csv(folder / "people.csv", [*rows, {**rows[0], "figure": "nobody.png"}])


def test_a_worker_is_killed_and_the_bytes_are_those_of_local_processes(
    collection: Path, cluster: Cluster, tmp_path: Path
) -> None:
    assert main(["batch", str(collection), "-o", str(tmp_path / "local"), "-q"]) == 2
    command = [
        sys.executable,
        "-m",
        "fig2mesh",
        "batch",
        str(collection),
        "-o",
        str(tmp_path / "dask"),
        "-q",
        "--engine",
        "dask",
        "--address",
        cluster.address,
        "--progress",
        "json",
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    killed, workers = False, set()
    for line in process.stdout:
        event = json.loads(line)
        if event["event"] == "stage":
            workers.add(event["worker"])
            if not killed and event["worker"] == "w1":
                cluster.kill(1)
                killed = True
    assert process.wait() == 2
    assert killed
    assert workers == {"w1", "w2"}
    assert tree(tmp_path / "dask") == tree(tmp_path / "local")


def test_no_scheduler_is_one_line(collection: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["batch", str(collection), "-o", str(tmp_path), "--engine", "dask", "--address", "tcp://127.0.0.1:9"]
    assert main(words) == 2
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1
    assert "--address tcp://127.0.0.1:9: no scheduler answers" in printed


def test_a_worker_of_another_version_is_rejected(
    collection: Path,
    cluster: Cluster,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("fig2mesh.conversion.keys.fingerprint", lambda: "another")
    words = ["batch", str(collection), "-o", str(tmp_path / "out"), "--engine", "dask", "--address", cluster.address]
    assert main(words) == 2
    assert "has another version of fig2mesh or of a library; install the same versions there" in capsys.readouterr().err
    assert os.listdir(tmp_path / "out") == [".fig2mesh"]
