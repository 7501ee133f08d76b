"""Stage `bake`: the textures of all levels of detail (paper, appendix C)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fig2mesh.contour.contour import Contour, ContourLevel
from fig2mesh.contour.contour_mesh import front_of
from fig2mesh.field.body import Body
from fig2mesh.image_frame import image_frame
from fig2mesh.mesh.bake import Baked
from fig2mesh.mesh.bake import bake as bake_mesh
from fig2mesh.mesh.normals import vertex_normals
from fig2mesh.records import Figure, Mesh, UvMesh
from fig2mesh.settings import Contours
from fig2mesh.stages.unwrap import texels_of_level
from fig2mesh.texture.sources import Sources


def bake(
    figure: Figure,
    textures: Sources,
    body: Body,
    unwrap: tuple[UvMesh, ...],
    contour: Contour,
    *,
    contours: Contours,
    texture_size: int,
) -> tuple[Baked, ...]:
    """Colour of each texel, and its observed mask."""
    frame = image_frame(figure)
    if contours == "drop" and contour.bare is not None:
        textures = replace(textures, seen=contour.bare.astype(np.float32))
    return tuple(
        bake_mesh(
            mesh,
            vertex_normals(mesh.solid, body),
            body.nearest_labels(mesh.solid.vertices[mesh.solid.faces].mean(axis=1).astype(np.float32)),
            textures,
            frame,
            texels_of_level(texture_size, level),
            body,
            inset=contour.levels[level].vertices,
            bare=contour.bare,
            ribbon=_ribbon(contour.levels[level]),
        )
        for level, mesh in enumerate(unwrap)
    )


def _ribbon(level: ContourLevel) -> Mesh | None:
    return None if level.line is None or level.line.culled else front_of(level.line.mesh)
