"""`fig2mesh doctor`: whether everything that fig2mesh needs is there and works."""

from __future__ import annotations

import click


@click.command()
def doctor() -> None:
    """Say whether everything that fig2mesh needs is there and works."""
    from fig2mesh.libraries import examine

    healthy = True
    for name, fine, text in examine():
        healthy &= fine
        click.echo(f"{'ok  ' if fine else 'FAIL'} {name}: {text}")
    if not healthy:
        raise SystemExit(1)
