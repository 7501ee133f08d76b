"""Meshing of a body as one closed solid for each piece of the drawing, by either mesher."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fig2mesh.field.body import Body
from fig2mesh.mesh.ball_pivot import ball_pivot
from fig2mesh.mesh.close import CloseReport, close
from fig2mesh.mesh.isosurface import isosurface
from fig2mesh.mesh.topology import check_solid, component_areas, face_components, select_faces
from fig2mesh.records import Mesh, PointCloud
from fig2mesh.settings import Closing

CRUMB = 0.01
"""Threshold, share of the surface, below which components beyond the drawn pieces are dropped."""

ISOSURFACE_SPACING = 1.4
"""Grid spacing of the isosurface relative to the scan's point spacing: about as many triangles."""


@dataclass(frozen=True)
class Meshing:
    """Report of meshing.

    mesher : "ball-pivot" or "isosurface", whichever made the final mesh
    closing : the report of closing; None for the isosurface, which is closed from the start
    components : of the mesh
    crumbs : components dropped because they are not a piece of the drawing
    note : "" or the reason why the requested mesher was not used
    """

    mesher: str
    closing: CloseReport | None
    components: int
    crumbs: int
    note: str = ""


@dataclass(frozen=True)
class Solid:
    """mesh : closed, oriented, manifold, FIGURE; how : report of meshing."""

    mesh: Mesh
    how: Meshing


def make_solid(cloud: PointCloud | None, body: Body, pieces: int, *, spacing: float, closing: Closing) -> Solid:
    """Mesh a body; `cloud` is its scan for ball pivoting, points `spacing` apart; None for the isosurface.

    The drawing has `pieces` pieces and so has the solid: where ball pivoting bridges a narrow gap between two of them,
    the isosurface replaces it.
    """
    if cloud is None:
        return _by_isosurface(body, spacing, pieces, "")
    closed, report = close(ball_pivot(cloud, spacing), body, method=closing)
    mesh, crumbs = _without_crumbs(closed, pieces)
    found = check_solid(mesh)
    if found.outward and found.components == pieces:
        mesher = "isosurface" if report.method == "isosurface" else "ball-pivot"
        return Solid(mesh, Meshing(mesher, report, found.components, crumbs, report.fallback))
    reason = f"ball pivoting made {found.components} components of {pieces} drawn pieces"
    other = _by_isosurface(body, spacing, pieces, reason)
    if found.outward and other.how.components != pieces:
        return Solid(mesh, Meshing("ball-pivot", report, found.components, crumbs, reason))
    return other


def _by_isosurface(body: Body, spacing: float, pieces: int, note: str) -> Solid:
    mesh, crumbs = _without_crumbs(isosurface(body, spacing=ISOSURFACE_SPACING * spacing), pieces)
    return Solid(mesh, Meshing("isosurface", None, check_solid(mesh).components, crumbs, note))


def _without_crumbs(mesh: Mesh, pieces: int) -> tuple[Mesh, int]:
    """Drop components that are neither among the `pieces` largest nor above `CRUMB`."""
    labels = face_components(mesh.faces)
    areas = component_areas(mesh, labels)
    if len(areas) <= pieces:
        return mesh, 0
    rank = np.argsort(np.argsort(-areas))
    kept = (rank < pieces) | (areas > CRUMB * areas.sum())
    if kept.all():
        return mesh, 0
    return select_faces(mesh, kept[labels]), int((~kept).sum())
