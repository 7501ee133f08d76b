"""Topology laws on bodies whose genus and volume are known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from exporters.solid import measure_topology, merged_by_position, solid_of, unit_normals
from tests.exporters.analytic import EXACT_VOLUME, capsule


def test_capsule_is_a_solid_of_the_right_volume() -> None:
    mesh = capsule(128, 32)
    solid = solid_of(mesh)
    found = measure_topology(mesh.vertices[solid.first], solid.faces)
    assert found.solid
    assert (found.components, found.genus) == (1, 0)
    # Inscribed 128-gons are smaller than circles by (2 pi / n)^2 / 6 = 0.04 %; rings along the half spheres add a bit.
    assert found.volume == pytest.approx(EXACT_VOLUME, rel=1e-3)


def test_the_split_mesh_is_open_and_positions_close_it() -> None:
    mesh = capsule()
    assert measure_topology(mesh.vertices, mesh.faces).boundary_edges > 0
    assert measure_topology(*merged_by_position(mesh.vertices, mesh.faces)).solid


def test_genus_and_components_of_torus_and_two_spheres() -> None:
    torus = trimesh.creation.torus(1.0, 0.3, 12, 10)
    found = measure_topology(torus.vertices, torus.faces)
    assert (found.solid, found.components, found.genus) == (True, 1, 1)
    ball = trimesh.creation.icosphere(1)
    pair = trimesh.util.concatenate([ball, ball.copy().apply_translation([5, 0, 0])])
    found = measure_topology(pair.vertices, pair.faces)
    assert (found.solid, found.components, found.genus) == (True, 2, 0)
    assert found.volume == pytest.approx(2 * ball.volume)


@pytest.mark.parametrize("seed", range(5))
def test_agrees_with_trimesh_after_random_damage(seed: int) -> None:
    random = np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(2)
    faces = ball.faces[random.random(len(ball.faces)) > 0.02]
    flip = random.random(len(faces)) < 0.02
    faces[flip] = faces[flip][:, ::-1]
    other = trimesh.Trimesh(ball.vertices, faces, process=False)
    found = measure_topology(ball.vertices, faces)
    assert found.closed == other.is_watertight
    assert (found.misoriented_edges == 0) == other.is_winding_consistent
    assert found.boundary_edges == len(trimesh.grouping.group_rows(other.edges_sorted, require_count=1))


def test_surfaces_that_touch_in_a_vertex_or_an_edge_are_not_manifold() -> None:
    tetra = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]], float)
    at_vertex = np.concatenate([tetra, np.array([0, 4, 5, 6])[tetra]])
    found = measure_topology(corners, at_vertex)
    assert (found.closed, found.solid, found.nonmanifold_vertices, found.genus) == (True, False, 1, None)
    at_edge = np.concatenate([tetra, np.array([0, 1, 5, 6])[tetra]])
    assert measure_topology(corners, at_edge).nonmanifold_edges == 1


def test_unit_normals_are_exact_and_never_nan() -> None:
    normals = unit_normals(np.array([[0, 0, 0], [3, 4, 0], [1e-20, 0, 0]], np.float32))
    assert np.linalg.norm(normals.astype(float), axis=1) == pytest.approx(1, abs=1e-7)
