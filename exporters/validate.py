"""Checking files that were written: the rules of their formats and our own promises about figures."""

from __future__ import annotations

import os
from pathlib import Path

from exporters.errors import ExportError
from exporters.findings import Finding
from exporters.gis.check import check_czml, check_geojson
from exporters.gltf.check import check_gltf
from exporters.tiles.check import check_tileset
from exporters.triangles.check import check_triangles
from exporters.usd.process import check_usd_isolated
from georef.errors import PlacementError
from georef.untrusted.damage import DamagedFile

__all__ = ["Finding", "validate"]

CHECKS = {
    ".usda": check_usd_isolated,
    ".usdc": check_usd_isolated,
    ".usdz": check_usd_isolated,
    ".ply": check_triangles,
    ".obj": check_triangles,
    ".czml": check_czml,
    ".geojson": check_geojson,
}
CHECKS_WITH_KHRONOS = {".glb": check_gltf, ".gltf": check_gltf, ".json": check_tileset}


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
    except (DamagedFile, PlacementError) as error:
        findings = [Finding("error", "DAMAGED", str(error), path.name)]
    return sorted(findings, key=lambda finding: ("error", "warning", "info").index(finding.severity))


def _check_any(path: Path, external: bool) -> list[Finding]:
    suffix = ".json" if path.is_dir() else path.suffix.lower()
    if suffix in CHECKS_WITH_KHRONOS:
        return CHECKS_WITH_KHRONOS[suffix](path, external)
    if suffix in CHECKS:
        return CHECKS[suffix](path)
    raise ExportError(path, f"no check for suffix {suffix or 'none'}", "see exporters.write.FORMATS")
