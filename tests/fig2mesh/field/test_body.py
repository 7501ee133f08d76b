from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fig2mesh.field import analytic
from fig2mesh.field.blend import blend
from fig2mesh.field.body import Body
from fig2mesh.field.camera import orthographic
from fig2mesh.field.distance import lipschitz, negative_bounds
from fig2mesh.field.reference import distance_reference, gradient_reference
from fig2mesh.field.trace import trace
from fig2mesh.records import PartSdf

from .fields import BALL, LIMB, ball, harsh, limb, pair


def points_about(count: int, seed: int = 0, reach: float = 1.0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 3))


@pytest.mark.parametrize("body", [pair(), harsh()], ids=["pair", "harsh"])
def test_agrees_with_the_numpy_twins(body):
    points = points_about(3000)
    values, parts, gradients = body.evaluate(points, with_parts=True, with_gradients=True)
    expected, index = distance_reference(body, points)
    assert np.allclose(values, expected, atol=1e-12)
    assert np.array_equal(parts, index)
    assert np.allclose(gradients, gradient_reference(body, points), atol=1e-9)
    assert np.allclose(body.distance(points), values, atol=1e-6)
    assert np.array_equal(body.nearest_part(points), parts)
    assert np.allclose(body.gradient(points), gradients, atol=1e-5)


def test_distance_of_a_sphere_inside_the_cube_and_outside():
    points = points_about(5000, reach=2.0)
    value, exact = Body((ball(64),)).distance(points), BALL(points)
    inside = (np.abs(points - np.array([0.1, -0.2, 0.05])) <= 0.55).all(axis=1)
    assert np.abs(value - exact)[inside & (exact > -0.3)].max() < 1e-3  # chords; the centre itself is a cusp
    assert (value[~inside] <= exact[~inside] + 1e-3).all()  # a lower bound
    assert (value[~inside] >= 0.5 * exact[~inside]).all()  # and not an idle one


def test_distance_is_continuous_on_the_faces_of_the_cube():
    body = Body((ball(32),))
    rng = np.random.default_rng(1)
    face = rng.uniform(-0.55, 0.55, (600, 3))
    face[np.arange(600), rng.integers(0, 3, 600)] = 0.55 * rng.choice([-1, 1], 600)
    face += np.array([0.1, -0.2, 0.05])
    inner, outer = (
        body.evaluate(np.array([0.1, -0.2, 0.05]) + (face - [0.1, -0.2, 0.05]) * s)[0] for s in (0.999999, 1.000001)
    )
    assert np.abs(inner - outer).max() < 1e-5


def test_gradient_is_the_slope_of_the_distance():
    body, points = pair(), points_about(2000, 3, 1.2)
    value, _, gradient = body.evaluate(points, with_gradients=True)
    away = BALL(points) > -0.3  # not at the cusp
    eps = 0.5 * body.parts[0].spacing
    numeric = np.stack(
        [
            (body.evaluate(points + eps * axis)[0] - body.evaluate(points - eps * axis)[0]) / (2 * eps)
            for axis in np.eye(3)
        ],
        axis=1,
    )
    # at creases between parts and at cube faces the two differ, by rights
    assert (np.abs(gradient - numeric).max(axis=1)[away] < 0.05).mean() > 0.95
    assert np.isfinite(gradient).all()
    assert np.isfinite(value).all()


def test_normals_are_smooth_across_cells():
    """The interpolant's own gradient jumps by the cell's curvature, 2.5 degrees here; central differences do not."""
    angle = np.linspace(0, 2 * np.pi, 4000, endpoint=False)
    points = np.stack([np.cos(angle), np.sin(angle), np.zeros(4000)], axis=1) * 0.4 + [0.1, -0.2, 0.05]
    normal = Body((ball(24),)).gradient(points).astype(np.float64)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    turn = np.arccos(np.clip((normal * np.roll(normal, 1, axis=0)).sum(axis=1), -1, 1))
    assert np.degrees(turn.max()) < 0.3  # an even turn would be 0.09


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_lipschitz_bounds_every_slope(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 7))
    part = PartSdf(1, rng.normal(size=(n, n, n)), (0, 0, 0), 2.0)
    bound = lipschitz(part.grid, part.spacing)
    a, b = rng.uniform(-1, 1, (2, 300, 3))
    b = a + (b - a) * rng.uniform(0.001, 1, (300, 1))
    body = Body((part,))
    rise = np.abs(body.evaluate(a)[0] - body.evaluate(b)[0])
    assert (rise <= bound * np.linalg.norm(a - b, axis=1) + 1e-9).all()


def test_lipschitz_of_a_distance_is_about_one():
    part = ball(64)
    assert 1 < lipschitz(part.grid, part.spacing, outside=True) < 1.1
    assert lipschitz(part.grid * 3, part.spacing, outside=True) == pytest.approx(
        3 * lipschitz(part.grid, part.spacing, outside=True), rel=1e-5
    )


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_negative_bounds_hold_the_negative_region_tightly(seed):
    rng = np.random.default_rng(seed)
    part = PartSdf(1, rng.normal(0.8, 1, (5, 5, 5)), (0, 0, 0), 4.0)  # nodes at -2 ... 2
    box = negative_bounds(part.grid)
    points = rng.uniform(-2, 2, (4000, 3))
    negative = points[Body((part,)).evaluate(points)[0] <= 0]
    if box is None:
        assert len(negative) == 0
        return
    assert (negative >= box[0] - 2 - 1e-9).all()
    assert (negative <= box[1] - 2 + 1e-9).all()


def test_bounds():
    low, high = Body((ball(64), limb(64))).bounds()
    start, end, radius = LIMB
    assert np.allclose(low, np.minimum(np.array([0.1, -0.2, 0.05]) - 0.4, np.minimum(start, end) - radius), atol=2e-3)
    assert np.allclose(high, np.maximum(np.array([0.1, -0.2, 0.05]) + 0.4, np.maximum(start, end) + radius), atol=2e-3)
    positive = analytic.sample(lambda points: np.ones(len(points)), 1, (0, 0, 0), 1.0, 8)
    assert np.allclose(Body((positive, ball(64))).bounds(), Body((ball(64),)).bounds())
    with pytest.raises(ValueError, match="no grid has a negative value"):
        Body((positive,)).bounds()


def test_projection_lands_on_the_zero_level():
    body = Body(analytic.mannequin(48))
    rng = np.random.default_rng(4)
    low, high = body.bounds()
    points = rng.uniform(low, high, (20_000, 3))
    points = points[np.abs(body.distance(points)) < 0.05]
    landed, done = body.project(points)
    assert done.mean() > 0.99
    assert np.abs(body.distance(landed[done])).max() < 3e-5
    # nobody travels far: at most about twice the distance it had
    assert np.median(np.linalg.norm(landed - points, axis=1) / np.maximum(np.abs(body.distance(points)), 1e-4)) < 1.2


def test_projection_copes_with_fields_that_are_no_distances():
    part = limb(48)
    body = Body((PartSdf(3, part.grid * 3 + part.grid**2, part.centre, part.edge),))
    points = points_about(3000, 2, 0.4)
    landed, done = body.project(points, 20)
    assert done.mean() > 0.97
    # zero level unmoved; chords of the steeper grid
    assert np.abs(analytic.capsule(*LIMB)(landed[done].astype(np.float64))).max() < 2e-3


def test_nothing_to_evaluate():
    body = Body(())
    assert np.isinf(body.distance(np.zeros((3, 3)))).all()
    assert (body.nearest_part(np.zeros((3, 3))) == -1).all()
    assert not body.project(np.zeros((3, 3)))[1].any()
    assert len(pair().distance(np.zeros((0, 3)))) == 0
    assert pair().project(np.zeros((0, 3)))[0].shape == (0, 3)
    with pytest.raises(ValueError, match="expected"):
        pair().distance(np.zeros((3, 2)))


def test_a_part_without_a_surface_is_left_out():
    """Else its small positive numbers would be the distance, and its part the nearest, all over its cube."""
    body, points = pair(), points_about(500)
    nothing = analytic.sample(lambda points: np.full(len(points), 1e-3), 9, (0, 0, 0), 2.0, 8)
    more = Body((*body.parts, nothing))
    assert np.array_equal(more.distance(points), body.distance(points))
    assert np.array_equal(more.nearest_part(points), body.nearest_part(points))
    assert np.isinf(Body((nothing,)).distance(points)).all()


def test_labels_follow_parts():
    assert pair().labels.tolist() == [1, 3]


@pytest.mark.parametrize("pair", [(0, 2), (1, 1), (-1, 0)])
def test_fillets_are_between_two_parts_that_are_there(pair):
    parts = tuple(analytic.sample(analytic.sphere((x, 0, 0), 0.2), 1, (x, 0, 0), 0.8, 16) for x in (0.0, 0.3))
    with pytest.raises(ValueError, match="fillets"):
        Body(parts, fillets=((*pair, parts[0]),))


def test_smooth_pairs_melt_together_and_only_they():
    a = analytic.sample(analytic.capsule((-0.3, 0, 0), (0, 0, 0), 0.1), 3, (-0.15, 0, 0), 0.7, 64)
    b = analytic.sample(analytic.capsule((0, 0, 0), (0, 0.3, 0), 0.1), 5, (0, 0.15, 0), 0.7, 64)
    plain, smooth = Body((a, b)), Body((a, b), ((0, 1, 0.08),))
    armpit = np.array([[-0.105, 0.105, 0.0]])  # just outside of both
    assert plain.distance(armpit) > 0
    assert smooth.distance(armpit) < 0
    far = np.array([[-0.35, 0.0, 0.02], [0.02, 0.36, 0.0], [-0.25, -0.11, 0.0]])
    assert np.allclose(smooth.distance(far), plain.distance(far), atol=1e-6)
    points = points_about(4000, 6, 0.5)
    assert (smooth.evaluate(points)[0] <= plain.evaluate(points)[0] + 1e-12).all()
    near = np.abs(plain.evaluate(points)[0]) < 0.02
    # a smooth minimum lowers the field by a quarter of its radius at most
    assert (plain.evaluate(points)[0] - smooth.evaluate(points)[0])[near].max() < 0.25 * 0.08 + 1e-3

    rays = orthographic(0, size=(96, 96), height=0.9)
    creased, melted = trace(plain, rays), trace(smooth, rays)
    assert (melted.hit | ~creased.hit).all()  # nothing is lost
    added = melted.hit & ~creased.hit
    assert 5 < added.sum() < 200
    assert set(melted.part_index) == {-1, 0, 1}  # fillets belong to the parts
    both = melted.hit & creased.hit
    assert (melted.depth[both] <= creased.depth[both] + 1e-4).all()
    assert set(smooth.nearest_part(melted.points[added])) <= {0, 1}


def test_parts_far_apart_need_no_fillet():
    a = analytic.sample(analytic.sphere((0, 0, 0), 0.1), 1, (0, 0, 0), 0.4, 16)
    b = analytic.sample(analytic.sphere((1, 0, 0), 0.1), 1, (1, 0, 0), 0.4, 16)
    assert blend(a, b, 0.05) is None
    with pytest.raises(ValueError, match="smooth"):
        Body((a, b), ((0, 2, 0.1),))


def test_fillets_made_elsewhere_are_those_made_here():
    a = analytic.sample(analytic.capsule((-0.3, 0, 0), (0, 0, 0), 0.1), 3, (-0.15, 0, 0), 0.7, 48)
    b = analytic.sample(analytic.capsule((0, 0, 0), (0, 0.3, 0), 0.1), 5, (0, 0.15, 0), 0.7, 48)
    here, elsewhere = Body((a, b), ((0, 1, 0.08),)), Body((a, b), fillets=((0, 1, blend(a, b, 0.08)),))
    points = points_about(4000, 7, 0.5)
    for mine, theirs in zip(
        here.evaluate(points, with_parts=True, with_gradients=True),
        elsewhere.evaluate(points, with_parts=True, with_gradients=True),
        strict=True,
    ):
        assert np.array_equal(mine, theirs)
    assert set(elsewhere.nearest_part(points)) <= {0, 1}, "fillets belong to the parts that they join"


def test_a_fillet_takes_nothing_away_whatever_its_grid_says():
    body = pair()
    absent = analytic.sample(lambda points: np.full(len(points), 0.5), 1, (0, 0, 0), 1.0, 8)
    points = points_about(1000, 8)
    assert np.array_equal(
        Body(body.parts, fillets=((0, 1, absent),)).distance(points), Body(body.parts).distance(points)
    )
