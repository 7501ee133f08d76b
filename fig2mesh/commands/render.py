"""`fig2mesh render`: pictures of drawings and models; heavy imports wait until it runs."""

from __future__ import annotations

import click

from fig2mesh.commands.options import messages, request_options
from fig2mesh.render.request import RenderRequest
from fig2mesh.terminal import configure_logging


@click.command()
@request_options(RenderRequest)
@messages
def render(request: RenderRequest, quiet: bool, verbose: int) -> None:
    """Render FIGURE by sphere tracing its part fields, or render a model (.glb .gltf .ply .obj)."""
    from fig2mesh.render.job import run

    configure_logging(quiet, verbose)
    run(request, quiet)
