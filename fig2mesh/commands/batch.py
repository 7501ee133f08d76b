"""`fig2mesh batch`: a collection of figures, a row each; nothing heavy is imported before."""

from __future__ import annotations

from typing import Any

import click

from fig2mesh.commands.options import FILE, messages


@click.command()
@click.argument("collection", type=FILE)
@click.option("-o", "--output", type=FILE, metavar="DIR", help="Folder of the outputs.")
@click.option("--jobs", type=click.IntRange(1, 1024), metavar="N", help="Rows at a time; default: one for each core.")
@click.option(
    "--engine",
    type=click.Choice(["local", "dask"]),
    default="local",
    show_default=True,
    help="Worker processes of this machine, or a Dask cluster.",
)
@click.option("--address", metavar="tcp://…", help="Of the Dask scheduler.")
@click.option(
    "--resume/--fresh",
    default=True,
    show_default=True,
    help="Keep what an earlier run has finished, or make everything anew.",
)
@click.option(
    "--format", "formats", multiple=True, metavar="SUFFIX", help="Made besides .glb, such as usdz; repeatable."
)
@click.option("--dry-run", is_flag=True, help="Check every row, report all problems, write nothing.")
@click.option(
    "--progress",
    type=click.Choice(["auto", "bar", "json", "none"]),
    default="auto",
    show_default=True,
    help="json: events on stdout, one a line. With -v the bar shows what each worker does.",
)
@click.option(
    "--timeout",
    type=click.FloatRange(1),
    default=1800.0,
    show_default=True,
    metavar="S",
    help="Longest that a row may take (local engine).",
)
@click.option("--root", type=FILE, metavar="DIR", help="Folder that rows' files may not leave; default: COLLECTION's.")
@click.option("--layer", metavar="NAME", help="Of a GeoPackage; default: the one with a column figure.")
@click.option("--unplaced", is_flag=True, help="Rows need no place on the earth.")
@click.option("--date", metavar="DATE", help="Of rows that have none: 1893, 1893-05-17, 1893/1895; for the catalogue.")
@click.option("--title", metavar="TEXT", help="Of the catalogue; default: COLLECTION's stem.")
@click.option(
    "--visible-from",
    type=float,
    metavar="M",
    help="Distance from which figures of the tileset are drawn; default: about 1,100 times the height of each.",
)
@click.option("--overwrite", is_flag=True, help="Replace files in DIR that are not of an earlier batch.")
@messages
@click.pass_context
def batch(context: click.Context, /, formats: tuple[str, ...], date: str | None, **options: Any) -> int:
    """Convert a collection of figures.

    COLLECTION is a CSV, GeoJSON or GeoPackage with a row for each figure: figure (its picture, seen from COLLECTION's
    folder), lon and lat (or map, x and y), name, and any option of the main job as a column. Options of the main job
    given here hold for rows that do not have them.

    DIR gets a folder for each figure, a tileset over all, indexes for GIS, a STAC catalogue and manifest.jsonl. Run
    the same command again after whatever has happened: only what is missing or has changed is made.
    """
    from fig2mesh.batch.job import run
    from fig2mesh.batch.row_options import given_defaults, row_defaults

    names = {option.name for option in row_defaults()}
    defaults = given_defaults(context)
    if formats:
        defaults["format"] = formats
    if date is not None:
        defaults["date"] = date
    return run(**{name: value for name, value in options.items() if name not in names}, defaults=defaults)


def add_to(cli: click.Group, main_job: click.Command) -> None:
    """Make `batch` a command of `cli`; main_job : whose options hold for all rows when they are given."""
    from fig2mesh.batch.row_options import defaults_of

    own = {option.name for option in batch.params}
    batch.params += [option for option in defaults_of(main_job) if option.name not in own]
    cli.add_command(batch)
