"""`fig2mesh globe`: show models on a globe, or write the page that does. All side effects are here."""

from __future__ import annotations

import logging
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from exporters.atomic_file import atomic_folder
from fig2mesh.errors import OutputError
from fig2mesh.globe.assets import find_assets
from fig2mesh.globe.drape import drape
from fig2mesh.globe.page import Overlay, globe_page, page_files
from fig2mesh.globe.request import GlobeRequest
from fig2mesh.terminal import print_outputs
from fig2mesh.view.cesium import CESIUM, find_cesium
from fig2mesh.view.server import page_server, show

log = logging.getLogger("fig2mesh")

PAGE = "index.html"
MARK = '<meta name="generator" content="fig2mesh globe">'
"""Mark of a folder written by `fig2mesh globe`, which may be replaced."""


def run(
    request: GlobeRequest, assets: Sequence[Path], overlays: Sequence[tuple[str, float, float, float, float]] = ()
) -> None:
    """Run `fig2mesh globe`.

    assets : files and folders of models; overlays : pictures, each with its west, south, east and north edge, degrees
    """
    output = request.output
    if output is not None:
        _check_folder(output, request.overwrite)
    laid = tuple(Overlay(Path(image), *edges) for image, *edges in overlays)
    found = find_assets(tuple(assets))
    built = find_cesium(request.cesium, "globe")
    with tempfile.TemporaryDirectory(prefix="fig2mesh_") as folder:
        if request.map is not None:
            laid = (drape(request.map, request.map_crs, Path(folder), "sheet"), *laid)
        page, files = globe_page(found, laid), page_files(found, laid)
        if output is None:
            show(page_server(page, request.port, {CESIUM: built}, files), request.open)
            return
        write_folder(output, page, files, built)
    size = sum(file.stat().st_size for file in output.rglob("*") if file.is_file())
    log.info("a page of %.0f MB; serve it, for instance: python -m http.server -d %s", size / 1e6, output)
    print_outputs(output)


def write_folder(folder: Path, page: str, files: dict[str, Path], cesium: Path) -> None:
    """Write page, files and CesiumJS into a folder that any web server can serve; an older one is replaced whole."""
    with atomic_folder(folder) as stage:
        (stage / PAGE).write_text(page, encoding="utf-8")
        for address, file in files.items():
            target = stage / address
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, target)
        shutil.copytree(cesium, stage / CESIUM, ignore=shutil.ignore_patterns("*.map"))


def _check_folder(folder: Path, overwrite: bool) -> None:
    if not folder.exists():
        return
    if not folder.is_dir():
        raise OutputError(folder, "not a directory", "give -o a folder")
    if not any(folder.iterdir()):
        return
    page = folder / PAGE
    if not page.is_file() or MARK not in page.read_text(encoding="utf-8", errors="replace")[:2000]:
        raise OutputError(folder, "contains other files", "give -o an empty or new folder")
    if not overwrite:
        raise OutputError(folder, "already exists", "use --overwrite or choose another name")
