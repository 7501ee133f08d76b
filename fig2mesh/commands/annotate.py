"""`fig2mesh annotate`: joints and parts by hand, in the browser; nothing heavy is imported before."""

from __future__ import annotations

from typing import Any

import click

from fig2mesh.commands.options import FILE, figure_files, messages


@click.command()
@click.argument("figure", type=FILE)
@click.option(
    "-o",
    "--output",
    type=FILE,
    metavar="DIR",
    help="Folder of keypoints.json, mask.png and part_labels.png; those in it are gone on with, and saved over. "
    "Default: FIGURE's stem + _annotation in the current folder.",
)
@figure_files
@click.option(
    "--parts",
    type=click.Choice(["network", "outline"]),
    default="network",
    show_default=True,
    help="How the preview is made; as in the main job.",
)
@click.option("--port", type=click.IntRange(0, 65535), default=0, show_default="a free one", metavar="N")
@click.option("--open/--no-open", "open_", default=True, help="Open the page in a browser.  [default: open]")
@messages
def annotate(**options: Any) -> None:
    """Correct joints, silhouette and parts of FIGURE in a browser, with a preview of the solid; Ctrl-C ends it."""
    from fig2mesh.annotate.job import run

    run(**options)


def add_to(cli: click.Group) -> None:
    """Make `annotate` a command of `cli`."""
    cli.add_command(annotate)
