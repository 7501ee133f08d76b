import numpy as np
import pytest
import trimesh

from fig2mesh.mesh.topology import (
    boundary_edges,
    check_solid,
    compact,
    join,
    select_faces,
)
from fig2mesh.records import Mesh

CUBE = trimesh.creation.box((1, 2, 3))
BOX = Mesh(CUBE.vertices, CUBE.faces)


def moved(mesh: Mesh, offset: float) -> Mesh:
    return Mesh(mesh.vertices + offset, mesh.faces)


def test_a_box_is_a_solid_of_its_volume() -> None:
    report = check_solid(BOX)
    assert report.outward
    assert (report.vertices, report.triangles, report.euler, report.genus, report.components) == (8, 12, 2, 0, 1)
    assert report.volume == pytest.approx(6)


def test_volume_does_not_suffer_from_distance_to_the_origin() -> None:
    far = check_solid(moved(BOX, 1000.0))
    # float32 coordinates step by 6e-5 out there
    assert far.volume == pytest.approx(6, rel=1e-4)
    assert far.min_volume == pytest.approx(6, rel=1e-4)


def test_an_open_box() -> None:
    opened = Mesh(BOX.vertices, BOX.faces[1:])
    report = check_solid(opened)
    assert not report.closed
    assert report.oriented
    assert report.manifold
    assert len(boundary_edges(opened.faces)) == 3


def test_a_turned_face() -> None:
    faces = np.array(BOX.faces)
    faces[0] = faces[0, ::-1]
    turned = Mesh(BOX.vertices, faces)
    report = check_solid(turned)
    assert report.closed
    assert not report.oriented
    assert not report.solid


def test_an_inside_out_box_is_no_solid() -> None:
    report = check_solid(Mesh(BOX.vertices, BOX.faces[:, ::-1]))
    assert report.closed
    assert report.oriented
    assert report.volume == pytest.approx(-6)
    assert not report.outward


def test_two_boxes_that_share_a_vertex_are_not_manifold() -> None:
    both = join([BOX, moved(BOX, 5.0)])
    faces = np.array(both.faces)
    faces[faces == 8] = 0
    report = check_solid(compact(Mesh(both.vertices, faces)))
    assert report.closed
    assert report.nonmanifold_edges == 0
    assert report.nonmanifold_vertices == 1
    assert not report.manifold
    assert report.components == 2


def test_an_edge_with_a_third_face() -> None:
    vertices = np.concatenate([BOX.vertices, [[9, 9, 9]]])
    first, second = BOX.faces[0, :2]
    report = check_solid(Mesh(vertices, np.concatenate([BOX.faces, [[first, second, 8]]])))
    assert report.nonmanifold_edges == 1
    assert not report.manifold
    assert not report.closed


def test_a_torus_has_one_handle() -> None:
    ring = trimesh.creation.torus(1.0, 0.3)
    mesh = Mesh(ring.vertices, ring.faces)
    assert check_solid(mesh).genus == 1
    assert check_solid(join([mesh, moved(mesh, 4), BOX])).genus == 2


def test_components_come_apart_and_together() -> None:
    both = join([BOX, moved(BOX, 5.0)])
    assert check_solid(both).components == 2
    half = select_faces(both, np.arange(24) < 12)
    assert np.array_equal(half.vertices, BOX.vertices)
    assert np.array_equal(half.faces, BOX.faces)


def test_nothing_is_no_solid() -> None:
    report = check_solid(Mesh(np.zeros((0, 3)), np.zeros((0, 3))))
    assert not report.closed
    assert not report.outward
    assert report.components == 0
