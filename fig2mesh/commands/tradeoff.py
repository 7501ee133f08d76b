"""`fig2mesh tradeoff`; nothing heavy is imported before it runs."""

from __future__ import annotations

from pathlib import Path

import click

FILE = click.Path(path_type=Path)
# fmt: off
KNOBS = ("quality", "parts", "precision", "part_nodes", "canvas_px", "voxel", "spacing", "mesher", "closing",
         "triangles", "texture_size", "textures")
# fmt: on
"""Names of `tradeoff.sweep.KNOBS`, which would load the pipeline."""


@click.command()
@click.argument("figures", type=FILE, nargs=-1, required=True, metavar="FIGURE...")
@click.option("-o", "--output", "folder", type=FILE, required=True, metavar="DIR", help="Table, plots and a page.")
@click.option("--knob", "knobs", type=click.Choice(KNOBS), multiple=True, help="Repeatable; default: all.")
@click.option("--keypoints", type=FILE, metavar="JSON", help="The 21 joints, of one picture.")
@click.option("--mask", type=FILE, metavar="PNG", help="Silhouette, of one picture.")
@click.option("--overwrite", is_flag=True, help="Replace files in DIR.")
@click.option("-q", "--quiet", is_flag=True, help="Only errors.")
def tradeoff(
    figures: tuple[Path, ...],
    folder: Path,
    knobs: tuple[str, ...],
    keypoints: Path | None,
    mask: Path | None,
    overwrite: bool,
    quiet: bool,
) -> None:
    """Show what accuracy costs: sweep every knob on FIGURE, error against seconds and memory.

    FIGURE is a folder with image.png, keypoints.json and, where needed, mask.png, or one picture with --keypoints.
    Each setting runs in a process of its own; all of them take some ten minutes a figure on two cores.
    """
    from fig2mesh.tradeoff.job import drawings_of
    from fig2mesh.tradeoff.job import tradeoff as run

    found = drawings_of(figures, keypoints, mask)
    run(found, folder, knobs or KNOBS, overwrite, lambda line: None if quiet else click.echo(line, err=True))
