"""Writer of OpenUSD: .usda and .usdc with textures next to them, self-contained .usdz.

https://openusd.org/release/api/usd_geom_page_front.html
https://openusd.org/release/spec_usdz.html
https://docs.omniverse.nvidia.com/kit/docs/omni.usd.schema.geospatial/latest/USD_SCHEMAS.html
https://github.com/CesiumGS/cesium-omniverse

Place: USD itself has no georeference, so both schemas in use are authored, as plain attributes that need no plugin:
Cesium's georeference and globe anchor, NVIDIA's reference position. Both interpret a y-up stage as x east, y up, z
south, so an unrotated figure faces the reader of a north-up map; other headings rotate the figure.

Levels of detail are the variants LOD0 (finest, selected), LOD1 ... of the variant set LOD of /Figure. USD has no
selection by distance: the author of a scene selects. A figure of one level has no variant set.
"""

from __future__ import annotations

import json
import struct
import tempfile
import zipfile
from pathlib import Path
from typing import Any

from exporters.asset import Asset, without_outline
from exporters.errors import ExportError
from exporters.georeference import georeference
from exporters.usd.mesh import define_material, define_mesh
from georef.placement import GeoPlacement

VARIANT_SET = "LOD"


def variant_name(lod: int) -> str:
    """Name of the variant of a level of detail, 0 the finest."""
    return f"LOD{lod}"


def texture_name(stem: str, lod: int) -> str:
    """File name of the texture of a level of detail next to a layer called `stem`."""
    return stem + (f"_lod{lod}" if lod else "") + "_texture.png"


def write_usd(asset: Asset, path: Path | str) -> None:
    """Write all levels of detail as USD; the suffix of `path` determines the format.

    asset : vertices in the ASSET frame, written unchanged as float32; the stage is y-up, in metres
    path : .usda or .usdc (with `<stem>_texture.png` next to it, `<stem>_lod1_texture.png` ...) or .usdz; replaced if
        it exists

    The same asset and file name give the same bytes. Raises ExportError for another suffix, or without usd-core.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".usdz":
        _write_usdz(asset, path)
        return
    if suffix not in (".usda", ".usdc"):
        raise ExportError(path, f"unknown suffix {suffix!r}", "use .usda, .usdc or .usdz")
    names = [texture_name(path.stem, lod) for lod in range(len(asset.lods))]
    _write_layer(asset, path, names)
    for name, mesh in zip(names, asset.lods, strict=True):
        if mesh.texture is not None:
            path.with_name(name).write_bytes(mesh.texture.png)


def _write_usdz(asset: Asset, path: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        layer = Path(folder, "figure.usdc")
        names = [texture_name("figure", lod) for lod in range(len(asset.lods))]
        _write_layer(asset, layer, names)
        members = [("figure.usdc", layer.read_bytes())]
    pictures = zip(names, asset.lods, strict=True)
    members += [(name, mesh.texture.png) for name, mesh in pictures if mesh.texture is not None]
    # UsdUtils packs the same way but adds the time of day; here equal input gives equal bytes.
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, data in members:
            info = zipfile.ZipInfo(name)  # dated 1980-01-01
            assert archive.fp is not None
            # Data must start at multiples of 64 bytes: 30 bytes of local header, the name, 4 bytes of extra header.
            padding = -(archive.fp.tell() + 30 + len(name) + 4) % 64
            info.extra = struct.pack("<HH", 0x1986, padding) + bytes(padding)
            archive.writestr(info, data)


def _write_layer(asset: Asset, path: Path, textures: list[str]) -> None:
    try:
        from pxr import Kind, Sdf, Usd, UsdGeom
    except ImportError as error:
        raise ExportError(path, "usd-core is not installed", "install it with pip install usd-core") from error
    # An anonymous layer, as opening `path` itself would return a layer of that name that is still open.
    layer = Sdf.Layer.CreateAnonymous(path.suffix.lower())
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    facts: dict[str, Any] = {"generator": "fig2mesh", "name": asset.name}
    if asset.copyright:
        facts["copyright"] = asset.copyright
    if asset.metadata:
        facts["metadata"] = json.dumps(asset.metadata, ensure_ascii=False, allow_nan=False)
    if asset.placement is not None:
        facts["georeference"] = georeference(asset.placement)
    layer.customLayerData = facts

    root = UsdGeom.Xform.Define(stage, "/Figure")
    root.GetPrim().SetDisplayName(asset.name)
    Usd.ModelAPI(root).SetKind(Kind.Tokens.component)
    stage.SetDefaultPrim(root.GetPrim())
    if asset.placement is not None:
        _place(stage, root, asset.placement)
    _define_levels(stage, root.GetPrim(), asset, textures)
    if not layer.Export(str(path)):
        raise OSError(f"{path}: USD could not write the layer")


def _define_levels(stage: Any, prim: Any, asset: Asset, textures: list[str]) -> None:
    def define(lod: int) -> None:
        mesh = define_mesh(stage, without_outline(asset.lods[lod]), asset.part_names)
        if asset.lods[lod].texture is not None:
            define_material(stage, mesh, textures[lod])

    if len(asset.lods) == 1:
        define(0)
        return
    variants = prim.GetVariantSets().AddVariantSet(VARIANT_SET)
    for lod in range(len(asset.lods)):
        variants.AddVariant(variant_name(lod))
        variants.SetVariantSelection(variant_name(lod))
        with variants.GetVariantEditContext():
            define(lod)
    variants.SetVariantSelection(variant_name(0))


def _place(stage: Any, root: Any, placement: GeoPlacement) -> None:
    from pxr import Gf, Sdf, UsdGeom

    turn = 180.0 - placement.heading_deg
    # The two operations that Cesium's globe anchor can update when the prim is moved.
    root.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(0.0))
    # Floats, as UsdGeom.XformCommonAPI wants them: three.js misreads vectors of whole doubles in binary files.
    root.AddRotateXYZOp(UsdGeom.XformOp.PrecisionFloat).Set(Gf.Vec3f(0.0, turn, 0.0))

    place = {"longitude": placement.lon_deg, "latitude": placement.lat_deg, "height": placement.height_m}
    origin = stage.DefinePrim("/CesiumGeoreference", "CesiumGeoreferencePrim")
    prim = root.GetPrim()
    for key, value in place.items():
        origin.CreateAttribute(f"cesium:georeferenceOrigin:{key}", Sdf.ValueTypeNames.Double, False).Set(value)
        prim.CreateAttribute(f"cesium:anchor:{key}", Sdf.ValueTypeNames.Double, False).Set(value)
    prim.CreateRelationship("cesium:anchor:georeferenceBinding", False).SetTargets([origin.GetPath()])
    prim.AddAppliedSchema("CesiumGlobeAnchorSchemaAPI")

    wgs84 = "omni:geospatial:wgs84:reference:"
    position = Gf.Vec3d(placement.lat_deg, placement.lon_deg, placement.height_m)  # latitude first in this schema
    prim.CreateAttribute(wgs84 + "referencePosition", Sdf.ValueTypeNames.Double3, False).Set(position)
    prim.CreateAttribute(wgs84 + "tangentPlane", Sdf.ValueTypeNames.Token, False).Set("ENU")
    prim.AddAppliedSchema("OmniWGS84ReferencePositionAPI")
