"""Stage `solid`: a closed mesh, by ball pivoting or as an isosurface (paper §4.5)."""

from __future__ import annotations

from fig2mesh.field.body import Body
from fig2mesh.mesh.solid import Solid, make_solid
from fig2mesh.records import PointCloud
from fig2mesh.settings import Closing, Mesher


def solid(
    cloud: PointCloud | None, body: Body, pieces: int, *, mesher: Mesher, closing: Closing, spacing: float
) -> Solid:
    """A closed, oriented, manifold mesh, FIGURE, with as many components as the drawing has pieces.

    cloud : None where the isosurface is requested
    """
    return make_solid(cloud if mesher == "ball-pivot" else None, body, pieces, spacing=spacing, closing=closing)
