"""Slivers put into good meshes go away again, and the solid stays what it is."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from fig2mesh.mesh.simplify import deviation, simplify
from fig2mesh.mesh.slivers import MIN_QUALITY, REACHES, triangle_quality, without_slivers
from fig2mesh.mesh.topology import as_mesh, check_solid, face_vectors
from fig2mesh.records import Mesh

from .solids import SOLIDS, assert_solid, closed

CAP, NEEDLE, POINT = (0.495, 0.495, 0.01), (0.985, 0.0075, 0.0075), (0.9, 0.095, 0.005)


def body(name: str) -> Mesh:
    made = {
        "sphere": lambda: trimesh.creation.icosphere(3, 0.4),
        "torus": lambda: trimesh.creation.torus(0.4, 0.12, 48, 24),
        "box": lambda: trimesh.creation.box((0.5, 0.6, 0.7)).subdivide().subdivide().subdivide(),
    }[name]()
    return as_mesh(np.asarray(made.vertices), np.asarray(made.faces))


def spoiled(mesh: Mesh, faces: np.ndarray, weights: np.ndarray) -> Mesh:
    """The same surface, each of `faces` (N,) made three by a vertex at barycentric `weights` (N, 3)."""
    corners = mesh.faces[faces]
    points = np.einsum("nk,nkd->nd", weights, mesh.vertices[corners].astype(np.float64))
    new = len(mesh.vertices) + np.arange(len(faces))
    fans = [np.stack([corners[:, k], corners[:, (k + 1) % 3], new], axis=1) for k in range(3)]
    return as_mesh(
        np.concatenate([mesh.vertices, points]), np.concatenate([np.delete(mesh.faces, faces, axis=0), *fans])
    )


def least(mesh: Mesh) -> float:
    return float(triangle_quality(mesh.vertices, mesh.faces).min())


def edge(mesh: Mesh) -> float:
    return float(np.linalg.norm(mesh.vertices[mesh.faces[:, 0]] - mesh.vertices[mesh.faces[:, 1]], axis=1).mean())


@given(
    name=st.sampled_from(["sphere", "torus", "box"]),
    kinds=st.lists(st.sampled_from([CAP, NEEDLE, POINT]), min_size=1, max_size=12),
    seed=st.integers(0, 2**31),
)
@settings(max_examples=40, deadline=None)
def test_slivers_go_and_the_solid_stays(name: str, kinds: list[tuple[float, ...]], seed: int) -> None:
    rng = np.random.default_rng(seed)
    sound = body(name)
    faces = rng.choice(len(sound.faces), len(kinds), replace=False)
    bad = spoiled(sound, faces, np.array([rng.permutation(kind) for kind in kinds]))
    assert least(bad) < 0.05
    before = bad.faces.tobytes()
    good = without_slivers(bad)
    assert bad.faces.tobytes() == before
    assert least(good) >= MIN_QUALITY
    assert_solid(good, 1, check_solid(sound).genus)
    assert deviation(good, bad)[1] <= REACHES[-1] * edge(bad) * 1.2  # it is judged at the corners and middles
    assert check_solid(good).volume == pytest.approx(check_solid(bad).volume, rel=1e-3)
    # No vertex was moved.
    assert {tuple(p) for p in good.vertices.tolist()} <= {tuple(p) for p in bad.vertices.tolist()}


def test_no_normal_is_turned_over() -> None:
    sound = body("sphere")
    faces = np.arange(0, len(sound.faces), 40)
    good = without_slivers(spoiled(sound, faces, np.tile(CAP, (len(faces), 1))))
    outward = good.vertices[good.faces].mean(axis=1)
    assert (np.einsum("fd,fd->f", face_vectors(good), outward) > 0).all()


@pytest.mark.parametrize("sides", [3, 4])
def test_a_thin_neck_is_not_pinched_whatever_the_reach(sides: int) -> None:
    # Rings of a few vertices far apart: all triangles are needles, and their short edges go round the neck.
    turn = 2 * np.pi * np.arange(sides) / sides
    rings = np.stack([[np.cos(a) * 0.01, np.sin(a) * 0.01, z] for z in range(4) for a in turn])
    faces = [[0, k + 1, k] for k in range(1, sides - 1)]
    faces += [[3 * sides, 3 * sides + k, 3 * sides + k + 1] for k in range(1, sides - 1)]
    for ring in range(3):
        for k in range(sides):
            a, b = ring * sides + k, ring * sides + (k + 1) % sides
            faces += [[a, b, a + sides], [b, b + sides, a + sides]]
    neck = as_mesh(rings, np.array(faces))
    assert_solid(neck)
    assert least(neck) < 0.05
    assert_solid(without_slivers(neck, reaches=(0.1, 10.0)))


def test_a_good_mesh_is_returned_as_it_is() -> None:
    sound = body("torus")
    assert without_slivers(sound) is sound


@pytest.mark.parametrize("share", [1.0, 0.5, 0.1])
@pytest.mark.parametrize("name", SOLIDS)
def test_simplified_meshes_have_no_slivers(name: str, share: float) -> None:
    mesh = closed(name)
    assert least(simplify(mesh, int(len(mesh.faces) * share))) >= 0.05
