"""`fig2mesh annotate`: joints and parts by hand, in the browser; nothing heavy is imported before."""

from __future__ import annotations

import click

from fig2mesh.annotate.request import AnnotateRequest
from fig2mesh.commands.options import messages, request_options
from fig2mesh.terminal import configure_logging


@click.command()
@request_options(AnnotateRequest)
@messages
def annotate(request: AnnotateRequest, quiet: bool, verbose: int) -> None:
    """Correct joints, silhouette and parts of FIGURE in a browser, with a preview of the solid; Ctrl-C ends it."""
    from fig2mesh.annotate.job import run

    configure_logging(quiet, verbose)
    run(request)
