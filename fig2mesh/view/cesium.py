"""Location of CesiumJS on this machine."""

from __future__ import annotations

from pathlib import Path

from fig2mesh.errors import InputError

CESIUM = "cesium"
"""URL of CesiumJS, relative to the page."""


def find_cesium(folder: Path | None, option: str) -> Path:
    """Find the built CesiumJS in the npm package that was named, or in node_modules.

    folder : the package or its folder Build/Cesium; None: node_modules/cesium in the current folder or a parent
    option : that needs it, for the error message

    Raises InputError if there is none.
    """
    here = Path.cwd()
    tried = [folder] if folder is not None else [up / "node_modules" / "cesium" for up in (here, *here.parents)]
    for package in tried:
        for built in (package / "Build" / "Cesium", package):
            if (built / "Cesium.js").is_file():
                return built
    found = f"no CesiumJS in {folder}" if folder is not None else "no CesiumJS in node_modules"
    raise InputError(option if folder is None else "--cesium", found, "run npm install cesium, or give --cesium DIR")
