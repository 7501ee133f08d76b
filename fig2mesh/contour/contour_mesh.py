"""Meshes that show a drawn contour: a ribbon along the rim, or an inverted hull around the figure.

The ribbon stands on the rim, at right angles to the line of sight: the drawing's own line, seen from the front and from
behind, and from the side no more than its edge. Both its sides are triangles, so that it needs no client's help. The
hull is the surface before it was inset, with its faces turned round; it shows the line from everywhere, in clients that
draw only the front sides of faces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fig2mesh.contour.rim import Rim
from fig2mesh.records import Mesh

Floats = NDArray[np.float64]

OVERLAP: Final = 0.15
"""Share of its width by which the ribbon reaches under the inset surface, so that no gap opens between them."""

MIN_WIDTH: Final = 0.1
"""Least width of the ribbon, relative to the median one; it ends where the line is narrower."""


@dataclass(frozen=True)
class ContourMesh:
    """Line as a mesh.

    mesh : FIGURE; colors : (V, 3) uint8 sRGB
    culled : whether it is an inverted hull, of which clients must draw the front sides only
    """

    mesh: Mesh
    colors: NDArray[np.uint8]
    culled: bool


def ribbon(rim: Rim, width: Floats, color: Floats) -> ContourMesh | None:
    """Ribbon inside a rim; None where no line is drawn.

    width : (N,) at the rim's points, FIGURE units; color : (N, 3) sRGB 0-255
    """
    if not (width > 0).any():
        return None
    drawn = width > MIN_WIDTH * np.median(width[width > 0])
    segments = rim.segments[drawn[rim.segments].any(axis=1)].astype(np.int64)
    used, local = np.unique(segments, return_inverse=True)
    local = local.reshape(-1, 2)
    outer = rim.points[used]
    inner = outer.copy()
    inner[:, :2] -= (1 + OVERLAP) * np.maximum(width[used], 0.0)[:, None] * rim.outwards[used]
    first, second = local.T
    below = len(used)
    # Where the line ends it is a triangle.
    ends = width[used] <= 0
    front = np.concatenate(
        [
            np.stack([first, second, second + below], axis=1)[~ends[second]],
            np.stack([first, second + below, first + below], axis=1)[~ends[first]],
        ]
    )
    faces = np.concatenate([front, front[:, ::-1]])
    mesh = Mesh(np.concatenate([outer, inner]).astype(np.float32), faces.astype(np.int32))
    return ContourMesh(mesh, np.tile(_bytes(color[used]), (2, 1)), culled=False)


def front_of(ribbon: Mesh) -> Mesh:
    """The side of a ribbon that faces the viewer: the first half of its faces."""
    return Mesh(ribbon.vertices, ribbon.faces[: len(ribbon.faces) // 2])


def hull(mesh: Mesh, color: Floats) -> ContourMesh:
    """Inverted hull; mesh : the surface before it was inset; color : (V, 3) sRGB 0-255."""
    return ContourMesh(Mesh(mesh.vertices, np.ascontiguousarray(mesh.faces[:, ::-1])), _bytes(color), culled=True)


def _bytes(color: Floats) -> NDArray[np.uint8]:
    return np.asarray(np.clip(np.round(color), 0, 255), np.uint8)
