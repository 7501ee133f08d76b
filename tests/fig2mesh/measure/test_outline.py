"""Laws of outlines, kept and broken one at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from exporters.asset import OutlineMesh, TexturedMesh
from fig2mesh.measure.outline import OutlineLaws, outline_laws, turned_triangles
from tests.fig2mesh.measure.test_model import sphere
from tests.fig2mesh.mesh.outlined import hulled

SOUND = OutlineLaws(True, True, 0.0, 0)


@pytest.fixture(scope="module")
def ball() -> TexturedMesh:
    return hulled(sphere(24, 32), 0.02)


def changed(mesh: TexturedMesh, **fields: object) -> TexturedMesh:
    assert mesh.outline is not None
    return replace(mesh, outline=replace(mesh.outline, **fields))  # type: ignore[arg-type]


def outline_of(mesh: TexturedMesh) -> OutlineMesh:
    assert mesh.outline is not None
    return mesh.outline


def test_hull_and_its_absence_break_no_law(ball: TexturedMesh) -> None:
    assert outline_laws(ball) == SOUND
    assert outline_laws(replace(ball, outline=None)) == SOUND


def test_hole_is_found(ball: TexturedMesh) -> None:
    assert not outline_laws(changed(ball, faces=outline_of(ball).faces[1:])).closed


def test_hull_turned_outwards_is_found(ball: TexturedMesh) -> None:
    assert not outline_laws(changed(ball, faces=outline_of(ball).faces[:, ::-1])).inverted


def test_single_face_turned_outwards_is_found(ball: TexturedMesh) -> None:
    faces = outline_of(ball).faces.copy()
    faces[7] = faces[7, ::-1]
    found = outline_laws(changed(ball, faces=faces))
    assert (found.closed, found.inverted) == (False, False)


def test_one_piece_of_two_turned_outwards_is_found(ball: TexturedMesh) -> None:
    own = outline_of(ball)
    small = 0.5 * own.vertices.astype(np.float32)
    faces = np.concatenate([own.faces, own.faces[:, ::-1] + len(own.vertices)])
    both = changed(
        ball, vertices=np.concatenate([own.vertices, small]), faces=faces, colors=np.tile(own.colors, (2, 1))
    )
    found = outline_laws(both)
    assert found.closed
    assert not found.inverted


def test_distance_beyond_the_surface_is_measured(ball: TexturedMesh) -> None:
    moved = outline_of(ball).vertices + np.float32([0, 0, 0.03])
    assert outline_laws(changed(ball, vertices=moved)).outside_m == pytest.approx(0.03, abs=1e-6)


def test_ribbon_of_two_sides_is_sound_and_one_of_one_side_is_not(ball: TexturedMesh) -> None:
    ring = outline_of(ball).faces[100:140]
    ribbon = changed(ball, faces=np.concatenate([ring, ring[:, ::-1]]), culled=False)
    assert outline_laws(ribbon) == SOUND
    assert not outline_laws(changed(ribbon, faces=ring)).closed


def test_triangles_turned_by_the_inset_are_counted(ball: TexturedMesh) -> None:
    assert turned_triangles(ball) == 0
    vertices = ball.vertices.copy()
    top = int(vertices[:, 1].argmax())
    # The pole is pulled through the sphere's opposite side: all triangles around it face the other way.
    vertices[top, 1] = -1.0
    fan = int((ball.faces == top).any(axis=1).sum())
    assert turned_triangles(replace(ball, vertices=vertices)) == fan


def test_triangles_without_area_count_as_turned(ball: TexturedMesh) -> None:
    vertices = ball.vertices.copy()
    first, second = ball.faces[200][:2]
    vertices[first] = vertices[second]
    assert turned_triangles(replace(ball, vertices=vertices)) >= 2
