"""`fig2mesh view`: a figure in the browser; nothing heavy is imported before."""

from __future__ import annotations

from typing import Any

import click

from fig2mesh.commands.options import FILE, figure_files, messages, place_options


@click.command()
@click.argument("figure", type=FILE)
@click.option(
    "-o",
    "--output",
    type=FILE,
    metavar="PAGE.html",
    help="Write the page there instead of showing it.",
)
@click.option(
    "--effects",
    metavar="NAME,NAME…",
    help="What is on at first: texture, blend, creases, light, ao, outline, smooth-union, perspective, antialias. "
    "Default: all but perspective, and outline only where the drawing's own is not there.",
)
@place_options
@click.option(
    "--cesium",
    type=FILE,
    metavar="DIR",
    help="The npm package cesium; default: node_modules/cesium in this folder or one above. A page written with -o "
    "loads CesiumJS from the folder cesium beside it.",
)
@figure_files
@click.option("--quality", type=click.Choice(["draft", "standard", "fine"]), default="standard", show_default=True)
@click.option("--parts", type=click.Choice(["network", "outline"]), default="network", show_default=True)
@click.option("--textures", type=click.Choice(["network", "plain"]), help="As in the main job.")
@click.option("--contours", type=click.Choice(["keep", "drop"]), default="keep", show_default=True)
@click.option("--device", type=click.Choice(["auto", "cpu", "cuda"]), default="auto", show_default=True)
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), default=0, show_default=True)
@click.option("--port", type=click.IntRange(0, 65535), default=0, show_default="a free one", metavar="N")
@click.option("--open/--no-open", "open_", default=True, help="Open the page in a browser.  [default: open]")
@click.option("--overwrite", is_flag=True, help="Replace an existing page.")
@messages
def view(**options: Any) -> None:
    """Look at FIGURE from all sides in a browser, which sphere-traces its part fields; Ctrl-C ends it.

    With a place, --lonlat or --map, it stands there on a globe; that needs CesiumJS.
    """
    from fig2mesh.view.job import run

    run(**options)


def add_to(cli: click.Group) -> None:
    """Make `view` a command of `cli`."""
    cli.add_command(view)
