"""Topology laws on bodies whose genus and volume are known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from manifold3d import Error, Manifold
from manifold3d import Mesh as ManifoldMesh

from exporters.solid import Topology, measure_topology, merged_by_position, solid_of, unit_normals
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


BODIES = {
    "box": trimesh.creation.box((1, 2, 3)),
    "ball": trimesh.creation.icosphere(2),
    "torus": trimesh.creation.torus(1.0, 0.3, 12, 10),
    "capsule": trimesh.creation.capsule(2.0, 0.5, count=[8, 8]),
}


def _two(one: trimesh.Trimesh, other: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.util.concatenate([one, other.copy().apply_translation([5, 0, 0])])


def _check_against_trimesh(vertices: np.ndarray, faces: np.ndarray) -> Topology:
    found = measure_topology(vertices, faces)
    judge = trimesh.Trimesh(vertices, faces, process=False)
    labels = trimesh.graph.connected_component_labels(judge.face_adjacency, node_count=len(faces))
    assert found.triangles == len(judge.faces)
    assert found.closed == judge.is_watertight
    assert found.oriented == judge.is_winding_consistent
    assert found.euler == judge.euler_number
    assert found.components == labels.max() + 1
    if found.closed and found.oriented:
        # An open surface encloses nothing: what is measured depends on the place that it is measured from.
        assert found.volume == pytest.approx(judge.volume, abs=1e-9)
    assert found.boundary_edges == len(trimesh.grouping.group_rows(judge.edges_sorted, require_count=1))
    return found


@given(
    st.sampled_from(sorted(BODIES)),
    st.sampled_from([None, *sorted(BODIES)]),
    st.sets(st.integers(0, 10_000), max_size=4),
    st.sets(st.integers(0, 10_000), max_size=4),
    st.sets(st.integers(0, 10_000), max_size=4),
    st.lists(st.tuples(*[st.integers(0, 10_000)] * 3), max_size=3),
)
def test_agrees_with_trimesh_on_holed_flipped_duplicated_and_non_manifold_meshes(
    name: str,
    beside: str | None,
    holes: set[int],
    flipped: set[int],
    repeated: set[int],
    added: list[tuple[int, int, int]],
) -> None:
    body = BODIES[name] if beside is None else _two(BODIES[name], BODIES[beside])
    count, size = len(body.faces), len(body.vertices)
    faces = body.faces.copy()
    turned = [each % count for each in flipped]
    faces[turned] = faces[turned][:, ::-1]
    extra = [[each % size for each in triangle] for triangle in added]
    extra = [triangle for triangle in extra if len(set(triangle)) == 3]
    again = faces[[each % count for each in repeated]]
    faces = np.delete(faces, [each % count for each in holes], axis=0)
    faces = np.concatenate([faces, again, np.array(extra, int).reshape(-1, 3)])
    found = _check_against_trimesh(body.vertices, faces)
    if not (holes or flipped or repeated or extra):
        handles = [name, beside].count("torus")
        assert (found.outward, found.components, found.genus) == (True, 1 + (beside is not None), handles)
    if holes and not (repeated or extra):
        assert not found.closed
    if found.solid:
        judge = Manifold(ManifoldMesh(body.vertices.astype(np.float32), faces.astype(np.uint32)))
        assert judge.status() == Error.NoError
        assert judge.genus() == found.genus - found.components + 1


@pytest.mark.parametrize("name", BODIES)
def test_a_body_turned_inside_out_or_hollow_does_not_face_outward(name: str) -> None:
    body = BODIES[name]
    inverted = _check_against_trimesh(body.vertices, body.faces[:, ::-1])
    assert (inverted.solid, inverted.outward, inverted.volume) == (True, False, pytest.approx(-body.volume))
    cavity = body.copy().apply_scale(0.5)
    cavity.invert()
    hollow = trimesh.util.concatenate([body, cavity])
    found = _check_against_trimesh(hollow.vertices, hollow.faces)
    assert (found.solid, found.outward, found.components) == (True, False, 2)
    assert found.min_volume == pytest.approx(-body.volume / 8)
    assert found.volume == pytest.approx(body.volume * 7 / 8)


def test_no_triangles_are_no_solid() -> None:
    found = measure_topology(np.zeros((0, 3)), np.zeros((0, 3), int))
    assert (found.closed, found.solid, found.outward, found.components, found.genus) == (False, False, False, 0, None)
