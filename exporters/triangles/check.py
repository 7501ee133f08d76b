"""Checks of PLY and OBJ files: a closed solid, and existing references."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from exporters.errors import ExportError
from exporters.findings import Finding, check_solid
from exporters.solid import merged_by_position
from exporters.triangles.files import read_triangles, references_of
from georef.untrusted.json_file import is_plain_file


def check_triangles(path: Path) -> list[Finding]:
    """Check a .ply or .obj file."""
    try:
        mesh = read_triangles(path)
    except ExportError as error:
        return [Finding("error", "UNREADABLE", error.finding, path.name)]
    vertices = np.asarray(mesh.vertices)
    if not np.isfinite(vertices).all():
        return [Finding("error", "NOT_FINITE", "vertices are NaN or infinite", path.name)]
    findings = []
    if path.suffix.lower() == ".obj":
        findings = _check_references(path)
    return findings + check_solid(*merged_by_position(vertices, np.asarray(mesh.faces)), path.name)


def _check_references(path: Path) -> list[Finding]:
    """Report missing files that an OBJ and its material libraries refer to."""
    return [
        Finding("error", "REFERENCE", f"{name} not found", f"{file.name}: {word}")
        for file, word, name, target in references_of(path)
        if not is_plain_file(target)
    ]
