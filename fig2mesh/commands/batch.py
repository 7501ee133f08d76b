"""`fig2mesh batch`: a collection of figures, a row each; nothing heavy is imported before."""

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

    COLLECTION is a CSV, GeoJSON or GeoPackage with a row for each figure: figure (its picture, seen from COLLECTION's
    folder), lon and lat (or map, x and y), name, and any option of the main job as a column. Options of the main job
    given here hold for rows that do not have them.

    DIR gets a folder for each figure, a tileset over all, indexes for GIS, a STAC catalogue and manifest.jsonl. Run
    the same command again after whatever has happened: only what is missing or has changed is made.
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
    """A value whose paths are seen from here, not from the folder of the collection."""
    from fig2mesh.batch.row_files import DATUMS

    file = isinstance(value, Path) or (column == "altitude_datum" and value not in DATUMS)
    return os.path.abspath(value) if file else value


for each in reversed(shared_fields()):
    batch = parameter_of(each)(batch)
