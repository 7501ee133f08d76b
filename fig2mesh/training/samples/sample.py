"""Ground truth of one subject from four sides: part solids, signed distances, masks, joints and pictures."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import BODY_PARTS, part_centre
from fig2mesh.training.bodies.partition import PartTopology
from fig2mesh.training.bodies.subject import Subject
from fig2mesh.training.drawing.raster import coverage
from fig2mesh.training.drawing.scene import SCENE, VIEWS, scene
from fig2mesh.training.samples.sdf import signed_distance

POINTS = 2000
"""Number of inside points, and of outside points, per part (paper §4.2)."""

MASK = 64
GRID = 64

MARGIN = 1.1
"""Edge of a part's cube relative to the smallest that holds it."""

NEAR = (0.02, 0.06)
"""Standard deviations of points sampled around the surface, PART units: of one half and of the other."""


def geometry(subject: Subject, rng: np.random.Generator, *, grids: bool = False) -> dict[str, NDArray[Any]]:
    """Return the arrays of a shard (docs/training.md) for one subject, without the pictures."""
    centre, edge, size = np.zeros((14, 3)), np.ones(14), np.zeros((14, 3))
    points, distance = np.zeros((14, 2 * POINTS, 3), np.float16), np.zeros((14, 2 * POINTS), np.float16)
    amodal = np.zeros((4, 14, MASK, MASK), bool)
    grid = np.zeros((14, GRID, GRID, GRID), np.float16) if grids else None
    for part in subject.parts:
        row = part.part - 1
        vertices, faces = part.solid(subject.vertices)
        centre[row] = part_centre(part.part, subject.joints)
        edge[row] = 2.0 * MARGIN * np.abs(vertices - centre[row]).max()
        size[row] = np.ptp(vertices, axis=0)
        local = 2.0 * (vertices - centre[row]) / edge[row]
        points[row], distance[row] = _sample(local, faces, rng)
        if grid is not None:
            grid[row] = _dense(local, faces)
        amodal[:, row] = _amodal(local, subject.rig.faces[subject.rig.face_part == part.part], part, faces)
    visible = _visible(subject, centre, edge)
    arrays: dict[str, NDArray[Any]] = {
        "joints": subject.joints.astype(np.float32),
        "centre": centre.astype(np.float32),
        "edge": edge.astype(np.float32),
        "size": size.astype(np.float32),
        "points": points,
        "distance": distance,
        "mask_amodal": np.packbits(amodal, axis=-1),
        "mask_visible": np.packbits(visible & amodal, axis=-1),
    }
    return arrays if grid is None else {**arrays, "grid": grid}


def _sample(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], rng: np.random.Generator
) -> tuple[NDArray[np.float16], NDArray[np.float16]]:
    """Sample as many points inside as outside: over the cube, over the part's box, and near the surface."""
    corner = vertices[faces]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    chosen = corner[rng.choice(len(faces), 4000, p=area / area.sum())]
    weight = rng.dirichlet((1.0, 1.0, 1.0), len(chosen))
    near = np.einsum("nk,nkc->nc", weight, chosen)
    near += rng.normal(size=near.shape) * np.repeat(NEAR, len(near) // 2)[:, None]
    box = rng.uniform(vertices.min(axis=0), vertices.max(axis=0), (3000, 3))
    everywhere = rng.uniform(-1.0, 1.0, (1500, 3))
    # Distances are measured at the points as they are stored, in half precision.
    query = np.clip(np.concatenate([near, box, everywhere]), -1.0, 1.0).astype(np.float16)
    found = signed_distance(vertices, faces, query.astype(np.float32))
    inside, outside = np.flatnonzero(found < 0), np.flatnonzero(found >= 0)
    rows = np.concatenate([_choose(inside, rng), _choose(outside, rng)])
    return query[rows], found[rows].astype(np.float16)


def _choose(rows: NDArray[np.integer], rng: np.random.Generator) -> NDArray[np.integer]:
    if not len(rows):
        raise ValueError("a part without inside or outside: its mesh is not closed")
    return rng.choice(rows, POINTS, replace=len(rows) < POINTS)


def _dense(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.float16]:
    axis = np.linspace(-1.0, 1.0, GRID)
    nodes = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    return signed_distance(vertices, faces, nodes).reshape(GRID, GRID, GRID).astype(np.float16)


def _amodal(
    vertices: NDArray[np.float64], own: NDArray[np.int32], part: PartTopology, faces: NDArray[np.int32]
) -> NDArray[np.bool_]:
    """(4, 64, 64) masks of the whole part from the four sides; front and back, left and right are mirror images.

    Only the part's own faces count, not the rings that overlap its neighbours: a drawing's regions meet.
    """
    _, inverse = np.unique(part.faces, return_inverse=True)
    lookup = np.full(int(part.faces.max()) + 1, -1)
    lookup[part.faces.ravel()] = inverse.ravel()
    seen = [coverage(vertices @ VIEWS[k].T, lookup[own], size=MASK, low=(-1.0, -1.0), pitch=2.0 / MASK) for k in (0, 1)]
    # The faces are an open tube with a hole along its axis; drawn regions have no such holes.
    seen = [filled(mask) for mask in seen]
    return np.stack([seen[0], seen[1], seen[0][:, ::-1], seen[1][:, ::-1]])


def filled(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) bool: a mask with its holes filled; the background is connected by sides of pixels."""
    outside = np.zeros(tuple(length + 2 for length in mask.shape), bool)
    outside[0] = outside[-1] = outside[:, 0] = outside[:, -1] = True
    free = np.pad(~mask, 1, constant_values=True)
    while True:
        grown = outside.copy()
        grown[1:] |= outside[:-1]
        grown[:-1] |= outside[1:]
        grown[:, 1:] |= outside[:, :-1]
        grown[:, :-1] |= outside[:, 1:]
        grown &= free
        if (grown == outside).all():
            return ~outside[1:-1, 1:-1]
        outside = grown


def _visible(subject: Subject, centre: NDArray[np.float64], edge: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(4, 14, 64, 64) bool: visible region of each part, in the part's own square."""
    step = (np.arange(MASK) + 0.5) / MASK * 2.0 - 1.0
    result = np.zeros((4, 14, MASK, MASK), bool)
    for view, turn in enumerate(VIEWS):
        _, labels, corner, pitch = scene(subject, view)
        middle = centre @ turn.T
        for part in BODY_PARTS:
            half = edge[part - 1] / 2
            column = (middle[part - 1, 0] + half * step - corner[0]) / pitch
            row = SCENE - (middle[part - 1, 1] - half * step - corner[1]) / pitch
            inside = ((row >= 0) & (row < SCENE))[:, None] & ((column >= 0) & (column < SCENE))[None]
            rows, columns = (np.clip(v.astype(int), 0, SCENE - 1) for v in (row, column))
            result[view, part - 1] = (labels[np.ix_(rows, columns)] == part) & inside
    return result
