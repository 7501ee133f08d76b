"""Blender as a Python package, in an environment of its own: it wants an older NumPy than the project."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.installing import alone_in, install
from tests.node import CLIENTS, ROOT

ENVIRONMENT = ROOT / "build" / "blender"
PACKAGES = ("bpy==4.2.0", "numpy>=1.26,<2")
PYTHON = (3, 11)
"""bpy is a wheel for this version alone."""


def blender_python() -> Path:
    """The interpreter that has bpy; made and installed (1.6 GB on the disk, half a minute) on first use."""
    interpreter = ENVIRONMENT / "bin" / "python"
    done = ENVIRONMENT / "installed.json"
    with alone_in(ENVIRONMENT):
        if not done.is_file() or json.loads(done.read_text()) != list(PACKAGES):
            name = "python{}.{}".format(*PYTHON)
            base = sys.executable if sys.version_info[:2] == PYTHON else shutil.which(name)
            if base is None:
                pytest.skip(f"bpy needs {name}, which is not there: not looked at in Blender")
            make = [base, "-m", "venv", "--clear", "--without-pip", str(ENVIRONMENT)]
            made = subprocess.run(make, capture_output=True, text=True, check=False)
            if problem := made.stderr.strip()[-200:] if made.returncode else install(interpreter, *PACKAGES):
                pytest.skip(f"bpy cannot be installed: {problem}")
            done.write_text(json.dumps(PACKAGES))
    return interpreter


def blender(script: Path, job: Any, seconds: int = 300) -> str:
    """What a script prints that runs in Blender with JSON for its stdin; `seconds` is how long it may take."""
    command = [str(blender_python()), str(script)]
    done = subprocess.run(command, input=json.dumps(job), capture_output=True, text=True, check=False, timeout=seconds)
    if done.returncode:
        # A missing system library is no fault of the files that were to be read.
        if "cannot open shared object file" in done.stderr:
            pytest.skip(f"bpy does not start: {done.stderr.strip().splitlines()[-1]}")
        raise RuntimeError(done.stderr[-2000:])
    return done.stdout


def looked_at(file: Path, picture: Path | None = None, size: tuple[int, int] = (120, 200)) -> dict[str, Any]:
    """What Blender finds in a file, see tests/clients/blender_import.py."""
    job = {"file": str(file), "picture": None if picture is None else str(picture), "size": size}
    return dict(json.loads(blender(CLIENTS / "blender_import.py", job).splitlines()[-1]))
