"""Templates of pages, stored next to the code."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files


def asset(name: str, package: str = "fig2mesh.view") -> str:
    """Text of a file in a package."""
    return files(package).joinpath(name).read_text(encoding="utf-8")


def filled(template: str, values: Mapping[str, str], package: str = "fig2mesh.view") -> str:
    """Fill a template: replace each {{name}}, without expanding the values again."""
    pieces = asset(template, package).split("{{")
    text = [pieces[0]]
    for piece in pieces[1:]:
        name, rest = piece.split("}}", 1)
        text += [values[name], rest]
    return "".join(text)
