"""Messages and progress on stderr."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click

log = logging.getLogger("fig2mesh")


def configure_logging(quiet: bool, verbose: int) -> None:
    """Log messages to stderr at the requested verbosity."""
    level = logging.ERROR if quiet else logging.DEBUG if verbose else logging.INFO
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(message)s"))
    log.handlers[:] = [handler]
    log.setLevel(level)
    log.propagate = False


def print_outputs(*paths: object) -> None:
    """List files on stdout, one a line, or lines about them, for scripts; nothing with --quiet."""
    if log.isEnabledFor(logging.INFO):
        for path in paths:
            click.echo(str(path))


@contextmanager
def progress(quiet: bool) -> Iterator[Callable[[str], object]]:
    """Yield a function that reports the current stage; a progress bar on terminals only."""
    if quiet or sys.stderr is None or not sys.stderr.isatty():
        yield lambda name: None
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("start", total=None)
        yield lambda name: bar.update(task, description=name)
