"""Facts about OpenUSD files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.errors import ExportError
from exporters.facts import file_sizes, solid_facts
from exporters.texture_files import texture_size
from exporters.usd.check import open_stage, reason_of, variations
from exporters.usd.place import anchor_of, heading_of
from exporters.usd.stage import VARIANT_SET
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import parse_json

FORMATS = {".usda": "OpenUSD text", ".usdc": "OpenUSD binary", ".usdz": "OpenUSD package"}


def usd_facts(path: Path) -> dict[str, Any]:
    """Return facts about a .usda, .usdc or .usdz file; see `exporters.inspect.inspect`.

    Vertices are in the frame of the default prim; polygons are counted as triangle fans.
    """
    stage = open_stage(path)
    from pxr import Tf

    try:
        return _stage_facts(stage, path)
    except Tf.ErrorException as error:  # binary layers are read lazily
        raise ExportError(path, reason_of(error), "write it again") from error


def _stage_facts(stage: Any, path: Path) -> dict[str, Any]:
    facts = stage.GetRootLayer().customLayerData
    metadata = facts.get("metadata")
    result: dict[str, Any] = {
        "format": FORMATS[path.suffix.lower()],
        "name": facts.get("name"),
        "copyright": facts.get("copyright"),
        "generator": facts.get("generator"),
        "metadata": parse_json(metadata) if isinstance(metadata, str) else None,
        "placement": _placement(stage.GetDefaultPrim(), dict(facts.get("georeference", {}))),
    }
    lods = []
    textures: list[Path] = []
    for variation in variations(stage):
        if not variation or variation.startswith(f"{VARIANT_SET}="):
            found, files = _selected(stage)
            textures += files
            lods.append({"variant": variation.partition("=")[2], **found})
    if not lods:  # other variant sets: the selected variants
        found, textures = _selected(stage)
        lods.append({"variant": "", **found})
    result |= {key: value for key, value in lods[0].items() if key != "variant"}
    if len(lods) > 1:
        result["lods"] = [
            {key: each.get(key) for key in ("variant", "vertices", "triangles", "texture_px", "solid")} for each in lods
        ]
    return result | {"files": file_sizes(path, *textures)}


def _selected(stage: Any) -> tuple[dict[str, Any], list[Path]]:
    """Return facts about the stage with the selected variants, and its textures."""
    from pxr import Ar, UsdGeom, UsdShade

    prims = list(stage.Traverse())
    meshes = [UsdGeom.Mesh(prim) for prim in prims if prim.IsA(UsdGeom.Mesh)]
    pieces = [_triangles(mesh, stage.GetDefaultPrim()) for mesh in meshes]
    starts = np.cumsum([0, *(len(points) for points, _ in pieces)])
    points = np.concatenate([np.empty((0, 3)), *(points for points, _ in pieces)])
    faces = [faces + start for (_, faces), start in zip(pieces, starts, strict=False)]
    parts = [
        subset.GetPrim().GetName()
        for mesh in meshes
        for subset in UsdGeom.Subset.GetGeomSubsets(mesh, UsdGeom.Tokens.face, "part")
    ]
    found: dict[str, Any] = {
        "vertices": len(points),
        **solid_facts(points, np.concatenate([np.empty((0, 3), np.int64), *faces])),
        "parts": parts or None,
    }
    files = []
    for prim in prims:
        shader = UsdShade.Shader(prim)
        if not shader or shader.GetIdAttr().Get() != "UsdUVTexture" or not shader.GetInput("file"):
            continue
        asset = shader.GetInput("file").Get()
        if asset is not None and asset.resolvedPath:
            opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(asset.resolvedPath))
            found.setdefault("texture_px", texture_size(bytes(opened.GetBuffer())))
            files.append(Path(asset.resolvedPath))
    return found, files


def _triangles(mesh: Any, root: Any) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points (V, 3) in the frame of `root` and triangles (F, 3) of a mesh."""
    from pxr import Usd, UsdGeom

    first = Usd.TimeCode.EarliestTime()  # the only value without animation
    points = np.array(mesh.GetPointsAttr().Get(first) or [], dtype=np.float64).reshape(-1, 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(first) or [], dtype=np.int64)
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get(first) or [], dtype=np.int64)
    if len(indices) != counts.sum() or (len(indices) and (indices.min() < 0 or indices.max() >= len(points))):
        raise DamagedFile("faces refer to points that do not exist")
    cache = UsdGeom.XformCache(first)
    matrix = cache.GetLocalToWorldTransform(mesh.GetPrim())
    if root:
        matrix = matrix * cache.GetLocalToWorldTransform(root).GetInverse()
    moved = np.array(matrix)  # acts on row vectors
    if not np.allclose(moved, np.eye(4), rtol=0, atol=1e-12):
        points = points @ moved[:3, :3] + moved[3, :3]
    starts = np.concatenate([[0], np.cumsum(counts)])[:-1]
    fans = np.maximum(counts - 2, 0)
    face = np.repeat(np.arange(len(counts)), fans)
    step = np.arange(len(face)) - np.repeat(np.cumsum(fans) - fans, fans)
    corners = np.stack([starts[face], starts[face] + step + 1, starts[face] + step + 2], axis=1)
    return points, indices[corners] if len(corners) else np.empty((0, 3), np.int64)


def _placement(prim: Any, recorded: dict[str, Any]) -> dict[str, Any] | None:
    place = anchor_of(prim) if prim else None
    if place is None:
        return None
    lon, lat, height = place
    return recorded | {"lon_deg": lon, "lat_deg": lat, "height_m": height, "heading_deg": heading_of(prim)}
