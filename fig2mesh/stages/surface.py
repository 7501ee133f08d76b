"""Stage `surface`: normals, parts and deviation of the simplified meshes."""

from __future__ import annotations

from fig2mesh.counters import count
from fig2mesh.field.body import Body
from fig2mesh.mesh.normals import vertex_normals
from fig2mesh.mesh.simplify import deviation
from fig2mesh.mesh.solid import Solid
from fig2mesh.records import FloatArray, Mesh, Surface


def surface(body: Body, solid: Solid, simplify: tuple[Mesh, ...], *, normals: bool) -> tuple[Surface, ...]:
    """One record for each level; normals : whether any output or effect needs shading normals."""
    return tuple(
        Surface(
            normals=_shading_normals(mesh, body) if normals else None,
            parts=body.nearest_labels(mesh.vertices),
            deviation=deviation(mesh, solid.mesh),
        )
        for mesh in simplify
    )


def _shading_normals(mesh: Mesh, body: Body) -> FloatArray:
    count("shading normals", len(mesh.vertices))
    return vertex_normals(mesh, body)
