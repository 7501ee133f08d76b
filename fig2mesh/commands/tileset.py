"""`fig2mesh tileset`: gather converted figures into one tileset; heavy imports wait until it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from fig2mesh.commands.options import FILE, messages, request_options
from fig2mesh.conversion.fields import check_fields, option, request_class
from fig2mesh.terminal import configure_logging, log, print_outputs

MAX_NOTES = 10
"""Limit of figures that are there twice and named one by one."""


@request_class
class TilesetRequest:
    """Options for gathering placed figures into one tileset."""

    output: Path = option(short="o", metavar="DIR", help="Output folder.")
    visible_from: float | None = option(
        default=None,
        metavar="M",
        help="Distance at which clients begin to draw a figure, metres, on a screen 1080 pixels high. Default: about "
        "1,100 times its height.",
    )
    tiles_version: Literal["1.0", "1.1"] = option(
        default="1.1", help="Version of 3D Tiles. 1.0: content as .b3dm, for clients that do not support glTF content."
    )
    link: bool = option(
        default=False, help="Make hard links to the .glb files instead of copies, where the file system supports them."
    )
    overwrite: bool = option(default=False, help="Replace an existing tileset.")

    def __post_init__(self) -> None:
        check_fields(self)


@click.command()
@click.argument("assets", type=FILE, nargs=-1, required=True, metavar="MODEL...")
@request_options(TilesetRequest)
@messages
def tileset(request: TilesetRequest, assets: tuple[Path, ...], quiet: bool, verbose: int) -> None:
    """Gather placed figures into one 3D Tiles tileset, as a spatial tree.

    MODEL is a .glb made with --lonlat or --map, the tileset of a figure (with its levels of detail), or a folder that
    contains such files at any depth. Also writes index.geojson, a map of the figures, and figures.czml, in which they
    stand on the terrain.
    """
    from exporters.tiles.gather import write_figures
    from exporters.tiles.tileset import short_range_warning

    configure_logging(quiet, verbose)
    written = write_figures(
        assets,
        request.output,
        visible_from_m=request.visible_from,
        version=request.tiles_version,
        overwrite=request.overwrite,
        link=request.link,
    )
    for line in written.notes[:MAX_NOTES]:
        log.warning("%s", line)
    if len(written.notes) > MAX_NOTES:
        log.warning("%d more figures are there twice", len(written.notes) - MAX_NOTES)
    if note := short_range_warning(request.visible_from, written.tallest_m):
        log.warning("%s", note)
    log.info("%d figures, %d files", written.figures, len(written.files))
    print_outputs(written.files[-1])
