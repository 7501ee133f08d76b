"""`fig2mesh globe`: models on a globe in the browser; heavy imports wait until it runs."""

from __future__ import annotations

from pathlib import Path

import click

from fig2mesh.commands.options import FILE, messages, request_options
from fig2mesh.globe.request import GlobeRequest
from fig2mesh.terminal import configure_logging


@click.command()
@click.argument("assets", type=FILE, nargs=-1, required=True, metavar="MODEL...")
@click.option(
    "--overlay",
    "overlays",
    type=(str, float, float, float, float),
    multiple=True,
    metavar="IMAGE W S E N",
    help="Drape a picture over the ground, such as the map that the figures come from. North is up; W S E N are its "
    "outer edges, degrees. Repeatable.",
)
@request_options(GlobeRequest)
@messages
def globe(
    request: GlobeRequest,
    assets: tuple[Path, ...],
    overlays: tuple[tuple[str, float, float, float, float], ...],
    quiet: bool,
    verbose: int,
) -> None:
    """Show each MODEL on a globe in a browser, offline. Stop with Ctrl-C.

    MODEL is a georeferenced .glb or .gltf, a tileset.json or its folder, a .czml or a .geojson.
    """
    from fig2mesh.globe.job import run

    configure_logging(quiet, verbose)
    run(request, assets, overlays)
