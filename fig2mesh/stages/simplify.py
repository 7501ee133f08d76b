"""Stage `simplify`: the levels of detail, finest first."""

from __future__ import annotations

from fig2mesh.mesh.simplify import simplify as simplify_mesh
from fig2mesh.mesh.solid import Solid
from fig2mesh.records import Mesh

MIN_TRIANGLES = 200


def simplify(solid: Solid, *, triangles: int, lods: int) -> tuple[Mesh, ...]:
    """`lods` meshes, the finest of `triangles` triangles; each has a quarter of those of the one before."""
    return tuple(simplify_mesh(solid.mesh, max(triangles // 4**level, MIN_TRIANGLES)) for level in range(lods))
