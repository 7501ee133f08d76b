"""A batch from a script without a guard, on a machine without semaphores: converted, summarised, and again."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fig2mesh.batch.small import QUICK, manifest, write_csv, write_pictures
from tests.node import ROOT

SCRIPT = """
import multiprocessing.synchronize
def fail(*_, **__): raise OSError(38, "Function not implemented")
multiprocessing.synchronize.SemLock.__init__ = fail
print("once")
from fig2mesh.commands.main import main
for _ in range(2):
    print(main(["batch", "people.csv", "-o", "out", "--jobs", "2"]))
"""


@pytest.mark.slow
def test_a_script_without_a_guard_and_without_semaphores(tmp_path: Path) -> None:
    write_csv(tmp_path / "people.csv", [{**row, **QUICK} for row in write_pictures(tmp_path, 2)])
    (tmp_path / "script.py").write_text(SCRIPT)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "script.py"], capture_output=True, text=True, check=True, env=environment, cwd=tmp_path
    )
    tileset = str(tmp_path / "out" / "tileset.json")
    assert done.stdout.split() == ["once", tileset, "0", tileset, "0"]
    first, second = done.stderr.splitlines()
    assert "2 converted, 0 unchanged, 0 failed; 2 on the globe" in first
    assert "0 converted, 2 unchanged, 0 failed; 2 on the globe" in second
    assert [row["status"] for row in manifest(tmp_path / "out")] == ["done", "done"]
