"""Validation of files: the rules of their formats and the guarantees of fig2mesh about figures."""

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
    """Return findings about a file or tileset, most severe first; no findings or only infos mean a valid file.

    path : .glb, .gltf, .usda, .usdc, .usdz, .ply, .obj, .czml, .geojson, a tileset.json or its folder
    external : for glTF run the Khronos validator too, if Node and the npm package gltf-validator are installed

    Raises ExportError for a missing or unsupported file.
    """
    path = Path(path)
    if not path.exists():
        raise ExportError(path, "no such file or folder", "check the path")
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
    known = [*CHECKS_WITH_KHRONOS, *CHECKS]
    raise ExportError(path, f"cannot check files with suffix {suffix or 'none'}", f"give one of {', '.join(known)}")
