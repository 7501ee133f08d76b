"""Programs of others that run in Node: installed on first use into build/, their absence said aloud."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.installing import alone_in

ROOT = Path(__file__).resolve().parents[1]
CLIENTS = ROOT / "tests" / "clients"

RunScript = Callable[..., Any]


def installed(folder: Path, *names: str) -> Path:
    """The node_modules folder with these packages, in the versions of tests/clients/package.json."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip(f"node and npm are not both there: not checked with {', '.join(names)}")
    pinned = json.loads((CLIENTS / "package.json").read_text())
    versions = pinned["dependencies"] | pinned["optionalDependencies"]
    wanted = {name: versions[name] for name in names}
    manifest = folder / "package.json"
    modules = folder / "node_modules"
    with alone_in(folder):
        present = manifest.is_file() and json.loads(manifest.read_text()).get("dependencies") == wanted
        if not present or not all((modules / name).is_dir() for name in names):
            folder.mkdir(parents=True, exist_ok=True)
            manifest.write_text(json.dumps({"private": True, "dependencies": wanted}))
            # No scripts of packages: none is needed, and they would compile a database for minutes.
            # No peers: clients ask for different versions of three.js, and those that need another bring it.
            options = ["--ignore-scripts", "--legacy-peer-deps", "--no-audit", "--no-fund", "--no-package-lock"]
            command = ["npm", "install", "--prefix", str(folder), *options]
            install = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder, timeout=600)
            if install.returncode:
                manifest.unlink()  # so that the next run tries again
                pytest.skip(f"npm cannot install {', '.join(names)}: {install.stderr.strip()[-200:]}")
    return modules


def runner(modules: Path, seconds: int = 300) -> RunScript:
    """A function that runs a script of tests/clients with JSON for its stdin and returns its stdout as JSON.

    seconds : longest time that it may take
    """

    def run(script: str, *arguments: str | Path, stdin: Any = None) -> Any:
        done = subprocess.run(
            ["node", str(CLIENTS / script), *map(str, arguments)],
            input=json.dumps(stdin),
            capture_output=True,
            text=True,
            check=True,
            timeout=seconds,
            env=os.environ | {"NODE_PATH": str(modules)},
        )
        return json.loads(done.stdout)

    return run
