"""`fig2mesh validate`: check files against their specifications."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import click

from fig2mesh.commands.options import FILE


@click.command()
@click.argument("files", type=FILE, nargs=-1, required=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of lines.")
def validate(files: tuple[Path, ...], as_json: bool) -> None:
    """Check files against their specifications. The exit code is 2 if there are errors."""
    from exporters.validate import validate as check

    findings = {str(path): check(path) for path in files}
    if as_json:
        click.echo(json.dumps({path: [asdict(f) for f in found] for path, found in findings.items()}, indent=2))
    else:
        for path, found in findings.items():
            errors = sum(f.severity == "error" for f in found)
            warnings = sum(f.severity == "warning" for f in found)
            click.echo(f"{path}: {errors} errors, {warnings} warnings")
            for f in found:
                click.echo(f"  {f.severity}: {f.code}: {f.message} [{f.where}]")
    if any(f.severity == "error" for found in findings.values() for f in found):
        raise SystemExit(2)
