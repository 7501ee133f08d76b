"""Checking files that were written: the rules of their formats and our own promises about figures."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from exporters.errors import DAMAGE, ExportError
from exporters.findings import Finding, check_solid
from exporters.gis.check import check_czml, check_geojson
from exporters.gltf.check import check_gltf
from exporters.solid import merged_by_position
from exporters.tiles.check import check_tileset
from exporters.triangle_files import check_triangle_file, references_of
from exporters.usd.process import check_usd_apart
from georef.errors import PlacementError
from georef.untrusted.json_file import is_there

__all__ = ["Finding", "read_triangles", "validate"]


def validate(path: str | os.PathLike[str], external: bool = True) -> list[Finding]:
    """Findings about a file or tileset, worst first; an empty list or nothing but infos is a clean bill.

    path : .glb, .gltf, .usda, .usdc, .usdz, .ply, .obj, .czml, .geojson, a tileset.json or its folder
    external : for glTF run the Khronos validator too, if Node and the npm package gltf-validator are there

    Raises ExportError for a path that is not there or of another kind.
    """
    path = Path(path)
    if not path.exists():
        raise ExportError(path, "is not there", "check the name")
    try:
        findings = _check_any(path, external)
    except ExportError:
        raise
    except (PlacementError, *DAMAGE) as error:
        # Files from elsewhere are damaged in more ways than can be listed; all of them end here.
        reason = " ".join(str(error).split())[:120]
        findings = [Finding("error", "DAMAGED", f"{type(error).__name__}: {reason}", path.name)]
    return sorted(findings, key=lambda finding: ("error", "warning", "info").index(finding.severity))


def _check_any(path: Path, external: bool) -> list[Finding]:
    suffix = path.suffix.lower()
    if path.is_dir() or suffix == ".json":
        return check_tileset(path, external)
    if suffix in (".glb", ".gltf"):
        return check_gltf(path, external)
    if suffix in (".usda", ".usdc", ".usdz"):
        return check_usd_apart(path)
    if suffix in (".ply", ".obj"):
        return _check_triangles(path)
    if suffix == ".czml":
        return check_czml(path)
    if suffix == ".geojson":
        return check_geojson(path)
    raise ExportError(path, f"no check for suffix {suffix or 'none'}", "see exporters.write.FORMATS")


def read_triangles(path: Path) -> Any:
    """A .ply or .obj file as trimesh.Trimesh, its vertices not merged. Raises ExportError if unreadable."""
    import trimesh

    check_triangle_file(path)
    try:
        mesh = trimesh.load_mesh(str(path), process=False)
    except Exception as error:  # trimesh lets whatever its parsers meet through
        raise ExportError(path, f"cannot be read ({error})", "write it again") from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise ExportError(path, "holds no single triangle mesh", "write it again")
    return mesh


def _check_triangles(path: Path) -> list[Finding]:
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
    """Files that an OBJ and its material libraries name but that are not there."""
    return [
        Finding("error", "REFERENCE", f"{name} is not there", f"{file.name}: {word}")
        for file, word, name, target in references_of(path)
        if not is_there(target)
    ]
