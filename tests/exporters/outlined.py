"""Figures with drawn contours, made from any solid: hulls and ribbons whose every property is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exporters.asset import OutlineMesh, TexturedMesh
from exporters.solid import WeldedMesh, solid_of

PENS = np.array([[30, 20, 10], [200, 16, 0]], np.uint8)


def hulled(mesh: TexturedMesh, width_m: float = 0.005, pens: int = 1) -> TexturedMesh:
    """The mesh inset by a width, inside a hull: its own surface turned inside out; pens : one, or another below."""
    solid = solid_of(mesh)
    surface = mesh.vertices[solid.first]
    outline = OutlineMesh(surface, solid.faces[:, ::-1], _colors(surface, pens), True, surface, width_m)
    return _inset(mesh, solid, outline)


def ribboned(mesh: TexturedMesh, width_m: float = 0.005, pens: int = 1, drawn: bool = False) -> TexturedMesh:
    """The mesh inset by a width, with a ribbon round the silhouette seen from the front (+z), both sides of it.

    drawn : whether it shows the texture of the mesh, which identifies its places
    """
    solid = solid_of(mesh)
    surface = mesh.vertices[solid.first]
    inner = surface - width_m * mesh.shading_normals[solid.first]
    one, two = silhouette(surface, solid.faces)
    places = np.concatenate([surface[one], surface[two], inner[two], inner[one]])
    a, b, c, d = np.arange(len(places)).reshape(4, -1)
    front = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    faces = np.concatenate([front, front[:, ::-1]])
    uv = np.stack([0.5 + places[:, 0], 1 - places[:, 1] / places[:, 1].max()], axis=1) if drawn else None
    return _inset(mesh, solid, OutlineMesh(places, faces, _colors(places, pens), False, surface, width_m, uv))


def silhouette(surface: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the edges between triangles that face the reader and ones that do not."""
    corners = surface[faces].astype(np.float64)
    front = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0
    start, end = faces.reshape(-1).astype(np.int64), np.roll(faces, -1, axis=1).reshape(-1).astype(np.int64)
    facing = np.repeat(front, 3)
    seen = {(s, e) for s, e in zip(start[facing].tolist(), end[facing].tolist(), strict=True)}
    hidden = zip(start[~facing].tolist(), end[~facing].tolist(), strict=True)
    edges = np.array([(e, s) for s, e in hidden if (e, s) in seen])
    return edges[:, 0], edges[:, 1]


def _inset(mesh: TexturedMesh, solid: WeldedMesh, outline: OutlineMesh) -> TexturedMesh:
    normals = mesh.shading_normals[solid.first][solid.vertex]
    return replace(
        mesh,
        vertices=mesh.vertices - np.float32(outline.width_m) * normals,
        solid_index=solid.vertex,
        outline=outline,
    )


def _colors(places: np.ndarray, pens: int) -> np.ndarray:
    return PENS[(places[:, 1] < places[:, 1].mean()).astype(int) * (pens - 1)]
