"""`fig2mesh tileset`: figures that are there already, gathered into one tileset; nothing heavy is imported before."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from fig2mesh.commands.options import FILE, messages, request_options
from fig2mesh.conversion.fields import check_fields, option, request_class
from fig2mesh.terminal import configure_logging, log


@request_class
class TilesetRequest:
    """How placed figures are gathered into one tileset."""

    output: Path = option(short="o", metavar="DIR", help="Folder of the tileset.")
    visible_from: float | None = option(
        default=None,
        metavar="M",
        help="Distance from which a figure is drawn, on a screen of 1080 rows; default: about 1,100 times its height.",
    )
    tiles_version: Literal["1.0", "1.1"] = option(
        default="1.1", help="1.0: content as .b3dm, for clients that do not know glTF content."
    )
    link: bool = option(default=False, help="Hard links to the .glb files instead of copies, where the disk can.")
    overwrite: bool = option(default=False, help="Replace an existing tileset.")

    def __post_init__(self) -> None:
        check_fields(self)


@click.command()
@click.argument("assets", type=FILE, nargs=-1, required=True, metavar="ASSET...")
@request_options(TilesetRequest)
@messages
def tileset(request: TilesetRequest, assets: tuple[Path, ...], quiet: bool, verbose: int) -> None:
    """Gather placed figures into one 3D tileset, a tree by place.

    ASSET is a .glb made with --lonlat, the tileset of a figure (with its levels of detail), or a folder of such at any
    depth. Beside the tileset come index.geojson, a map of the figures, and figures.czml, which stands on terrain.
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
    if note := short_range_warning(request.visible_from, written.tallest_m):
        log.warning("%s", note)
    log.info("%s: %d figures, %d files", written.files[-1], written.figures, len(written.files))
