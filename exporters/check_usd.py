"""Checks of OpenUSD files: pxr.UsdValidation, the topology check it leaves out, and our own promises.

https://openusd.org/release/api/usd_validation_page_front.html
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from exporters.errors import ExportError
from exporters.findings import Finding, Severity, check_solid


def open_stage(path: Path) -> Any:
    """A stage of what is on disk now. Raises ExportError for what USD cannot open, or without usd-core."""
    try:
        from pxr import Tf, Usd
    except ImportError as error:
        raise ExportError(path, "usd-core is not installed", "pip install usd-core") from error
    if not path.is_file():
        raise ExportError(path, "is not there", "check the name")
    try:
        stage = Usd.Stage.Open(str(path))
        # USD keeps layers by name: without this a file written twice shows its first version.
        stage.Reload()
    except Tf.ErrorException as error:
        raise ExportError(path, "USD cannot open it", "write it again") from error
    return stage


def check_usd(path: Path) -> list[Finding]:
    """Findings about a .usda, .usdc or .usdz file."""
    try:
        stage = open_stage(path)
    except ExportError as error:
        return [Finding("error", "UNREADABLE", error.finding, path.name)]
    from pxr import UsdGeom, UsdShade, UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    severities: dict[Any, Severity] = {
        UsdValidation.ValidationErrorType.Error: "error",
        UsdValidation.ValidationErrorType.Warn: "warning",
    }
    findings = []
    for issue in UsdValidation.ValidationContext(validators).Validate(stage):
        paths = [str(site.GetPrim().GetPath()) for site in issue.GetSites() if site.IsPrim()]
        where = ": ".join([path.name, *paths[:1]])
        findings.append(Finding(severities.get(issue.GetType(), "info"), issue.GetName(), issue.GetMessage(), where))
    if UsdGeom.GetStageMetersPerUnit(stage) != 1.0 or UsdGeom.GetStageUpAxis(stage) != UsdGeom.Tokens.y:
        findings.append(Finding("error", "STAGE_UNITS", "the stage is not in metres with y up", path.name))
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    if not meshes:
        findings.append(Finding("error", "NO_MESH", "no mesh", path.name))
    for mesh in meshes:
        findings += _check_mesh(mesh, f"{path.name}: {mesh.GetPath()}")
    for prim in stage.Traverse():
        shader = UsdShade.Shader(prim)
        if shader and shader.GetIdAttr().Get() == "UsdUVTexture":
            asset = shader.GetInput("file").Get()
            if asset is None or not asset.resolvedPath:
                findings.append(Finding("error", "TEXTURE", f"{asset} is not there", f"{path.name}: {prim.GetPath()}"))
    return findings


def _check_mesh(mesh: Any, where: str) -> list[Finding]:
    from pxr import UsdGeom

    findings = []
    if mesh.GetSubdivisionSchemeAttr().Get() != UsdGeom.Tokens.none:
        findings.append(Finding("error", "SUBDIVISION", "subdivisionScheme is not none: viewers smooth it", where))
    points = np.array(mesh.GetPointsAttr().Get() or [], dtype=np.float64).reshape(-1, 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get() or [], dtype=np.int64)
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get() or [], dtype=np.int64)
    valid, reason = UsdGeom.Mesh.ValidateTopology(
        mesh.GetFaceVertexIndicesAttr().Get() or [], mesh.GetFaceVertexCountsAttr().Get() or [], len(points)
    )
    if not valid or not len(indices):
        return [*findings, Finding("error", "TOPOLOGY", str(reason) or "no faces", where)]
    if not np.isfinite(points).all():
        return [*findings, Finding("error", "NOT_FINITE", "points are NaN or infinite", where)]
    extent = np.array(mesh.GetExtentAttr().Get() or np.full((2, 3), np.nan), dtype=np.float64)
    if not np.array_equal(extent, [points.min(axis=0), points.max(axis=0)]):
        findings.append(Finding("error", "EXTENT", f"extent is {extent.tolist()}, not that of the points", where))
    for primvar in UsdGeom.PrimvarsAPI(mesh).GetPrimvarsWithValues():
        size = {"constant": 1, "uniform": len(counts), "vertex": len(points), "faceVarying": len(indices)}
        expected = size.get(primvar.GetInterpolation())
        found = len(primvar.ComputeFlattened() or [])
        if expected is not None and primvar.GetTypeName().isArray and found != expected:
            message = f"{primvar.GetName()} has {found} values, expected {expected}"
            findings.append(Finding("error", "PRIMVAR", message, where))
    if (counts != 3).any():
        return [*findings, Finding("info", "NOT_TRIANGLES", "faces are not all triangles", where)]
    return findings + check_solid(points, indices.reshape(-1, 3), where)
