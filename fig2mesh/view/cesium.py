"""Where CesiumJS is on this machine."""

from __future__ import annotations

from pathlib import Path

from fig2mesh.errors import InputError

CESIUM = "cesium"
"""Where a page finds CesiumJS, relative to its own address."""


def find_cesium(folder: Path | None, option: str) -> Path:
    """The folder of CesiumJS as built for pages, in the npm package that was named, or that npm put beside us.

    folder : the package or its folder Build/Cesium; None: node_modules/cesium in this folder or one above
    option : what needs it, for the message where there is none

    Raises InputError where there is none.
    """
    here = Path.cwd()
    tried = [folder] if folder is not None else [up / "node_modules" / "cesium" for up in (here, *here.parents)]
    for package in tried:
        for built in (package / "Build" / "Cesium", package):
            if (built / "Cesium.js").is_file():
                return built
    found = f"no CesiumJS in {folder}" if folder is not None else "no CesiumJS in node_modules"
    raise InputError(option if folder is None else "--cesium", found, "npm install cesium, or pass --cesium DIR")
