"""`fig2mesh inspect`: summary of the contents of files."""

from __future__ import annotations

import json
from pathlib import Path

import click

from fig2mesh.commands.options import FILE


@click.command()
@click.argument("files", type=FILE, nargs=-1, required=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of lines.")
def inspect(files: tuple[Path, ...], as_json: bool) -> None:
    """Summarise the contents of GLB, tileset, USD, PLY and OBJ files."""
    from exporters.inspect import inspect as facts_of

    facts = {str(path): facts_of(path) for path in files}
    if as_json:
        click.echo(json.dumps(next(iter(facts.values())) if len(facts) == 1 else facts, indent=2))
        return
    for path, found in facts.items():
        click.echo(path)
        for key, value in found.items():
            if value is not None:
                click.echo(f"  {key}: {shown(value)}")


def shown(value: object) -> str:
    """A fact as text for people: numbers to seven decimals (a degree: 1 cm), small ones to three digits."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 1e-3 else f"{round(value, 7):.12g}"
    if isinstance(value, dict):
        return ", ".join(f"{key} {shown(each)}" for key, each in value.items() if each is not None)
    if isinstance(value, list | tuple):
        nested = any(isinstance(each, list | tuple | dict) for each in value)
        return ("; " if nested else ", ").join(map(shown, value))
    return str(value)
