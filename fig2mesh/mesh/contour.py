"""Contour of a figure: surfaces inset by the width of the drawn line, and the line as a mesh of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.body import Body
from fig2mesh.image_frame import ImageFrame
from fig2mesh.mesh.bake import visible_points
from fig2mesh.mesh.contour_mesh import ContourMesh, hull, ribbon
from fig2mesh.mesh.inset import continued_over, inset, steady
from fig2mesh.mesh.normals import vertex_normals
from fig2mesh.mesh.rim import Rim, rim_of
from fig2mesh.records import Figure, FloatArray, Mesh
from fig2mesh.settings import Contours
from fig2mesh.texture.bare import without_line
from fig2mesh.texture.contour import DrawnLine, drawn_line
from fig2mesh.texture.sources import continued


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
    bare : (H, W, 3) float32 sRGB 0-255, the drawing without it, continued beyond the silhouette; None where none is
        drawn
    """

    levels: tuple[ContourLevel, ...]
    width: float
    bare: NDArray[np.float32] | None


def contour_of(
    figure: Figure, frame: ImageFrame, meshes: tuple[Mesh, ...], body: Body, contours: Contours
) -> Contour:
    """Contour of a figure, read off the drawing along the rim of its meshes.

    meshes : levels of detail, FIGURE; contours : "drop" leaves the surfaces where they are and makes no line
    """
    picture = continued(figure.rgba, figure.mask)
    levels, width, bare = [], 0.0, None
    for number, mesh in enumerate(meshes):
        normals = vertex_normals(mesh, body)
        rim = rim_of(mesh, normals)
        line = drawn_line(picture, frame, rim.points, rim.outwards, _shown(mesh, rim))
        drawn = line.width > 0
        if number == 0 and drawn.any():
            width = float(np.median(line.width[drawn]))
            bare = without_line(picture, figure.mask, frame, rim.points, line)
        if contours == "drop" or not drawn.any():
            levels.append(ContourLevel(mesh.vertices, None))
        else:
            levels.append(_level(mesh, normals, rim, line, contours))
    return Contour(tuple(levels), width, bare)


def _level(mesh: Mesh, normals: FloatArray, rim: Rim, line: DrawnLine, contours: Contours) -> ContourLevel:
    readings = np.concatenate([steady(rim, line.width)[:, None]], axis=1)
    widths = np.maximum(continued_over(mesh, rim, readings)[:, 0], 0.0)
    pens = np.where((line.width > 0)[:, None], line.color, np.nan)
    colors = continued_over(mesh, rim, pens)
    moved = inset(mesh, normals, widths)
    if contours == "hull":
        return ContourLevel(moved, hull(mesh, colors))
    # The ribbon ends where the surface begins, however far that could be inset.
    depth = np.linalg.norm(mesh.vertices - moved, axis=1)
    return ContourLevel(moved, ribbon(rim, rim.at(depth), rim.at(colors)))


def _shown(mesh: Mesh, rim: Rim) -> NDArray[np.bool_]:
    """(N,) bool: points of the rim with nothing in front of them."""
    return visible_points(mesh, rim.points, np.append(rim.outwards, np.zeros((len(rim.points), 1)), axis=1))
