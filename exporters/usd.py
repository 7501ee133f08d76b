"""OpenUSD: .usda and .usdc with the texture beside them, .usdz with everything inside.

https://openusd.org/release/api/usd_geom_page_front.html
https://openusd.org/release/spec_usdpreviewsurface.html
https://openusd.org/release/spec_usdz.html
https://docs.omniverse.nvidia.com/kit/docs/omni.usd.schema.geospatial/latest/USD_SCHEMAS.html
https://github.com/CesiumGS/cesium-omniverse

Place: there is no georeference in USD itself, so both schemas in use are authored, as plain attributes that need no
plugin: Cesium's georeference and globe anchor, NVIDIA's reference position. Both read a y-up stage as x east, y up,
z south, which is how a figure stands that looks at the reader of a north-up map; other headings turn the figure.

Look: the texture feeds diffuseColor of a fully rough surface. UsdPreviewSurface has no unlit mode. The other
candidate, texture as emissiveColor over black, is exact in usdview but black in whatever takes only the base colour
(thumbnails, converters, game engines), and in path tracers the figure glows at night and drops out of the shading.
"""

from __future__ import annotations

import json
import struct
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from exporters.asset import Asset, TexturedMesh
from exporters.errors import ExportError
from exporters.georeference import georeference
from exporters.sampling import face_parts, linear_from_srgb, vertex_colors
from exporters.solid import solid_of, unit_normals
from georef.placement import GeoPlacement

NORMAL_TOLERANCE = 1e-3
"""Copies of a vertex whose normals differ by less, in length of the difference, are written as one smooth vertex."""


def write_usd(asset: Asset, path: Path | str) -> None:
    """Write the finest level of detail as USD; the suffix of `path` decides which kind.

    asset : vertices in the ASSET frame, written unchanged as float32; the stage is y-up, in metres
    path : .usda or .usdc (with `<stem>_texture.png` beside it) or .usdz; replaced if it exists

    The same asset and file name give the same bytes. Raises ExportError for another suffix, or without usd-core.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".usdz":
        _write_usdz(asset, path)
        return
    if suffix not in (".usda", ".usdc"):
        raise ExportError(path, f"suffix {suffix or 'none'}", "use .usda, .usdc or .usdz")
    texture = f"{path.stem}_texture.png"
    _write_layer(asset, path, texture)
    if asset.mesh.texture is not None:
        path.with_name(texture).write_bytes(asset.mesh.texture.png)


def _write_usdz(asset: Asset, path: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        layer = Path(folder, "figure.usdc")
        _write_layer(asset, layer, "texture.png")
        members = [("figure.usdc", layer.read_bytes())]
    if asset.mesh.texture is not None:
        members.append(("texture.png", asset.mesh.texture.png))
    # UsdUtils packs the same way but stamps files with the time of day; here equal input gives equal bytes.
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, data in members:
            info = zipfile.ZipInfo(name)  # dated 1980-01-01
            assert archive.fp is not None
            # Data must start at multiples of 64 bytes: 30 bytes of local header, the name, 4 bytes of extra header.
            padding = -(archive.fp.tell() + 30 + len(name) + 4) % 64
            info.extra = struct.pack("<HH", 0x1986, padding) + bytes(padding)
            archive.writestr(info, data)


def _write_layer(asset: Asset, path: Path, texture: str) -> None:
    try:
        from pxr import Kind, Sdf, Usd, UsdGeom
    except ImportError as error:
        raise ExportError(path, "usd-core is not installed", "pip install usd-core") from error
    # An anonymous layer, as opening `path` itself would hand out whatever layer of that name is still open.
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
    mesh = _define_mesh(stage, asset)
    if asset.mesh.texture is not None:
        _define_material(stage, mesh, texture)
    if not layer.Export(str(path)):
        raise OSError(f"{path}: USD could not write the layer")


def _place(stage: Any, root: Any, placement: GeoPlacement) -> None:
    from pxr import Gf, Sdf, UsdGeom

    turn = 180.0 - placement.heading_deg
    # The two operations that Cesium's globe anchor knows how to rewrite when the prim is moved.
    root.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(0.0))
    root.AddRotateXYZOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(0.0, turn, 0.0))

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


def _define_mesh(stage: Any, asset: Asset) -> Any:
    from pxr import Sdf, UsdGeom, Vt

    source, solid = asset.mesh, solid_of(asset.mesh)
    points = source.vertices[solid.first]
    mesh = UsdGeom.Mesh.Define(stage, "/Figure/Mesh")
    # Without this, subdivision is the default and viewers melt the figure.
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateOrientationAttr(UsdGeom.Tokens.rightHanded)
    mesh.CreateDoubleSidedAttr(False)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points.min(axis=0), points.max(axis=0)])))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(solid.faces), 3, dtype=np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(solid.faces.reshape(-1)))

    normals = unit_normals(source.shading_normals)
    if np.linalg.norm(normals - normals[solid.first[solid.vertex]], axis=1).max() < NORMAL_TOLERANCE:
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals[solid.first]))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    else:
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals[source.faces.reshape(-1)]))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying)
    primvars = UsdGeom.PrimvarsAPI(mesh)
    if source.uv is not None:
        # One value per seam-split vertex, indexed per corner; v runs upwards in USD.
        uv = np.stack([source.uv[:, 0], np.float32(1) - source.uv[:, 1]], axis=1)
        st = primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
        st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(uv)))
        st.SetIndices(Vt.IntArray.FromNumpy(np.ascontiguousarray(source.faces.reshape(-1))))
    if source.texture is None:
        _define_display_color(mesh, source, solid.first)
    if source.parts is not None:
        _define_parts(mesh, asset)
    return mesh


def _define_display_color(mesh: Any, source: TexturedMesh, first: Any) -> None:
    from pxr import UsdGeom, Vt

    colors = vertex_colors(source)
    if colors is None:
        return
    linear = linear_from_srgb(colors[first]).astype(np.float32)
    primvar = mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
    primvar.Set(Vt.Vec3fArray.FromNumpy(linear))


def _define_parts(mesh: Any, asset: Asset) -> None:
    from pxr import Tf, UsdGeom, Vt

    labels = face_parts(asset.mesh)
    for label in np.unique(labels).tolist():
        name = Tf.MakeValidIdentifier(asset.part_names.get(label, f"part_{label}"))
        faces = Vt.IntArray.FromNumpy(np.flatnonzero(labels == label).astype(np.int32))
        UsdGeom.Subset.CreateUniqueGeomSubset(
            mesh, name, UsdGeom.Tokens.face, faces, "part", UsdGeom.Tokens.partition
        )  # fmt: skip


def _define_material(stage: Any, mesh: Any, texture: str) -> None:
    from pxr import Sdf, UsdShade

    types = Sdf.ValueTypeNames
    material = UsdShade.Material.Define(stage, "/Figure/Looks/Drawing")
    reader = UsdShade.Shader.Define(stage, "/Figure/Looks/Drawing/Coordinates")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", types.String).Set("st")
    image = UsdShade.Shader.Define(stage, "/Figure/Looks/Drawing/Texture")
    image.CreateIdAttr("UsdUVTexture")
    image.CreateInput("file", types.Asset).Set(Sdf.AssetPath(f"./{texture}"))
    image.CreateInput("sourceColorSpace", types.Token).Set("sRGB")
    image.CreateInput("wrapS", types.Token).Set("clamp")
    image.CreateInput("wrapT", types.Token).Set("clamp")
    image.CreateInput("st", types.Float2).ConnectToSource(reader.CreateOutput("result", types.Float2))
    surface = UsdShade.Shader.Define(stage, "/Figure/Looks/Drawing/Surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", types.Color3f).ConnectToSource(image.CreateOutput("rgb", types.Float3))
    surface.CreateInput("roughness", types.Float).Set(1.0)
    surface.CreateInput("metallic", types.Float).Set(0.0)
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", types.Token))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
