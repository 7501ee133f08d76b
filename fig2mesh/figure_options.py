"""Options that every command has which starts from a drawing; click alone is imported."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

F = TypeVar("F", bound=Callable[..., Any])

FILE = click.Path(path_type=Path)


def figure_files(command: F) -> F:
    """What belongs to the picture of a figure: silhouette, joints, parts, and where it is."""
    silhouette = "Silhouette, bright on dark; default: the alpha channel, or inferred."
    options = (
        click.option("--mask", type=FILE, metavar="PNG", help=silhouette),
        click.option("--keypoints", type=FILE, metavar="JSON", help="The 21 joints; default: inferred."),
        click.option("--part-labels", type=FILE, metavar="PNG", help="Part label of every pixel."),
        click.option(
            "--bbox", type=int, nargs=4, metavar="X0 Y0 X1 Y1", help="Part of the picture that holds the figure."
        ),
    )
    # The one applied last is listed first.
    for option in reversed(options):
        command = option(command)
    return command


def messages(command: F) -> F:
    """How much is said."""
    command = click.option("-v", "--verbose", count=True, help="More messages; twice: tracebacks.")(command)
    return click.option("-q", "--quiet", is_flag=True, help="Only errors.")(command)
