"""Optional npm packages: found where a user put them, never installed by us."""

from __future__ import annotations

import os
import shutil
from pathlib import Path


def find_package(name: str) -> tuple[str, Path] | None:
    """Node.js and the folder of an npm package: in NODE_PATH, or in node_modules or build/node/node_modules here or
    in a folder above. None where either is missing."""
    node = shutil.which("node")
    here = Path.cwd()
    places = [Path(entry) for entry in os.environ.get("NODE_PATH", "").split(os.pathsep) if entry]
    for folder in (here, *here.parents):
        places += [folder / "node_modules", folder / "build" / "node" / "node_modules"]
    package = next((place / name for place in places if (place / name).is_dir()), None)
    return (node, package.resolve()) if node and package else None
