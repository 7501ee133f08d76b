"""`fig2mesh annotate`: annotate a figure by hand, in the browser; heavy imports wait until it runs."""

from __future__ import annotations

import click

from fig2mesh.annotate.request import AnnotateRequest
from fig2mesh.commands.options import messages, request_options
from fig2mesh.terminal import configure_logging


@click.command()
@request_options(AnnotateRequest)
@messages
def annotate(request: AnnotateRequest, quiet: bool, verbose: int) -> None:
    """Correct the joints, silhouette and parts of FIGURE in a browser, with a preview in 3D. Stop with Ctrl-C."""
    from fig2mesh.annotate.job import run

    configure_logging(quiet, verbose)
    run(request)
