"""Rims, insets, ribbons and hulls of balls and boxes, whose shape is known."""

from __future__ import annotations

import numpy as np
import pytest

from exporters.solid import measure_topology
from fig2mesh.contour.contour import on_the_ground
from fig2mesh.contour.contour_mesh import front_of, hull, ribbon
from fig2mesh.contour.inset import continued_over, inset, steady
from fig2mesh.contour.rim import Rim, rim_of
from fig2mesh.field.analytic import capsule, sample, sphere
from fig2mesh.field.body import Body
from fig2mesh.mesh.isosurface import isosurface
from fig2mesh.mesh.normals import vertex_normals
from fig2mesh.mesh.simplify import simplify
from fig2mesh.mesh.topology import face_vectors, half_edges
from fig2mesh.records import FloatArray, Mesh

RADIUS, WIDTH = 0.5, 0.02
Ball = tuple[Mesh, FloatArray, Rim]


@pytest.fixture(scope="module")
def ball() -> Ball:
    body = Body((sample(sphere((0.1, 0.2, -0.3), RADIUS), 1, (0.1, 0.2, -0.3), 1.2, 64),))
    mesh = isosurface(body, spacing=0.03)
    normals = vertex_normals(mesh, body)
    return mesh, normals, rim_of(mesh, normals)


def test_rim_of_a_ball_is_its_equator(ball: Ball) -> None:
    _, _, rim = ball
    offset = rim.points - (0.1, 0.2, -0.3)
    assert np.abs(offset[:, 2]).max() < 0.01
    assert np.linalg.norm(offset[:, :2], axis=1) == pytest.approx(RADIUS, abs=0.005)
    assert np.einsum("nd,nd->n", offset[:, :2], rim.outwards) == pytest.approx(RADIUS, abs=0.01)


def test_rim_is_closed(ball: Ball) -> None:
    _, _, rim = ball
    assert len(rim.segments) == len(rim.points)
    assert (np.bincount(rim.segments.ravel(), minlength=len(rim.points)) == 2).all()


def test_rim_is_none_of_a_mesh_that_faces_the_viewer() -> None:
    mesh = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))
    assert len(rim_of(mesh, np.tile(np.float32([0, 0, 1]), (3, 1))).points) == 0


def test_values_at_the_rim_are_interpolated(ball: Ball) -> None:
    mesh, _, rim = ball
    assert rim.at(mesh.vertices) == pytest.approx(rim.points)


def test_inset_of_a_ball_is_a_smaller_ball(ball: Ball) -> None:
    mesh, _, _ = ball
    # Slivers of the isosurface would be turned over.
    mesh = simplify(mesh, 3000)
    moved = inset(mesh, vertex_normals(mesh), np.full(len(mesh.vertices), WIDTH))
    reach = np.linalg.norm(moved - (0.1, 0.2, -0.3), axis=1)
    assert np.quantile(np.abs(reach - (RADIUS - WIDTH)), 0.95) < 0.004
    assert reach.min() > RADIUS - WIDTH - 0.004
    assert reach.max() < RADIUS + 0.002


@pytest.mark.parametrize("width", [0.02, 0.2, 5.0])
def test_inset_turns_no_triangle_over_and_stays_inside_of_thin_things(width: float) -> None:
    body = Body((sample(capsule((0, -0.4, 0), (0, 0.4, 0), 0.05), 1, (0, 0, 0), 1.2, 96),))
    mesh = isosurface(body, spacing=0.02)
    moved = inset(mesh, vertex_normals(mesh, body), np.full(len(mesh.vertices), width))
    before, after = face_vectors(mesh), face_vectors(Mesh(moved, mesh.faces))
    assert (np.einsum("fd,fd->f", before, after) > 0).all()
    assert body.distance(moved).max() <= 1e-4
    if width > 0.1:
        # 0.35 of a thickness of 0.1, from both sides.
        assert body.distance(moved).min() > -0.04


def test_soles_stay_on_the_ground(ball: Ball) -> None:
    mesh, normals, _ = ball
    moved = inset(mesh, normals, np.full(len(mesh.vertices), WIDTH))
    stood = on_the_ground(mesh, moved, WIDTH)
    assert stood[:, 1].min() == mesh.vertices[:, 1].min() < moved[:, 1].min()
    high = mesh.vertices[:, 1] > mesh.vertices[:, 1].min() + WIDTH
    assert (stood[high] == moved[high]).all()
    assert (stood[:, [0, 2]] == moved[:, [0, 2]]).all()


def test_equal_readings_are_continued_over_the_whole_surface(ball: Ball) -> None:
    mesh, _, rim = ball
    readings = np.full((len(rim.points), 2), [0.01, 7.0])
    readings[::3] = np.nan
    assert continued_over(mesh, rim, readings) == pytest.approx(np.tile([0.01, 7.0], (len(mesh.vertices), 1)), rel=1e-3)


def test_values_stay_within_the_readings(ball: Ball) -> None:
    mesh, _, rim = ball
    readings = np.where(rim.points[:, :1] > 0.1, 1.0, 0.0)
    values = continued_over(mesh, rim, readings)
    assert values.min() >= -1e-6
    assert values.max() <= 1 + 1e-6
    assert continued_over(mesh, rim, np.full((len(rim.points), 1), np.nan)).max() == 0


def test_single_readings_give_way_to_those_around(ball: Ball) -> None:
    _, _, rim = ball
    drawn = np.full(len(rim.points), WIDTH)
    drawn[5], drawn[20], drawn[30] = 0.0, 4 * WIDTH, np.nan
    assert steady(rim, drawn) == pytest.approx(WIDTH)
    assert np.isnan(steady(rim, np.full(len(rim.points), np.nan))).all()


def test_ribbon_is_closed_and_lies_in_the_drawn_line(ball: Ball) -> None:
    _, _, rim = ball
    made = ribbon(rim, np.full(len(rim.points), WIDTH), np.full((len(rim.points), 3), 40.0))
    assert made is not None
    assert not made.culled
    edges = half_edges(made.mesh.faces)
    _, index, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    direction = np.bincount(index, np.where(edges[:, 0] < edges[:, 1], 1.0, -1.0))
    assert (count % 2 == 0).all()
    assert (direction == 0).all()
    reach = np.linalg.norm(made.mesh.vertices[:, :2] - (0.1, 0.2), axis=1)
    assert reach.max() <= RADIUS + 0.005
    assert reach.min() >= RADIUS - 1.15 * WIDTH - 0.005
    assert (face_vectors(front_of(made.mesh))[:, 2] >= -1e-9).all()


def test_ribbon_ends_where_nothing_is_drawn(ball: Ball) -> None:
    _, _, rim = ball
    width = np.where(rim.points[:, 0] > 0.1, WIDTH, 0.0)
    made = ribbon(rim, width, np.zeros((len(rim.points), 3)))
    assert made is not None
    assert made.mesh.vertices[:, 0].min() > 0.0
    assert ribbon(rim, np.zeros(len(rim.points)), np.zeros((len(rim.points), 3))) is None


def test_hull_is_the_surface_inside_out(ball: Ball) -> None:
    mesh, _, _ = ball
    made = hull(mesh, np.zeros((len(mesh.vertices), 3)))
    assert made.culled
    assert measure_topology(made.mesh.vertices, made.mesh.faces).closed
    assert face_vectors(made.mesh) == pytest.approx(-face_vectors(mesh))
