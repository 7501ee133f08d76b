"""`fig2mesh view`: read a drawing, make its page, show or write it. All side effects are here."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

from fig2mesh.convert.asset import torch_device
from fig2mesh.convert.job import check_text, configure_logging, progress, tell, write_text
from fig2mesh.convert.place import PlaceRequest, open_map, place
from fig2mesh.errors import InputError, OutputError
from fig2mesh.parse.read import read_figure
from fig2mesh.records import Figure
from fig2mesh.settings import Settings, settings_for
from fig2mesh.view.cesium import CESIUM, find_cesium
from fig2mesh.view.globe import globe_page
from fig2mesh.view.page import EFFECTS, view_page
from fig2mesh.view.scene import Scene, make_scene
from fig2mesh.view.server import page_server, show

log = logging.getLogger("fig2mesh")


def run(
    *,
    figure: Path,
    output: Path | None,
    effects: str | None,
    cesium: Path | None,
    mask: Path | None,
    keypoints: Path | None,
    part_labels: Path | None,
    bbox: tuple[int, int, int, int] | None,
    quality: Any,
    parts: str,
    textures: str | None,
    contours: str,
    device: str,
    seed: int,
    port: int,
    open_: bool,
    overwrite: bool,
    quiet: bool,
    verbose: int,
    **where: Any,
) -> None:
    """What `fig2mesh view FIGURE …` does; the parameters are the options of the command line.

    where : the fields of `PlaceRequest`
    """
    configure_logging(quiet, verbose)
    request = PlaceRequest(**where)
    sheet = open_map(request)
    wanted = None if effects is None else _effects(effects)
    if output is not None:
        if output.suffix.lower() not in (".html", ".htm"):
            raise OutputError(output, "is no name for a page", "give -o a name that ends in .html")
        check_text(output, overwrite, "-o")
    if cesium is not None and (not request.somewhere or output is not None):
        raise InputError("--cesium", "only a globe that is shown needs it", "pass --lonlat and no -o, or leave it out")
    folders = {CESIUM: find_cesium(cesium, "--lonlat")} if request.somewhere and output is None else {}
    drawn = read_figure(figure, mask=mask, keypoints=keypoints, part_labels=part_labels, bbox=bbox)
    settings = settings_for(
        quality, parts=parts, textures=textures, contours=contours, device=torch_device(device), seed=seed
    )
    placed = place(request, sheet, drawn, figure)
    tell(placed)
    server = page_server("", port) if output is None else None  # a port that is taken is told before the work
    if server is not None:
        server.server_close()
    with progress(quiet) as advance:
        scene = scene_of(drawn, settings, placed.height_m, advance)
        advance("page")
        there = placed.placement
        page = view_page(scene, wanted) if there is None else globe_page(scene, there, f"{CESIUM}/", wanted)
    if output is not None:
        write_text(output, page, "-o")
        log.info("%s: %.1f MB", output, len(page) / 1e6)
        return
    show(page_server(page, port, folders), open_)


def scene_of(figure: Figure, settings: Settings, height_m: float, advance: Any = lambda name: None) -> Scene:
    """The scene of a figure, by those stages of the pipeline that it needs.

    advance : told the name of each stage
    """
    from fig2mesh.convert.pipeline import make_only, steps
    from fig2mesh.image_frame import image_frame
    from fig2mesh.parts.pieces import clean

    figure, pieces, _ = clean(figure, settings.voxel, settings.picture_px)
    results: dict[str, Any] = {"figure": figure, "pieces": pieces}
    make_only("textures", steps(settings, height_m), results, advance)
    lift, body, sources = results["lift"], results["body"], results["textures"]
    contours = settings.contours == "keep"
    return make_scene(figure.name, body, sources, image_frame(figure), lift, height_m, contours)


def _effects(text: str) -> tuple[str, ...]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    for name in names:
        if name not in EFFECTS:
            raise InputError("--effects", f"{name!r} is no effect", f"choose from {', '.join(EFFECTS)}")
    return tuple(names)
