"""First hits on a mesh and its outline, against an exhaustive search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from exporters.asset import OutlineMesh, TexturedMesh
from fig2mesh.mesh.raycast import MeshCaster
from tests.fig2mesh.mesh.outlined import PEN

TORSO = 1


def tetrahedra(count: int, size: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and outward faces of random tetrahedra in a box of edge 2."""
    random = np.random.default_rng(seed)
    corners = random.uniform(-1, 1, (count, 1, 3)) + size * random.normal(size=(count, 4, 3))
    inward = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    corners[inward] = corners[inward][:, [0, 2, 1, 3]]
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    return corners.reshape(-1, 3).astype(np.float32), (faces + 4 * np.arange(count)[:, None, None]).reshape(-1, 3)


def both(culled: bool) -> TexturedMesh:
    vertices, faces = tetrahedra(6, 0.3, 0)
    solid = np.arange(len(vertices))
    white = np.full((len(vertices), 3), 255, np.uint8)
    mesh = TexturedMesh(vertices, faces, None, solid, colors=white, parts=np.full(len(vertices), TORSO))
    places, hull = tetrahedra(12, 0.4, 1)
    ink = np.broadcast_to(np.uint8(PEN), (len(places), 3))
    return replace(mesh, outline=OutlineMesh(places, hull[:, ::-1], ink, culled, vertices, 0.01))


def exhaustive(vertices: np.ndarray, faces: np.ndarray, start: np.ndarray, way: np.ndarray, front: bool) -> np.ndarray:
    """(N,) distance along rays by the intersection of every ray with every triangle."""
    corners = vertices.astype(np.float64)[faces]
    a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    sides = np.stack(np.broadcast_arrays(u, v, -way[:, None]), axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y, t = np.moveaxis(np.linalg.solve(sides, (start[:, None] - a)[..., None])[..., 0], -1, 0)
    hit = (x > 0) & (y > 0) & (x + y < 1) & (t > 0)
    if front:
        hit &= np.einsum("fd,nd->nf", np.cross(u, v), way) < 0
    return np.where(hit, t, np.inf).min(axis=1)


@pytest.mark.parametrize("culled", [True, False])
def test_first_hits_agree_with_an_exhaustive_search(culled: bool) -> None:
    mesh = both(culled)
    assert mesh.outline is not None
    caster, random = MeshCaster(mesh), np.random.default_rng(2)
    start = random.uniform(-1, 1, (1500, 3)) + [0, 0, 6]
    way = random.normal(size=start.shape) * 0.1 - [0, 0, 1]
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    hits = caster.cast((start - caster.centre) / caster.unit, way)
    own = exhaustive(mesh.vertices, mesh.faces, start, way, False)
    ink = exhaustive(mesh.outline.vertices, mesh.outline.faces, start, way, culled)
    # A ray within rounding of an edge may hit either side of it.
    clear = np.isclose(np.minimum(own, ink), hits.depth * caster.unit, atol=1e-4)
    clear |= np.isinf(np.minimum(own, ink)) & ~hits.hit
    assert clear.mean() > 0.999
    inked = (ink < own)[hits.hit]
    assert 0.2 < inked.mean() < 0.9
    assert ((np.abs(caster.colours(hits) - PEN).max(axis=1) < 0.5) == inked).mean() > 0.998
    assert ((caster.labels(hits) == 0) == inked).mean() > 0.998
    at = (start[hits.hit] + hits.depth[hits.hit, None] * caster.unit * way[hits.hit])[inked]
    assert np.linalg.norm(caster.normals(hits), axis=1) == pytest.approx(1.0)
    assert (at >= caster.box[0] - 1e-5).all()
    assert (at <= caster.box[1] + 1e-5).all()


def test_secondary_rays_pass_through_the_outline() -> None:
    mesh = both(False)
    caster, bare = MeshCaster(mesh), MeshCaster(replace(mesh, outline=None))
    start = np.random.default_rng(3).uniform(-1, 1, (500, 3))
    way = np.broadcast_to([0.0, 0.0, 1.0], start.shape)
    blocked = [one.blocked((start - one.centre) / one.unit, way) for one in (caster, bare)]
    np.testing.assert_array_equal(*blocked)
