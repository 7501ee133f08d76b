import numpy as np
import pytest

from fig2mesh.mesh.normals import vertex_normals
from fig2mesh.mesh.simplify import MIN_TRIANGLES, deviation, simplify
from fig2mesh.mesh.topology import check_solid, face_components, face_vectors
from fig2mesh.records import Mesh

from .solids import SOLIDS, assert_solid, closed


@pytest.mark.parametrize("share", [0.5, 0.1, 0.01])
@pytest.mark.parametrize("name", SOLIDS)
def test_fewer_triangles_same_solid(name: str, share: float) -> None:
    mesh, solid = closed(name), SOLIDS[name]
    target = int(len(mesh.faces) * share)
    result = simplify(mesh, target)
    assert_solid(result, solid.components, solid.genus)
    assert len(result.faces) <= max(target, MIN_TRIANGLES * solid.components) + 2
    if share == 0.5:
        assert check_solid(result).volume == pytest.approx(check_solid(mesh).volume, rel=0.02)
        outwards = solid.field.gradient(result.vertices[result.faces].mean(axis=1))
        assert (np.einsum("fd,fd->f", face_vectors(result), outwards) > 0).mean() > 0.999


def test_a_small_piece_keeps_its_shape() -> None:
    mesh = simplify(closed("two spheres"), 400)
    sizes = np.bincount(face_components(mesh.faces))
    assert len(sizes) == 2
    assert sizes.min() >= MIN_TRIANGLES - 2
    assert sizes.sum() <= 402


def test_enough_is_left_alone() -> None:
    mesh = closed("torus")
    assert simplify(mesh, len(mesh.faces)) is mesh


def test_input_is_unchanged_and_the_result_repeats() -> None:
    mesh = closed("overlapping")
    before = mesh.vertices.tobytes(), mesh.faces.tobytes()
    first, second = simplify(mesh, 500), simplify(mesh, 500)
    assert (mesh.vertices.tobytes(), mesh.faces.tobytes()) == before
    assert first.vertices.tobytes() == second.vertices.tobytes()
    assert first.faces.tobytes() == second.faces.tobytes()


def test_deviation_of_a_grown_sphere_is_its_growth() -> None:
    mesh = closed("sphere")
    centre = np.array([0.1, 0.2, 0], np.float32)
    grown = Mesh((mesh.vertices - centre) * 1.1 + centre, mesh.faces)
    mean, worst = deviation(mesh, grown)
    assert mean == pytest.approx(0.04, rel=0.01)  # 10 % of the radius, less the sagitta of the triangles
    assert worst == pytest.approx(0.04, rel=0.02)
    assert deviation(mesh, mesh)[1] < 1e-6


@pytest.mark.parametrize("with_field", [False, True])
def test_normals_of_a_sphere_point_from_its_centre(with_field: bool) -> None:
    mesh, field = closed("sphere"), SOLIDS["sphere"].field
    normals = vertex_normals(mesh, field if with_field else None)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    away = mesh.vertices - np.array([0.1, 0.2, 0], np.float32)
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    assert np.einsum("vd,vd->v", normals, away).min() > (0.99999 if with_field else 0.995)


def test_a_vertex_without_area_has_a_normal() -> None:
    normals = vertex_normals(Mesh(np.zeros((4, 3)), np.array([[0, 1, 2]])))
    assert normals.tolist() == [[0, 0, 1]] * 4
