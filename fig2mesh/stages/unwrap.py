"""Stage `unwrap`: a texture atlas for each level of detail."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fig2mesh.contour.contour import Contour
from fig2mesh.contour.contour_mesh import front_of
from fig2mesh.image_frame import image_frame
from fig2mesh.mesh.bake import drawn_faces
from fig2mesh.mesh.unwrap import Drawn
from fig2mesh.mesh.unwrap import unwrap as unwrap_mesh
from fig2mesh.records import Figure, Mesh, UvMesh

MIN_TEXELS = 128


def unwrap(figure: Figure, simplify: tuple[Mesh, ...], contour: Contour, *, texture_size: int) -> tuple[UvMesh, ...]:
    """Texture coordinates: the visible part as in the drawing, the rest as charts."""
    frame = image_frame(figure)
    unwrapped = []
    for level, (mesh, inset) in enumerate(zip(simplify, contour.levels, strict=True)):
        shown = Mesh(inset.vertices, mesh.faces)
        pixels = frame.image_from_figure(shown.vertices[:, :2].astype(np.float64))
        drawn = Drawn(drawn_faces(shown), pixels)
        if inset.line is not None and not inset.line.culled:
            ribbon = inset.line.mesh
            drawn = replace(
                drawn, line_pixels=frame.image_from_figure(ribbon.vertices), line_faces=front_of(ribbon).faces
            )
        unwrapped.append(unwrap_mesh(mesh, texture_size=texels_of_level(texture_size, level), drawn=drawn))
    return tuple(unwrapped)


def texels_of_level(texture_size: int, level: int) -> int:
    """Texels per side of a level's texture: halved with each level, but enough for charts."""
    return max(texture_size >> level, min(texture_size, MIN_TEXELS))
