"""`fig2mesh view`: read a drawing, make its page, serve or write it. All side effects are here."""

from __future__ import annotations

import logging
from collections.abc import Callable

from fig2mesh.conversion.convert import run_stages
from fig2mesh.conversion.observer import Observer
from fig2mesh.conversion.place import log_place, open_map, place
from fig2mesh.conversion.text_file import check_text, write_text
from fig2mesh.errors import InputError, OutputError
from fig2mesh.image_frame import image_frame
from fig2mesh.parse.read import read_figure
from fig2mesh.records import Figure
from fig2mesh.settings import Settings
from fig2mesh.stages.body import body
from fig2mesh.stages.lift import lift
from fig2mesh.stages.textures import textures
from fig2mesh.terminal import print_outputs, progress
from fig2mesh.view.cesium import CESIUM, find_cesium
from fig2mesh.view.globe import globe_page
from fig2mesh.view.page import EFFECTS, view_page
from fig2mesh.view.request import ViewRequest
from fig2mesh.view.scene import ViewScene, make_scene
from fig2mesh.view.server import page_server, show

log = logging.getLogger("fig2mesh")


def run(request: ViewRequest, quiet: bool = False) -> None:
    """Run `fig2mesh view`; quiet : without progress."""
    sheet = open_map(request)
    wanted = None if request.effects is None else _effects(request.effects)
    _check(request)
    shown = request.has_place and request.output is None
    folders = {CESIUM: find_cesium(request.cesium, "--lonlat")} if shown else {}
    drawn = read_figure(**request.reading())
    settings = request.settings()
    placed = place(request, sheet, drawn, request.figure)
    log_place(placed)
    if request.output is None:
        page_server("", request.port).server_close()  # report a port in use before the work
    with progress(quiet) as advance:
        scene = scene_of(drawn, settings, placed.height_m, advance)
        advance("page")
        at = placed.placement
        page = view_page(scene, wanted) if at is None else globe_page(scene, at, f"{CESIUM}/", wanted)
    if request.output is not None:
        write_text(request.output, page, "-o")
        log.info("a page of %.1f MB", len(page) / 1e6)
        print_outputs(request.output)
        return
    show(page_server(page, request.port, folders), request.open)


def scene_of(
    figure: Figure, settings: Settings, height_m: float, advance: Callable[[str], object] = lambda name: None
) -> ViewScene:
    """Make the scene of a figure, with only the stages that it needs; advance : called with the name of each."""
    done = run_stages(figure, settings, (lift, body, textures), height_m=height_m, observer=Observer(advance))
    fields, sources, pose = done.results[body], done.results[textures], done.results[lift]
    contours = settings.contours != "drop"
    return make_scene(done.figure.name, fields, sources, image_frame(done.figure), pose, height_m, contours)


def _check(request: ViewRequest) -> None:
    output = request.output
    if request.textures == "none":
        raise InputError("--textures", "view requires textures, not none", "use wrap")
    if output is not None:
        if output.suffix.lower() not in (".html", ".htm"):
            raise OutputError(output, "unknown suffix", "give -o a name that ends in .html")
        check_text(output, request.overwrite, "-o")
    if request.cesium is not None and (not request.has_place or output is not None):
        raise InputError("--cesium", "requires --lonlat or --map, without -o", "leave it out")


def _effects(text: str) -> tuple[str, ...]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    for name in names:
        if name not in EFFECTS:
            raise InputError("--effects", f"unknown effect {name!r}", f"choose from {', '.join(EFFECTS)}")
    return tuple(names)
