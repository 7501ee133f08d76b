"""Stage `contour`: the line that is drawn along the silhouette, taken off the surface and made a mesh of its own."""

from __future__ import annotations

from fig2mesh.contour.contour import Contour, contour_of
from fig2mesh.field.body import Body
from fig2mesh.image_frame import image_frame
from fig2mesh.records import Figure, Mesh
from fig2mesh.settings import Contours


def contour(figure: Figure, simplify: tuple[Mesh, ...], body: Body, *, contours: Contours) -> Contour:
    """Inset surfaces of all levels, each with its ribbon or hull."""
    return contour_of(figure, image_frame(figure), simplify, body, contours)
