"""The main command, `fig2mesh FIGURE …`: convert one figure from its files to its outputs."""

from __future__ import annotations

import json
from dataclasses import replace

import click

from fig2mesh.commands.options import messages, request_options
from fig2mesh.conversion.request import Request
from fig2mesh.terminal import configure_logging, log, print_outputs, progress


@click.command("make", hidden=True)
@request_options(Request)
@messages
def make(request: Request, quiet: bool, verbose: int) -> None:
    """Make a 3D model of FIGURE."""
    configure_logging(quiet, verbose)
    run(request, quiet)


def run(request: Request, quiet: bool = False) -> None:
    """Convert the figure of a request and write its outputs. Raises InputError."""
    from exporters.text import plain_texts
    from fig2mesh.conversion.convert import convert
    from fig2mesh.conversion.observer import Observer
    from fig2mesh.conversion.outputs import check_request, models_of, near_note, write_outputs
    from fig2mesh.conversion.place import clamp_note, log_place
    from fig2mesh.conversion.summary import opening, summary_of
    from fig2mesh.conversion.text_file import write_text
    from fig2mesh.counters import counting

    request = replace(request, outputs=request.targets)
    # Whatever can be rejected is rejected before the work begins.
    check_request(request)
    with progress(quiet) as advance, counting() as counts:
        observer = Observer(advance)
        done = convert(request, observer=observer)
        log_place(
            done.placed, clamp_note(request, models_of(request.targets)), near_note(request, done.placed.height_m)
        )
        for note in done.notes:
            log.warning("%s: %s", request.figure, note)
        written = write_outputs(done, request, observer)
    if request.report is not None:
        from fig2mesh.conversion.report import make_report

        facts = plain_texts(make_report(done, written, observer, counts))
        write_text(request.report, json.dumps(facts, indent=2, allow_nan=False) + "\n")
    log.info("%s", summary_of(done))
    opened = opening(request.targets, request.has_place)
    if opened is not None:
        log.info("%s", opened)
    print_outputs(*request.targets)
