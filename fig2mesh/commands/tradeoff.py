"""`fig2mesh tradeoff`: accuracy against time and memory; heavy imports wait until it runs."""

from __future__ import annotations

from pathlib import Path

import click

FILE = click.Path(path_type=Path)
# fmt: off
KNOBS = ("quality", "parts", "precision", "part_nodes", "canvas_px", "voxel", "spacing", "mesher", "closing",
         "triangles", "texture_size", "textures")
# fmt: on
"""Names of `tradeoff.sweep.KNOBS`, repeated because that module loads the pipeline."""


@click.command()
@click.argument("figures", type=FILE, nargs=-1, required=True, metavar="FIGURE...")
@click.option(
    "-o",
    "--output",
    "folder",
    type=FILE,
    required=True,
    metavar="DIR",
    help="Output folder for a table, plots and a page.",
)
@click.option(
    "--knob", "knobs", type=click.Choice(KNOBS), multiple=True, help="Setting to vary. Repeatable. Default: all."
)
@click.option("--keypoints", type=FILE, metavar="JSON", help="The 21 joints, for a single picture.")
@click.option("--mask", type=FILE, metavar="PNG", help="Silhouette, for a single picture.")
@click.option("--overwrite", is_flag=True, help="Replace existing files in DIR.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
def tradeoff(
    figures: tuple[Path, ...],
    folder: Path,
    knobs: tuple[str, ...],
    keypoints: Path | None,
    mask: Path | None,
    overwrite: bool,
    quiet: bool,
) -> None:
    """Measure the cost of accuracy: vary each setting on FIGURE; report errors, seconds and memory.

    FIGURE is a folder with image.png, keypoints.json and, where needed, mask.png; or a single picture with
    --keypoints. Each run is a process of its own; all runs take about ten minutes per figure on two cores.
    """
    from fig2mesh.tradeoff.job import drawings_of
    from fig2mesh.tradeoff.job import tradeoff as run

    found = drawings_of(figures, keypoints, mask)
    run(found, folder, knobs or KNOBS, overwrite, lambda line: None if quiet else click.echo(line, err=True))
