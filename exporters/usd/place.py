"""Place of a figure in a USD stage, in each of the schemas that are written.

https://github.com/CesiumGS/cesium-omniverse
https://docs.omniverse.nvidia.com/kit/docs/omni.usd.schema.geospatial/latest/USD_SCHEMAS.html
"""

from __future__ import annotations

import math
from typing import Any

from exporters.findings import Finding, check_place, check_same_place

Place = tuple[float, float, float]

HEADING_TOLERANCE_DEG = 1e-6


def anchor_of(prim: Any) -> Place | None:
    """Longitude, latitude and height of a prim with Cesium's globe anchor."""
    return _cesium(prim, "cesium:anchor:")


def reference_position_of(prim: Any) -> Place | None:
    """Longitude, latitude and height of a prim with NVIDIA's reference position."""
    attribute = prim.GetAttribute("omni:geospatial:wgs84:reference:referencePosition")
    value = attribute.Get() if attribute else None
    return None if value is None else (float(value[1]), float(value[0]), float(value[2]))  # latitude comes first


def heading_of(prim: Any) -> float:
    """Compass bearing that the front, +z, of a prim points to on a stage of x east, y up, z south; degrees."""
    from pxr import Gf, UsdGeom

    front = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(0).TransformDir(Gf.Vec3d(0, 0, 1))
    return math.degrees(math.atan2(front[0], -front[2])) % 360.0


def check_usd_place(stage: Any, name: str, own: bool) -> list[Finding]:
    """Check that all places of the default prim of a stage agree; own : also with the record, in files by fig2mesh."""
    prim = stage.GetDefaultPrim()
    if not prim:
        return []
    where = f"{name}: {prim.GetPath()}"
    findings = []
    anchor, reference = anchor_of(prim), reference_position_of(prim)
    if anchor is not None and reference is not None:
        findings += check_same_place(anchor, reference, "omni:geospatial compared with cesium:anchor", where)
    record = dict(stage.GetRootLayer().customLayerData.get("georeference", {}))
    if not own or not (record or anchor or reference):
        return findings
    problems = check_place(record, f"{name}: customLayerData")
    if problems:
        return findings + problems
    recorded = (record["lon_deg"], record["lat_deg"], record["height_m"])
    origin = stage.GetPrimAtPath("/CesiumGeoreference")
    others = {
        "cesium:anchor": anchor,
        "omni:geospatial": reference,
        "CesiumGeoreference": _cesium(origin, "cesium:georeferenceOrigin:") if origin else None,
    }
    for source, place in others.items():
        if place is None:
            findings.append(Finding("error", "GEOREFERENCE", f"{source} has no place", where))
        else:
            findings += check_same_place(recorded, place, source, where)
    turn = (heading_of(prim) - record["heading_deg"] + 180.0) % 360.0 - 180.0
    if abs(turn) > HEADING_TOLERANCE_DEG:
        findings.append(Finding("error", "GEOREFERENCE", f"rotated {turn:.3g} degrees from its heading", where))
    return findings


def _cesium(prim: Any, prefix: str) -> Place | None:
    values = []
    for key in ("longitude", "latitude", "height"):
        attribute = prim.GetAttribute(prefix + key)
        value = attribute.Get() if attribute else None
        if value is None:
            return None
        values.append(float(value))
    return values[0], values[1], values[2]
