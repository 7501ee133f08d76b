"""Mesh and material of one level of detail as USD prims.

https://openusd.org/release/api/usd_geom_page_front.html
https://openusd.org/release/spec_usdpreviewsurface.html

Appearance: the texture feeds diffuseColor of a fully rough surface. UsdPreviewSurface has no unlit mode. The other
candidate, texture as emissiveColor over black, is exact in usdview but black in programs that use only the base colour
(thumbnails, converters, game engines), and in path tracers the figure glows at night and has no shading.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from exporters.asset import TexturedMesh
from exporters.colour import linear_from_srgb
from exporters.sampling import face_parts, vertex_colors
from exporters.solid import solid_of, unit_normals

NORMAL_TOLERANCE = 1e-3
"""Tolerance of the normals of copies of a vertex; below it, they are written as one smooth vertex."""


def define_mesh(stage: Any, source: TexturedMesh, part_names: dict[int, str]) -> Any:
    """Define /Figure/Mesh at the stage's edit target; returns the UsdGeom.Mesh."""
    from pxr import Sdf, UsdGeom, Vt

    solid = solid_of(source)
    points = source.vertices[solid.first]
    mesh = UsdGeom.Mesh.Define(stage, "/Figure/Mesh")
    # Without this, subdivision is the default and viewers smooth the figure.
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
        # One value per seam-split vertex that a triangle uses, indexed per corner; v runs upwards in USD.
        used, corners = np.unique(source.faces, return_inverse=True)
        uv = np.stack([source.uv[used, 0], np.float32(1) - source.uv[used, 1]], axis=1)
        st = primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
        st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(uv)))
        st.SetIndices(Vt.IntArray.FromNumpy(corners.reshape(-1).astype(np.int32)))
    if source.texture is None:
        _define_display_color(mesh, source, solid.first)
    if source.parts is not None:
        _define_parts(mesh, source, part_names)
    return mesh


def _define_display_color(mesh: Any, source: TexturedMesh, first: Any) -> None:
    from pxr import UsdGeom, Vt

    colors = vertex_colors(source)
    if colors is None:
        return
    linear = linear_from_srgb(colors[first] / 255.0).astype(np.float32)
    primvar = mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
    primvar.Set(Vt.Vec3fArray.FromNumpy(linear))


def _define_parts(mesh: Any, source: TexturedMesh, part_names: dict[int, str]) -> None:
    from pxr import Tf, UsdGeom, Vt

    labels = face_parts(source)
    for label in np.unique(labels).tolist():
        name = Tf.MakeValidIdentifier(part_names.get(label, f"part_{label}"))
        faces = Vt.IntArray.FromNumpy(np.flatnonzero(labels == label).astype(np.int32))
        UsdGeom.Subset.CreateUniqueGeomSubset(mesh, name, UsdGeom.Tokens.face, faces, "part", UsdGeom.Tokens.partition)


def define_material(stage: Any, mesh: Any, texture: str) -> None:
    """Define /Figure/Looks/Drawing at the stage's edit target and bind it; texture : a file next to the layer."""
    from pxr import Sdf, UsdGeom, UsdShade

    types = Sdf.ValueTypeNames
    UsdGeom.Scope.Define(stage, "/Figure/Looks")
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
