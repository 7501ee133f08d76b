"""Contour of a figure: surfaces inset by the width of the drawn line, and the line as a mesh of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fig2mesh.contour.contour_mesh import ContourMesh, hull, ribbon
from fig2mesh.contour.inset import continued_over, inset, steady
from fig2mesh.contour.rim import Rim, rim_of
from fig2mesh.field.body import Body
from fig2mesh.image_frame import ImageFrame
from fig2mesh.mesh.bake import visible_points
from fig2mesh.mesh.normals import vertex_normals
from fig2mesh.records import ByteArray, Figure, FloatArray, Mesh
from fig2mesh.settings import Contours
from fig2mesh.texture.bare import without_line
from fig2mesh.texture.drawn_line import drawn_line, paper_beside, with_soft_edge
from fig2mesh.texture.sources import continued

Floats = NDArray[np.float64]

MAX_OUTSIDE = 0.1
"""Largest distance of the ribbon's inner edge off the surface, relative to its width."""

MIN_TAKEN = 0.6
"""Least share of a line's width by which the surface is inset for the line to be taken off it: the rest would show."""


@dataclass(frozen=True)
class ContourLevel:
    """One level of detail.

    vertices : (V, 3) float32, FIGURE, inset by the width of the line
    line : the line as a mesh; None where it stays off, or none is drawn
    """

    vertices: FloatArray
    line: ContourMesh | None


@dataclass(frozen=True)
class Contour:
    """Contour of a drawing.

    levels : finest first
    width : median width of the line, FIGURE units; 0 where none is drawn
    bare : (H, W, 3) uint8 sRGB, the drawing without it, continued beyond the silhouette; None where none is drawn
    """

    levels: tuple[ContourLevel, ...]
    width: float
    bare: ByteArray | None


def contour_of(figure: Figure, frame: ImageFrame, meshes: tuple[Mesh, ...], body: Body, contours: Contours) -> Contour:
    """Contour of a figure, read off the drawing along the rim of its meshes.

    meshes : levels of detail, FIGURE; contours : "drop" leaves the surfaces where they are and makes no line
    """
    picture, paper = continued(figure.rgba, figure.mask), paper_beside(figure.rgba, figure.mask)
    levels, width, bare = [], 0.0, None
    for mesh in meshes:
        normals = vertex_normals(mesh, body)
        rim = rim_of(mesh, normals)
        shown = _unobstructed(mesh, rim, rim.points)
        line = drawn_line(picture, frame, rim.points, rim.outwards, shown, paper)
        drawn = line.width > 0
        if not drawn.any():
            levels.append(ContourLevel(mesh.vertices, None))
            continue
        readings = steady(rim, line.width)
        if contours == "keep":
            # A ribbon shows the drawing itself, soft edges and what is beside them included.
            readings = with_soft_edge(readings, frame.units_per_px)
        widths = np.maximum(continued_over(mesh, rim, readings[:, None])[:, 0], 0.0)
        colors = _of_pens(continued_over(mesh, rim, np.where(drawn[:, None], line.color, np.nan)), line.pens)
        moved = on_the_ground(mesh, inset(mesh, normals, widths), float(np.median(line.width[drawn])))
        # Thin things are inset by less than the line's width, and the rest of the line stays on the surface.
        taken = rim.at(np.linalg.norm(mesh.vertices - moved, axis=1))
        stands = _standing(mesh, rim, readings > 0, taken, body)
        if bare is None:
            width = float(np.median(line.width[drawn]))
            off = shown & (stands >= MIN_TAKEN * rim.at(widths))
            bare = without_line(picture, figure.mask, frame, rim.points[off], stands[off], rim.at(colors)[off])
        if contours == "drop":
            levels.append(ContourLevel(mesh.vertices, None))
        elif contours == "hull":
            levels.append(ContourLevel(moved, hull(mesh, colors)))
        else:
            levels.append(ContourLevel(moved, ribbon(rim, stands, rim.at(colors))))
    return Contour(tuple(levels), width, bare)


def on_the_ground(mesh: Mesh, moved: FloatArray, width: float) -> FloatArray:
    """(V, 3) inset vertices, of which the lowest keep their height: soles stand where they stood.

    moved : (V, 3) inset vertices; width : height above the lowest vertex over which they come to be inset, FIGURE units
    """
    before = mesh.vertices[:, 1]
    share = np.clip(1 - (before - before.min()) / max(width, 1e-9), 0.0, 1.0)
    result = moved.copy()
    result[:, 1] += share * (before - moved[:, 1])
    return result


def _of_pens(colors: Floats, pens: Floats) -> Floats:
    """(V, 3) nearest of the pens (P, 3) to colours (V, 3)."""
    return np.asarray(pens[np.linalg.norm(colors[:, None] - pens, axis=-1).argmin(axis=1)])


def _standing(mesh: Mesh, rim: Rim, drawn: NDArray[np.bool_], taken: Floats, body: Body) -> Floats:
    """(N,) width of the ribbon: 0 where it would be seen from the front and nothing is drawn, and where it would leave
    the body: on flat soles and hems the rim wanders, and its normal with it."""
    inwards = np.append(-rim.outwards, np.zeros((len(taken), 1)), axis=1)
    middle, end = (rim.points + share * taken[:, None] * inwards for share in (0.5, 1.0))
    bare = ~drawn & _unobstructed(mesh, rim, middle)
    outside = body.distance(end.astype(np.float32)) > MAX_OUTSIDE * taken
    return np.where(bare | outside, 0.0, taken)


def _unobstructed(mesh: Mesh, rim: Rim, points: Floats) -> NDArray[np.bool_]:
    """(N,) bool: points at the rim with nothing in front of them."""
    return visible_points(mesh, points, np.append(rim.outwards, np.zeros((len(points), 1)), axis=1))
