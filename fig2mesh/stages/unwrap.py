"""Stage `unwrap`: a texture atlas for each level of detail."""

from __future__ import annotations

import numpy as np

from fig2mesh.image_frame import image_frame
from fig2mesh.mesh.bake import drawn_faces
from fig2mesh.mesh.unwrap import Drawn
from fig2mesh.mesh.unwrap import unwrap as unwrap_mesh
from fig2mesh.records import Figure, Mesh, UvMesh

MIN_TEXELS = 128


def unwrap(figure: Figure, simplify: tuple[Mesh, ...], *, texture_size: int) -> tuple[UvMesh, ...]:
    """Texture coordinates: the visible part as in the drawing, the rest as charts."""
    frame = image_frame(figure)
    unwrapped = []
    for level, mesh in enumerate(simplify):
        pixels = frame.image_from_figure(mesh.vertices[:, :2].astype(np.float64))
        drawn = Drawn(drawn_faces(mesh), pixels)
        unwrapped.append(unwrap_mesh(mesh, texture_size=texels_of_level(texture_size, level), drawn=drawn))
    return tuple(unwrapped)


def texels_of_level(texture_size: int, level: int) -> int:
    """Texels per side of a level's texture: halved with each level, but enough for charts."""
    return max(texture_size >> level, min(texture_size, MIN_TEXELS))
