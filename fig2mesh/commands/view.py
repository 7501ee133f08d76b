"""`fig2mesh view`: a figure in the browser; heavy imports wait until it runs."""

from __future__ import annotations

import click

from fig2mesh.commands.options import messages, request_options
from fig2mesh.terminal import configure_logging
from fig2mesh.view.request import ViewRequest


@click.command()
@request_options(ViewRequest, without=("altitude_mode",))
@messages
def view(request: ViewRequest, quiet: bool, verbose: int) -> None:
    """View FIGURE from all sides in a browser, which sphere-traces its part fields. Stop with Ctrl-C.

    With --lonlat or --map the figure stands on a globe, which needs CesiumJS.
    """
    from fig2mesh.view.job import run

    configure_logging(quiet, verbose)
    run(request, quiet)
