"""`fig2mesh plan`: the stages and effects that a request needs, and why."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import click

from fig2mesh.commands.options import messages, request_options
from fig2mesh.conversion.request import Request


@click.command("plan")
@request_options(Request)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of lines.")
@messages
def plan(request: Request, as_json: bool, quiet: bool, verbose: int) -> None:
    """Print the stages and effects that a request needs, and why. The options are those of the main command."""
    from fig2mesh.conversion.convert import settings_of
    from fig2mesh.conversion.plan import plan as plan_of

    request = replace(request, device="cpu", outputs=request.targets)
    planned = plan_of(settings_of(request), request.targets)
    if as_json:
        click.echo(json.dumps(asdict(planned), indent=2))
        return
    for each in (*planned.stages, *planned.effects):
        click.echo(f"{'run ' if each.runs else 'skip'}  {each.name:<9} {each.why}")
