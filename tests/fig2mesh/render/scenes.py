"""Analytic bodies that the tests of pictures share."""

from __future__ import annotations

import numpy as np

from exporters.asset import TexturedMesh
from fig2mesh.field.analytic import Distance, mannequin, sample, sphere
from fig2mesh.field.body import Body
from fig2mesh.image_frame import ImageFrame
from fig2mesh.mesh.isosurface import isosurface
from fig2mesh.mesh.normals import vertex_normals
from fig2mesh.render.scene import FieldScene
from fig2mesh.skeleton import PART
from fig2mesh.texture.sources import Sources

TORSO, HEAD = PART["torso"], PART["head"]
DRAWN, PLAIN = (200.0, 40.0, 40.0), {TORSO: (40.0, 40.0, 200.0), HEAD: (40.0, 160.0, 60.0)}
"""sRGB of the drawing everywhere, and of each part where the drawing does not show it."""


def solid(function: Distance, edge: float, n: int = 96) -> FieldScene:
    """One part about the origin."""
    return FieldScene(Body((sample(function, TORSO, (0, 0, 0), edge, n),)))


def ball(radius: float = 0.5) -> FieldScene:
    return solid(sphere((0, 0, 0), radius), 2.4 * radius)


def balls() -> Body:
    """A torso below and a head above, which overlap."""
    return Body(
        (
            sample(sphere((0, 0, 0), 0.5), TORSO, (0, 0, 0), 1.2, 64),
            sample(sphere((0, 0.6, 0.1), 0.3), HEAD, (0, 0.6, 0.1), 0.72, 48),
        )
    )


def balls_scene() -> FieldScene:
    """The two balls, with colours."""
    picture = np.broadcast_to(np.float32(DRAWN), (200, 200, 3)).copy()
    plain = {part: np.broadcast_to(np.float32(colour), (200, 200, 3)).copy() for part, colour in PLAIN.items()}
    return FieldScene(balls(), Sources(picture, plain, 1.0), ImageFrame((100.0, 120.0), 0.01))


def balls_mesh(spacing: float = 0.03) -> TexturedMesh:
    """The isosurface of the two balls, with colours and labels at its vertices."""
    return mesh_of(balls(), spacing)


def mannequin_body() -> Body:
    return Body(mannequin(48))


def mesh_of(body: Body, spacing: float) -> TexturedMesh:
    mesh = isosurface(body, spacing=spacing)
    labels = body.labels[body.nearest_part(mesh.vertices)]
    return TexturedMesh(
        vertices=mesh.vertices,
        faces=mesh.faces,
        normals=vertex_normals(mesh, body),
        solid_index=np.arange(len(mesh.vertices), dtype=np.int32),
        colors=np.where((labels == HEAD)[:, None], np.uint8(PLAIN[HEAD]), np.uint8(DRAWN)),
        parts=labels,
    )
