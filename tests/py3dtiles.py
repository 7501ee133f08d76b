"""py3dtiles, a reader of tilesets that shares no code with ours: installed on first use into build/."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.installing import alone_in, install
from tests.node import CLIENTS, ROOT

VERSION = "12.1.1"
FOLDER = ROOT / "build" / "py3dtiles"


def read(script: str, tileset: Path) -> Any:
    """What a script of tests/clients prints that reads a tileset with py3dtiles.

    The package comes without what it depends on: it asks for older versions of NumPy and numba than the project has,
    and reads tilesets with those that are here.
    """
    with alone_in(FOLDER):
        if not (FOLDER / f"py3dtiles-{VERSION}.dist-info").is_dir():
            target = ["--no-deps", "--upgrade", "--target", str(FOLDER)]
            if problem := install(sys.executable, *target, f"py3dtiles=={VERSION}"):
                pytest.skip(f"py3dtiles cannot be installed: {problem}")
    done = subprocess.run(
        [sys.executable, str(CLIENTS / script), str(tileset)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        env=os.environ | {"PYTHONPATH": str(FOLDER)},
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
