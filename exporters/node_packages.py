"""Lookup of optional npm packages, which are never installed automatically."""

from __future__ import annotations

import os
import shutil
from pathlib import Path


def find_package(name: str) -> tuple[str, Path] | None:
    """Find Node.js and the folder of an npm package; None where either is missing.

    Searched are NODE_PATH, then node_modules and build/node/node_modules in the working directory and its parents.
    """
    node = shutil.which("node")
    here = Path.cwd()
    places = [Path(entry) for entry in os.environ.get("NODE_PATH", "").split(os.pathsep) if entry]
    for folder in (here, *here.parents):
        places += [folder / "node_modules", folder / "build" / "node" / "node_modules"]
    package = next((place / name for place in places if (place / name).is_dir()), None)
    return (node, package.resolve()) if node and package else None
