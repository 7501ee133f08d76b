"""Stage `model`: the levels of detail in metres, standing on the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exporters.asset import OutlineMesh, Texture, TexturedMesh
from fig2mesh.asset_frame import asset_from_figure
from fig2mesh.contour.contour import Contour, ContourLevel
from fig2mesh.mesh.bake import Baked
from fig2mesh.records import FloatArray, Mesh, Pose3D, Surface, UvMesh
from georef.transform import Transform


def model(
    lift: Pose3D,
    surface: tuple[Surface, ...],
    simplify: tuple[Mesh, ...],
    unwrap: tuple[UvMesh, ...] | None,
    bake: tuple[Baked, ...] | None,
    contour: Contour | None,
    height_m: float,
) -> tuple[TexturedMesh, ...]:
    """Meshes in ASSET, finest first.

    unwrap, bake : None where no texture is requested
    height_m : height of the drawn figure, metres
    """
    if unwrap is None or bake is None or contour is None:
        return _levels(lift, surface, simplify, height_m)
    asset = asset_from_figure(lift, simplify[0].vertices, height_m)
    bare = _levels(lift, surface, simplify, height_m)
    return tuple(
        replace(
            level,
            vertices=asset.apply(inset.vertices).astype(np.float32)[mesh.solid_index],
            faces=mesh.faces,
            normals=None if level.normals is None else level.normals[mesh.solid_index],
            solid_index=mesh.solid_index,
            uv=mesh.uv,
            texture=Texture(texture.color),
            observed=Texture(texture.observed[..., None]),
            parts=None if level.parts is None else level.parts[mesh.solid_index],
            outline=_outline(contour, inset, asset, level.vertices, mesh.line_uv),
        )
        for level, mesh, texture, inset in zip(bare, unwrap, bake, contour.levels, strict=True)
    )


def _outline(
    contour: Contour, level: ContourLevel, asset: Transform, surface: FloatArray, uv: FloatArray | None
) -> OutlineMesh | None:
    if level.line is None:
        return None
    return OutlineMesh(
        vertices=asset.apply(level.line.mesh.vertices).astype(np.float32),
        faces=level.line.mesh.faces,
        colors=level.line.colors,
        culled=level.line.culled,
        surface=surface,
        width_m=float(asset.matrix[0, 0]) * contour.width,
        uv=uv,
    )


def _levels(
    pose: Pose3D, surfaces: tuple[Surface, ...], meshes: tuple[Mesh, ...], height_m: float
) -> tuple[TexturedMesh, ...]:
    asset = asset_from_figure(pose, meshes[0].vertices, height_m)
    scale = float(asset.matrix[0, 0])
    return tuple(
        TexturedMesh(
            vertices=asset.apply(mesh.vertices).astype(np.float32),
            faces=mesh.faces,
            normals=surface.normals,
            solid_index=np.arange(len(mesh.vertices), dtype=np.int32),
            parts=surface.parts,
            deviation_m=(surface.deviation[0] * scale, surface.deviation[1] * scale),
        )
        for mesh, surface in zip(meshes, surfaces, strict=True)
    )
