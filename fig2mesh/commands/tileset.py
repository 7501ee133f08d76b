"""`fig2mesh tileset`: figures that are there already, gathered into one tileset; nothing heavy is imported before."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from fig2mesh.commands.options import FILE, messages

TILES_VERSION = click.Choice(["1.0", "1.1"])


@click.command()
@click.argument("assets", type=FILE, nargs=-1, required=True, metavar="ASSET...")
@click.option("-o", "--output", type=FILE, required=True, metavar="DIR", help="Folder of the tileset.")
@click.option(
    "--visible-from",
    type=float,
    default=2000.0,
    show_default=True,
    metavar="M",
    help="Distance from which a figure is drawn, on a screen of 1080 rows.",
)
@click.option(
    "--tiles-version",
    type=TILES_VERSION,
    default="1.1",
    show_default=True,
    help="1.0: content as .b3dm, for clients that do not know glTF content.",
)
@click.option("--link", is_flag=True, help="Hard links to the .glb files instead of copies, where the disk can.")
@click.option("--overwrite", is_flag=True, help="Replace an existing tileset.")
@messages
def tileset(
    assets: tuple[Path, ...],
    output: Path,
    visible_from: float,
    tiles_version: Any,
    link: bool,
    overwrite: bool,
    quiet: bool,
    verbose: int,
) -> None:
    """Gather placed figures into one 3D tileset, a tree by place.

    ASSET is a .glb made with --lonlat, the tileset of a figure (with its levels of detail), or a folder of such at any
    depth. Beside the tileset come index.geojson, a map of the figures, and figures.czml, which stands on terrain.
    """
    from exporters.tiles.gather import write_figures
    from fig2mesh.convert.job import configure_logging, log

    configure_logging(quiet, verbose)
    written = write_figures(
        assets, output, visible_from_m=visible_from, version=tiles_version, overwrite=overwrite, link=link
    )
    log.info("%s: %d figures, %d files", written.files[-1], written.figures, len(written.files))


def add_to(cli: click.Group) -> None:
    """Make `tileset` a command of `cli`."""
    cli.add_command(tileset)
