"""`fig2mesh parse`: silhouette, parts and joints from a picture; nothing heavy is imported before."""

from __future__ import annotations

from typing import Any

import click

from fig2mesh.commands.options import FILE, figure_files, messages


@click.command()
@click.argument("figure", type=FILE, metavar="IMAGE")
@click.option("-o", "--output", type=FILE, required=True, metavar="DIR", help="Folder for the three files.")
@click.option(
    "--format",
    "kind",
    type=click.Choice(["fig2mesh", "coco", "labelme", "supervisely"]),
    default="fig2mesh",
    show_default=True,
    help="Of keypoints.json; all of them the main job reads.",
)
@click.option("--all", "whole_sheet", is_flag=True, help="Find all figures of a sheet: figures.json and a folder each.")
@click.option(
    "--smallest",
    type=click.FloatRange(16, 100_000),
    metavar="PX",
    help="With --all: height of the smallest figures; default: a tenth of the sheet's longer side.",
)
@figure_files
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@messages
def parse(**options: Any) -> None:
    """Find the figure in IMAGE: write keypoints.json, mask.png and part_labels.png.

    They are made for the whole IMAGE, to be corrected by hand and given to the main job as --keypoints, --mask and
    --part-labels; after --all with the --bbox that is said of each figure. What --mask, --keypoints or --part-labels
    give is kept, and only the rest is inferred.
    """
    from fig2mesh.parse.job import run

    run(**options)


def add_to(cli: click.Group) -> None:
    """Make `parse` a command of `cli`."""
    cli.add_command(parse)
