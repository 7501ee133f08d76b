"""`fig2mesh globe`: models on a globe in the browser; nothing heavy is imported before."""

from __future__ import annotations

from typing import Any

import click

from fig2mesh.commands.options import FILE, messages


@click.command()
@click.argument("assets", type=FILE, nargs=-1, required=True, metavar="ASSET...")
@click.option(
    "-o",
    "--output",
    type=FILE,
    metavar="DIR",
    help="Write page, files and CesiumJS into DIR, which any web server can serve, instead of showing them.",
)
@click.option(
    "--overlay",
    "overlays",
    type=(str, float, float, float, float),
    multiple=True,
    metavar="IMAGE W S E N",
    help="Lay a picture on the ground, such as the map that the figures come from: north up, the degrees of its outer "
    "edges. Repeatable.",
)
@click.option(
    "--cesium",
    type=FILE,
    metavar="DIR",
    help="The npm package cesium; default: node_modules/cesium in this folder or one above.",
)
@click.option("--port", type=click.IntRange(0, 65535), default=0, show_default="a free one", metavar="N")
@click.option("--open/--no-open", "open_", default=True, help="Open the page in a browser.  [default: open]")
@click.option("--overwrite", is_flag=True, help="Replace the page in DIR.")
@messages
def globe(**options: Any) -> None:
    """Show each ASSET on a globe in a browser, offline; Ctrl-C ends it.

    ASSET is a placed .glb or .gltf, a tileset.json or its folder, a .czml or a .geojson.
    """
    from fig2mesh.globe.job import run

    run(**options)


def add_to(cli: click.Group) -> None:
    """Make `globe` a command of `cli`."""
    cli.add_command(globe)
