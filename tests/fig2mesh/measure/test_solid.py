"""Measures of single bodies for which the answer is known by formula."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from exporters.asset import TexturedMesh
from fig2mesh.measure.front import flange_share, front_view, gap, thickness_at, wall_share
from fig2mesh.measure.solid import crossing_triangles, inner_shells, laws, quality, solid_mesh, thinnest_wall
from fig2mesh.records import Mesh


def model(*bodies: trimesh.Trimesh) -> TexturedMesh:
    body = trimesh.util.concatenate(list(bodies))
    return TexturedMesh(body.vertices, body.faces, body.vertex_normals, np.arange(len(body.vertices)))


def ball(radius: float, centre: tuple[float, float, float] = (0, 0, 0), halvings: int = 5) -> trimesh.Trimesh:
    """halvings : of an icosahedron's edges; 3 (1,280 triangles) for tests of topology, not of roundness"""
    body = trimesh.creation.icosphere(halvings, radius)
    body.apply_translation(centre)
    return body


def capsule(radius: float, length: float = 0.6) -> trimesh.Trimesh:
    """A standing capsule; the axis of trimesh's is z."""
    body = trimesh.creation.capsule(length, radius, count=[48, 64])
    body.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
    return body


def box(width: float, height: float, depth: float, at: tuple[float, float, float] = (0, 0, 0)) -> trimesh.Trimesh:
    body = trimesh.creation.box((width, height, depth))
    body.apply_translation(at)
    return body


def disc(radius_px: float, size: int = 200) -> np.ndarray:
    x, y = np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5)
    return np.hypot(x - size / 2, y - size / 2) <= radius_px


def test_thickness_of_a_sphere_is_its_chord() -> None:
    points = np.random.default_rng(0).uniform(-0.12, 0.12, (5000, 2))
    chord = 2 * np.sqrt(np.maximum(0.1**2 - (points**2).sum(axis=1), 0))
    found = thickness_at(model(ball(0.1)), points)
    clear = np.abs(np.hypot(*points.T) - 0.1) > 0.002
    np.testing.assert_allclose(found[clear], chord[clear], atol=0.001)


def test_thickness_through_edges_and_corners_is_whole() -> None:
    # The lines of sight run exactly through the diagonals of a box's faces, and through its middle.
    along = np.linspace(-0.09, 0.09, 37)
    found = thickness_at(model(box(0.2, 0.2, 0.05)), np.stack([along, along], axis=1))
    np.testing.assert_allclose(found, 0.05, atol=1e-6)


def test_thickness_counts_each_layer() -> None:
    layers = model(box(0.2, 0.2, 0.05), box(0.2, 0.2, 0.02, (0, 0, 0.3)))
    assert thickness_at(layers, np.array([[0.01, 0.03]]))[0] == pytest.approx(0.07, abs=1e-6)


def test_nothing_is_missing_behind_a_drawing_that_is_covered() -> None:
    found = gap(model(ball(0.1)), disc(79), metres_per_pixel=0.1 / 80, origin_px=(100, 100))
    assert (found.share, found.radius_mm) == (0.0, 0.0)


def test_a_crack_is_long_but_narrow() -> None:
    pixel = 0.001
    mask = np.ones((200, 300), np.bool_)
    halves = model(box(0.145, 0.2, 0.1, (-0.0775, 0, 0)), box(0.145, 0.2, 0.1, (0.0775, 0, 0)))
    found = gap(halves, mask, metres_per_pixel=pixel, origin_px=(150, 100))
    assert found.share == pytest.approx(10 / 300)
    assert found.radius_mm == pytest.approx(5, abs=0.6)


def test_a_missing_hand_holds_a_disc_of_its_size() -> None:
    mask = np.zeros((200, 400), np.bool_)
    mask[:, :200], mask[:, 200:] = disc(80), disc(40)
    spheres = model(ball(0.08))
    found = gap(spheres, mask, metres_per_pixel=0.001, origin_px=(100, 100))
    assert found.share == pytest.approx(40**2 / (80**2 + 40**2), abs=0.01)
    assert found.radius_mm == pytest.approx(40, abs=1.5)


def test_all_is_missing_where_the_model_stands_elsewhere() -> None:
    found = gap(model(ball(0.08, (5, 0, 0))), disc(80), metres_per_pixel=0.001, origin_px=(100, 100))
    assert found.share == 1.0
    assert found.radius_mm == pytest.approx(80, abs=1.5)
    assert gap(model(ball(0.1)), np.zeros((4, 4), np.bool_), metres_per_pixel=1, origin_px=(0, 0)).share == 0.0


@pytest.mark.parametrize("radius", [0.03, 0.08, 0.15])
def test_round_bodies_have_neither_flange_nor_wall(radius: float) -> None:
    for body in (ball(radius), capsule(radius)):
        front = front_view(model(body))
        assert flange_share(front) == 0.0
        assert wall_share(front) < 0.01


def test_a_cookie_cutter_is_wall_all_round() -> None:
    front = front_view(model(box(0.3, 0.5, 0.2)))
    assert wall_share(front) > 0.98
    assert flange_share(front) == 0.0


def test_a_half_round_body_has_half_a_wall() -> None:
    # A cylinder along y that ends in flat discs: in the front view its sides are round and its ends flat.
    body = trimesh.creation.cylinder(0.1, 0.4, sections=256)
    body.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    # Normals turn round the corners.
    assert wall_share(front_view(model(body))) == pytest.approx(0.2 / (0.2 + 0.4), abs=0.05)


def test_a_thin_plate_round_a_body_is_flange() -> None:
    width, height, margin = 0.4, 0.6, 0.1
    plate = model(box(width, height, 0.001), box(width - 2 * margin, height - 2 * margin, 0.2))
    # Flange where 1 mm < d/2 and d > 4 mm, and the thick middle is not in the way: from 4 to 100 mm inside.
    outer = (width - 0.008) * (height - 0.008)
    inner = (width - 2 * margin) * (height - 2 * margin)
    assert flange_share(front_view(plate)) == pytest.approx((outer - inner) / (width * height), abs=0.01)


@pytest.mark.parametrize(("depth", "flat"), [(0.2, True), (0.3, False)])
def test_what_is_flatter_than_a_quarter_of_round_is_flange(depth: float, flat: bool) -> None:
    body = ball(0.1)
    body.apply_scale((1, 1, depth))
    # At d from the rim the ellipsoid is depth * 2 sqrt(d (2r - d)) thick, which is less than d/2 only near the middle.
    d = 8 * depth**2 * 2 * 0.1 / (0.5 + 8 * depth**2)
    expected = max(0.0, 1 - d / 0.1) ** 2
    assert (flange_share(front_view(model(body))) > 0) == flat
    assert flange_share(front_view(model(body))) == pytest.approx(expected, abs=0.02)


def test_walls_of_a_box_a_ball_and_a_shell() -> None:
    plate = thinnest_wall(model(box(0.3, 0.4, 0.012)))
    assert plate.min_mm == pytest.approx(12, abs=0.01)
    assert plate.quantile_mm == pytest.approx(12, abs=0.01)
    # Rays along the normals of flat facets miss the centre by little.
    assert thinnest_wall(model(ball(0.1))).min_mm == pytest.approx(200, rel=0.01)
    cavity = ball(0.08)
    cavity.invert()
    assert thinnest_wall(model(ball(0.1), cavity)).quantile_mm == pytest.approx(20, rel=0.02)


def test_a_neck_between_two_bodies_is_the_thinnest_wall() -> None:
    neck = model(box(0.2, 0.2, 0.2, (0.3, 0, 0)), box(0.2, 0.2, 0.2, (-0.3, 0, 0)), box(0.398, 0.03, 0.2))
    assert thinnest_wall(neck).min_mm == pytest.approx(30, abs=0.01)


def test_quality_of_triangles_by_formula() -> None:
    def one(points: list[tuple[float, float]]) -> float:
        return quality(Mesh(np.pad(np.array(points, np.float32), ((0, 0), (0, 1))), np.array([[0, 1, 2]]))).minimum

    assert one([(0, 0), (1, 0), (0.5, 3**0.5 / 2)]) == pytest.approx(1)
    assert one([(0, 0), (1, 0), (0, 1)]) == pytest.approx(3**0.5 / 2)
    assert one([(0, 0), (1, 0), (0.5, 0.01)]) == pytest.approx(4 * 3**0.5 * 0.005 / (1 + 2 * 0.2501))
    assert one([(0, 0), (1, 0), (2, 0)]) == 0.0
    found = quality(Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0.01, 0]]), np.array([[0, 1, 2], [0, 1, 3]])))
    assert found.slivers == 0.5


def test_laws_of_sound_bodies() -> None:
    found = laws(model(ball(0.1, halvings=3), trimesh.creation.torus(0.5, 0.1)))
    assert (found.closed, found.manifold) == (True, True)
    assert (found.components, found.genus) == (2, 1)
    assert (found.inner_shells, found.crossing, found.turned) == (0, 0, 0.0)


def test_a_hole_and_a_turned_triangle_break_the_laws() -> None:
    body = ball(0.1, halvings=3)
    open_ = laws(TexturedMesh(body.vertices, body.faces[1:], body.vertex_normals, np.arange(len(body.vertices))))
    assert not open_.closed
    faces = np.array(body.faces)
    faces[0] = faces[0, ::-1]
    turned = laws(TexturedMesh(body.vertices, faces, body.vertex_normals, np.arange(len(body.vertices))))
    assert turned.closed
    assert not turned.manifold
    assert turned.turned == pytest.approx(3 / len(body.vertices))


def test_split_vertices_are_one_solid() -> None:
    body = ball(0.1, halvings=3)
    corners = np.asarray(body.faces).reshape(-1)
    split = TexturedMesh(
        body.vertices[corners], np.arange(len(corners)).reshape(-1, 3), body.vertex_normals[corners], corners
    )
    assert len(solid_mesh(split).vertices) == len(body.vertices)
    assert laws(split) == laws(model(body))


def test_inner_shells_are_cavities_and_bodies_within_bodies() -> None:
    cavity = ball(0.05, halvings=3)
    cavity.invert()

    def count(*bodies: trimesh.Trimesh) -> int:
        return inner_shells(solid_mesh(model(*bodies)))

    large, small = ball(0.1, halvings=3), ball(0.05, halvings=3)
    assert count(large, ball(0.1, (0.3, 0, 0), halvings=3)) == 0
    assert count(large, small) == 1
    assert count(large, cavity) == 1
    assert count(large, small, ball(0.02, halvings=3)) == 2


def test_crossing_triangles_are_where_two_surfaces_meet() -> None:
    assert crossing_triangles(solid_mesh(model(ball(0.1, halvings=4)))) == 0
    body = solid_mesh(model(ball(0.1, halvings=4), ball(0.1, (0.1, 0, 0), halvings=4)))
    found = crossing_triangles(body)
    # A circle of 87 mm radius through triangles of some 7 mm, on both spheres.
    edge = np.linalg.norm(body.vertices[body.faces[:, 0]] - body.vertices[body.faces[:, 1]], axis=1).mean()
    around = 2 * np.pi * 0.0866 / edge
    assert around < found < 6 * around
