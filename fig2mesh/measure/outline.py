"""Measures of a model's outline as a mesh, and of the inset that makes room for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exporters.asset import OutlineMesh, TexturedMesh, without_outline
from exporters.solid import unmatched_edges
from fig2mesh.measure.solid import solid_mesh
from fig2mesh.mesh.topology import check_solid, component_volumes, face_components, face_vectors
from fig2mesh.records import Mesh


@dataclass(frozen=True)
class OutlineLaws:
    """Validity of an outline.

    closed : every edge is run along equally often in both directions, so that no side of it lacks its counterpart
    inverted : of a hull, which is shown from its front only: neighbours agree on the outside, and every piece encloses
        a negative volume; true of ribbons, which have two sides and enclose nothing
    outside_m : largest distance by which a vertex lies outside of the bounding box of the surface as drawn, metres
    turned : number of triangles of the solid that the inset turned by more than 90 degrees
    """

    closed: bool
    inverted: bool
    outside_m: float
    turned: int


def outline_laws(mesh: TexturedMesh) -> OutlineLaws:
    """Check the outline of a model; one without an outline breaks no law."""
    outline = mesh.outline
    if outline is None:
        return OutlineLaws(True, True, 0.0, 0)
    places, surface = (array.astype(np.float64) for array in (outline.vertices, outline.surface))
    beyond = np.maximum(surface.min(axis=0) - places, places - surface.max(axis=0))
    return OutlineLaws(
        closed=unmatched_edges(outline.faces) == 0,
        inverted=not outline.culled or _inverted(outline),
        outside_m=max(float(beyond.max()), 0.0),
        turned=turned_triangles(mesh),
    )


def turned_triangles(mesh: TexturedMesh) -> int:
    """Number of triangles that the inset turned by more than 90 degrees, or left without area."""
    before, after = (face_vectors(solid_mesh(one)) for one in (without_outline(mesh), mesh))
    sound = np.linalg.norm(before, axis=1) > 0
    return int((np.einsum("fd,fd->f", before, after)[sound] <= 0).sum())


def _inverted(outline: OutlineMesh) -> bool:
    body = Mesh(outline.vertices, outline.faces)
    return check_solid(body).oriented and bool((component_volumes(body, face_components(body.faces)) < 0).all())
