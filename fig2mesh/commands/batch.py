"""`fig2mesh batch`: convert a collection of figures, one per row; heavy imports wait until it runs."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from fig2mesh.batch.columns import shared_fields
from fig2mesh.batch.request import BatchRequest
from fig2mesh.commands.options import messages, parameter_of, request_options
from fig2mesh.terminal import configure_logging

FROM_USER = (click.core.ParameterSource.COMMANDLINE, click.core.ParameterSource.ENVIRONMENT)


@click.command()
@request_options(BatchRequest)
@messages
@click.pass_context
def batch(context: click.Context, /, request: BatchRequest, quiet: bool, verbose: int, **shared: Any) -> int:
    """Convert a collection of figures.

    COLLECTION is a CSV, GeoJSON or GeoPackage file with a row for each figure. Its columns are figure (the picture,
    relative to COLLECTION's folder), lon and lat (or map, x and y), name, and any option of the main command. Options
    given here are the defaults for rows without that column.

    The output folder gets a folder for each figure, a tileset of all figures, indexes for GIS, a STAC catalogue and
    manifest.jsonl. After an interruption or a change, run the same command again: it makes only what is missing or
    outdated.
    """
    from fig2mesh.batch.job import run

    configure_logging(quiet, verbose)
    defaults = {
        field.name: _from_anywhere(field.name, shared[field.field])
        for field in shared_fields()
        if context.get_parameter_source(field.field) in FROM_USER
    }
    return run(replace(request, defaults=defaults), quiet, verbose)


def _from_anywhere(column: str, value: Any) -> Any:
    """A value with absolute paths: options are relative to the current folder, not to that of the collection."""
    from fig2mesh.batch.row_files import DATUMS

    file = isinstance(value, Path) or (column == "altitude_datum" and value not in DATUMS)
    return os.path.abspath(value) if file else value


for each in reversed(shared_fields()):
    batch = parameter_of(each)(batch)
