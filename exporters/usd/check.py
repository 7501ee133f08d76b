"""Checks of OpenUSD files: pxr.UsdValidation, the topology check that it omits, and the guarantees of fig2mesh.

Foreign files guarantee less: properties that USD does not require (metres, y up, a closed solid) are reported as infos.
Every variant of the default prim is checked, one variant set at a time, with the selected variants of the others.

https://openusd.org/release/api/usd_validation_page_front.html
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from exporters.errors import ExportError
from exporters.findings import Finding, Severity, as_infos, check_solid
from exporters.usd.place import check_usd_place
from exporters.usd.usdz import check_usdz

MAX_VARIANTS = 20
"""Limit of checked variants per set: some foreign files have hundreds."""


def open_stage(path: Path) -> Any:
    """Open a stage from disk. Raises ExportError for files that USD cannot open, or without usd-core."""
    try:
        from pxr import Tf, Usd
    except ImportError as error:
        raise ExportError(path, "usd-core is not installed", "install it with pip install usd-core") from error
    if not path.is_file():
        raise ExportError(path, "no such file", "check the path")
    try:
        stage = Usd.Stage.Open(str(path))
        # USD caches layers by name: without this a rewritten file shows its first version.
        stage.Reload()
    except Tf.ErrorException as error:
        raise ExportError(path, "USD cannot open it", "write it again") from error
    return stage


def reason_of(error: Exception) -> str:
    """Message of a USD error about a damaged file, without the location in its source code."""
    return "USD cannot read it (" + " ".join(str(error).rpartition(" : '")[2].split())[:100].rstrip("'") + ")"


def is_own(stage: Any) -> bool:
    """Whether the root layer was written by fig2mesh."""
    return bool(stage.GetRootLayer().customLayerData.get("generator") == "fig2mesh")


def variations(stage: Any) -> Iterator[str]:
    """Select every variant of the default prim in turn, in the session layer, and yield its name, "" if none."""
    from pxr import Usd

    prim = stage.GetDefaultPrim()
    if not prim or not prim.GetVariantSets().GetNames():
        yield ""
        return
    sets = prim.GetVariantSets()
    names = sets.GetNames()
    for name in names:
        variants = sets.GetVariantSet(name)
        before = variants.GetVariantSelection()
        for variant in variants.GetVariantNames()[:MAX_VARIANTS]:
            with Usd.EditContext(stage, stage.GetSessionLayer()):
                variants.SetVariantSelection(variant)
            yield f"{name}={variant}"
        with Usd.EditContext(stage, stage.GetSessionLayer()):
            variants.SetVariantSelection(before)


def check_usd(path: Path) -> list[Finding]:
    """Check a .usda, .usdc or .usdz file."""
    findings = check_usdz(path) if path.suffix.lower() == ".usdz" and path.is_file() else []
    try:
        stage = open_stage(path)
    except ExportError as error:
        return [Finding("error", "UNREADABLE", error.finding, path.name), *findings]
    from pxr import Tf

    try:
        return findings + _check_stage(stage, path)
    except Tf.ErrorException as error:  # binary layers are read lazily
        return [Finding("error", "UNREADABLE", reason_of(error), path.name), *findings]


def _check_stage(stage: Any, path: Path) -> list[Finding]:
    from pxr import UsdGeom

    findings: list[Finding] = []
    own = is_own(stage)
    if UsdGeom.GetStageMetersPerUnit(stage) != 1.0 or UsdGeom.GetStageUpAxis(stage) != UsdGeom.Tokens.y:
        found = f"{UsdGeom.GetStageMetersPerUnit(stage):g} m per unit, {UsdGeom.GetStageUpAxis(stage)} up"
        message = f"the stage has {found}" + (", not metres and Y" if own else "")
        findings.append(Finding("error" if own else "info", "STAGE_UNITS", message, path.name))
    findings += check_usd_place(stage, path.name, own)
    for variation in variations(stage):
        name = f"{path.name}: {variation}" if variation else path.name
        # Findings about the parts that all variants share would be repeated.
        findings += [finding for finding in _check_selected(stage, name, own) if not _known(finding, findings)]
    return findings


def _known(finding: Finding, before: list[Finding]) -> bool:
    def key(each: Finding) -> tuple[str, str, str]:
        return each.code, each.message, each.where.rpartition(": ")[2]

    return any(key(finding) == key(each) for each in before)


def _check_selected(stage: Any, name: str, own: bool) -> list[Finding]:
    from pxr import UsdGeom, UsdShade, UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    severities: dict[Any, Severity] = {
        UsdValidation.ValidationErrorType.Error: "error",
        UsdValidation.ValidationErrorType.Warn: "warning",
    }
    findings = []
    for issue in UsdValidation.ValidationContext(validators).Validate(stage):
        paths = [str(site.GetPrim().GetPath()) for site in issue.GetSites() if site.IsPrim()]
        where = ": ".join([name, *paths[:1]])
        findings.append(Finding(severities.get(issue.GetType(), "info"), issue.GetName(), issue.GetMessage(), where))
    prims = list(stage.Traverse())
    meshes = [UsdGeom.Mesh(prim) for prim in prims if prim.IsA(UsdGeom.Mesh)]
    if not meshes:
        findings.append(Finding("error" if own else "info", "NO_MESH", "no mesh", name))
    for mesh in meshes:
        findings += _check_mesh(mesh, f"{name}: {mesh.GetPath()}", own)
    for prim in prims:
        shader = UsdShade.Shader(prim)
        if not shader or shader.GetIdAttr().Get() != "UsdUVTexture":
            continue
        file = shader.GetInput("file")
        asset = file.Get() if file else None
        if asset is not None and ("<UDIM>" in asset.path or file.HasConnectedSource()):
            continue  # a pattern, or connected to another input
        if asset is None or not asset.resolvedPath:
            findings.append(Finding("error", "TEXTURE", f"{asset} not found", f"{name}: {prim.GetPath()}"))
    return findings


def _check_mesh(mesh: Any, where: str, own: bool) -> list[Finding]:
    from pxr import Usd, UsdGeom

    severity: Severity = "error" if own else "info"
    first = Usd.TimeCode.EarliestTime()  # the only value without animation
    findings = []
    if mesh.GetSubdivisionSchemeAttr().Get() != UsdGeom.Tokens.none:
        findings.append(
            Finding(severity, "SUBDIVISION", "subdivisionScheme is not none: viewers smooth the mesh", where)
        )
    points = np.array(mesh.GetPointsAttr().Get(first) or [], dtype=np.float64).reshape(-1, 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(first) or [], dtype=np.int64)
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get(first) or [], dtype=np.int64)
    if not len(indices) and not own:
        return [*findings, Finding("info", "NO_FACES", "no faces", where)]
    valid, reason = UsdGeom.Mesh.ValidateTopology(
        mesh.GetFaceVertexIndicesAttr().Get(first) or [], mesh.GetFaceVertexCountsAttr().Get(first) or [], len(points)
    )
    if not valid or not len(indices):
        return [*findings, Finding("error", "TOPOLOGY", str(reason) or "no faces", where)]
    if not np.isfinite(points).all():
        return [*findings, Finding("error", "NOT_FINITE", "points are NaN or infinite", where)]
    extent = np.array(mesh.GetExtentAttr().Get(first) or np.full((2, 3), np.nan), dtype=np.float64)
    if not np.array_equal(extent, [points.min(axis=0), points.max(axis=0)]):
        # A larger one is valid; without one, or with a smaller one, viewers may cull visible parts.
        contains = bool((extent[0] <= points.min(axis=0)).all() and (extent[1] >= points.max(axis=0)).all())
        extent_severity: Severity = "error" if own else "info" if contains else "warning"
        findings.append(
            Finding(extent_severity, "EXTENT", f"extent is {extent.tolist()}, not that of the points", where)
        )
    for primvar in UsdGeom.PrimvarsAPI(mesh).GetPrimvarsWithValues():
        size = {"constant": 1, "uniform": len(counts), "vertex": len(points), "faceVarying": len(indices)}
        size["varying"] = size["vertex"]
        expected = size.get(primvar.GetInterpolation())
        found = len(primvar.ComputeFlattened(first) or []) if primvar.GetTypeName().isArray else 0
        times = primvar.GetElementSize()
        if expected is not None and primvar.GetTypeName().isArray and found != expected * times:
            message = f"{primvar.GetName()} has {found} values, expected {expected * times}"
            findings.append(Finding("error", "PRIMVAR", message, where))
    if (counts != 3).any():
        return [*findings, Finding("info", "NOT_TRIANGLES", "faces are not all triangles", where)]
    flip = mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded
    faces = indices.reshape(-1, 3)[:, ::-1] if flip else indices.reshape(-1, 3)
    solid = check_solid(points, faces, where)
    return findings + (solid if own else as_infos(solid))
