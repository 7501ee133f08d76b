"""Readers in Python, in an environment of their own: VTK, pystac, stac-geoparquet, geopandas on GDAL."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.installing import alone_in, install
from tests.node import CLIENTS, ROOT

ENVIRONMENT = ROOT / "build" / "python_clients"
PACKAGES = {
    "geopandas": "1.2.0",
    "pyogrio": "0.13.0",
    "pystac": "1.15.2",
    "stac-geoparquet": "0.8.3",
    "vtk": "9.7.1",
}


def interpreter() -> Path:
    """The interpreter that has them; made and installed (1 GB on the disk, seconds) on first use."""
    python = ENVIRONMENT / "bin" / "python"
    done = ENVIRONMENT / "installed.json"
    with alone_in(ENVIRONMENT):
        if not done.is_file() or json.loads(done.read_text()) != PACKAGES:
            make = [sys.executable, "-m", "venv", "--clear", "--without-pip", str(ENVIRONMENT)]
            made = subprocess.run(make, capture_output=True, text=True, check=False)
            wanted = [f"{name}=={version}" for name, version in PACKAGES.items()]
            if problem := made.stderr.strip()[-200:] if made.returncode else install(python, *wanted):
                pytest.skip(f"readers in Python cannot be installed: {problem}")
            done.write_text(json.dumps(PACKAGES))
    return python


def read(script: str, job: Any, seconds: int = 300) -> Any:
    """What a script of tests/clients prints on its last line, with JSON for its stdin."""
    command = [str(interpreter()), str(CLIENTS / script)]
    done = subprocess.run(command, input=json.dumps(job), capture_output=True, text=True, check=False, timeout=seconds)
    if done.returncode:
        if "cannot open shared object file" in done.stderr:
            pytest.skip(f"{script} does not start: {done.stderr.strip().splitlines()[-1]}")
        raise RuntimeError(done.stderr[-2000:])
    return json.loads(done.stdout.splitlines()[-1])
