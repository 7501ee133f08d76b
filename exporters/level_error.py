"""Geometric error of levels of detail: the loss of shape and the loss of colour, in one number for clients of 3D Tiles.

A coarser level has fewer triangles and a smaller texture. Clients compare one error per level with a number of pixels
on the screen, 16 by default. A mesh that is 16 pixels off is rare to notice; a texel of 16 pixels is a blur. The error
is therefore the larger of the distance of the mesh and 16 times the size of a texel on the figure: a level is shown
while its texels cover at most about one pixel.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from exporters.asset import TexturedMesh

MAX_SCREEN_SPACE_ERROR_PX = 16
"""Default maximumScreenSpaceError of CesiumJS: a tile is refined where its geometric error covers more pixels."""

MAX_TEXEL_PX = 1.0
"""Largest size of a texel of a coarse level on the screen, pixels, in a client with the default error."""


def level_errors(lods: Sequence[TexturedMesh]) -> tuple[float, ...]:
    """Geometric errors, metres, of levels of detail, finest first: 0 for the finest, then never decreasing."""
    errors = (max(mesh.deviation_m[1], sample_m(mesh) / MAX_TEXEL_PX * MAX_SCREEN_SPACE_ERROR_PX) for mesh in lods[1:])
    return monotone_errors([0.0, *errors])


def monotone_errors(errors: Sequence[float]) -> tuple[float, ...]:
    """Make the errors of levels, finest first, non-decreasing, as tiles need them to be refined."""
    return tuple(np.maximum.accumulate(errors).tolist())


def sample_m(mesh: TexturedMesh) -> float:
    """Distance between samples of colour on the surface, metres: texels, or vertices where the mesh has no texture.

    Texels: the square root of surface per texel, over all triangles that have any. Vertices: the mean length of edges.
    """
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    if mesh.texture is None or mesh.uv is None:
        return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean()) if len(corners) else 0.0
    rows, columns = mesh.texture.pixels.shape[:2]
    flat = mesh.uv[mesh.faces].astype(np.float64) * [columns, rows]
    u, v = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    texels = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normals, axis=1)
    textured = texels > 0
    return float(np.sqrt(area[textured].sum() / texels[textured].sum())) if textured.any() else 0.0
