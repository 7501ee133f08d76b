from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fig2mesh.field import analytic
from fig2mesh.field.body import Body
from fig2mesh.field.camera import framing, orthographic
from fig2mesh.field.compiled import THREADS_VARIABLE
from fig2mesh.field.reference import trace_reference
from fig2mesh.field.trace import trace
from fig2mesh.records import PartSdf, Rays
from fig2mesh.skeleton import BODY_PARTS

from .fields import BALL, LIMB, ball, first_below, gap, harsh, limb, pair, random_rays, towards


def sphere_depth(rays: Rays, centre: tuple[float, float, float], radius: float) -> np.ndarray:
    offset = rays.origins.astype(np.float64) - centre
    along = (offset * rays.directions).sum(axis=1)
    square = along**2 - (offset**2).sum(axis=1) + radius**2
    return np.where(square >= 0, -along - np.sqrt(np.maximum(square, 0)), np.inf)


def test_depth_and_normals_of_a_sphere():
    body, rays = Body((ball(64),)), random_rays(4000)
    hits = trace(body, rays)
    expected = sphere_depth(rays, (0.1, -0.2, 0.05), 0.4)
    offset = hits.points - np.array([0.1, -0.2, 0.05])
    # a chord of length h under an arc of radius r is h^2 / 8r inside: 64 nodes on 1.1 give 1e-4, cells' diagonals 3e-4;
    # along a ray that grows by one over the cosine of incidence
    both = hits.hit & np.isfinite(expected)
    cosine = -(hits.normals * rays.directions).sum(axis=1)
    assert (hits.hit != np.isfinite(expected)).mean() < 0.002
    assert (gap(hits.depth, expected) * cosine)[both & (cosine > 0.1)].max() < 4e-4
    assert (hits.normals * offset / np.linalg.norm(offset, axis=1, keepdims=True)).sum(axis=1)[both].min() > 0.9999


def test_capsule_surface_is_met_where_the_formula_vanishes():
    function = analytic.capsule(*LIMB)
    hits = trace(Body((limb(64),)), random_rays(4000, 1), tolerance=1e-5)
    assert hits.hit.sum() > 500
    assert np.abs(function(hits.points[hits.hit].astype(np.float64))).max() < 8e-4  # h^2 / 8r with r = 0.12, diagonally


@pytest.mark.parametrize("body", [pair(), harsh()], ids=["pair", "harsh"])
def test_agrees_with_the_numpy_twin(body):
    rays = random_rays(1500, 2)
    fast, slow = trace(body, rays, tolerance=1e-6), trace_reference(body, rays, tolerance=1e-6)
    # the twin finds roots by 64 samples a cell: it may overlook an even thinner graze
    same = fast.hit == slow.hit
    assert same.mean() >= 0.999
    assert not (slow.hit & ~fast.hit).any()
    both = fast.hit & slow.hit & (gap(fast.depth, slow.depth) < 1e-5)
    assert both.sum() >= 0.999 * fast.hit.sum()
    assert (fast.part_index[both] == slow.part_index[both]).mean() > 0.999
    # on a crease between cells a difference of 1e-6 in place may choose the other rule for the gradient
    assert (np.abs(fast.normals - slow.normals)[both].max(axis=1) < 1e-3).mean() > 0.995


def test_fine_march_finds_nothing_that_was_stepped_over():
    body, rays = harsh(), random_rays(3000, 5)
    hits = trace(body, rays, tolerance=1e-6)
    brute = first_below(body, rays, 2.7, 4001)
    step = 2.7 / 4000
    assert not (np.isfinite(brute) & (hits.depth > brute + 1e-5)).any()
    assert (hits.hit == np.isfinite(brute)).mean() >= 0.999
    agree = gap(hits.depth, brute) <= step + 1e-5
    assert agree.mean() >= 0.999  # the march in turn steps over grazes shorter than its step ...
    again = body.evaluate(hits.points[~agree].astype(np.float64) + 2e-5 * rays.directions[~agree])[0]
    assert np.abs(again).max(initial=0) < 2e-3  # ... which are real: the field vanishes there
    assert hits.steps.max() < 400


@given(st.integers(0, 10_000), st.floats(1, 3), st.sampled_from([8, 17, 32]))
@settings(max_examples=25, deadline=None)
def test_overestimates_change_steps_not_depths(seed, factor, n):
    part = limb(n)
    rays = random_rays(200, seed)
    plain = trace(Body((part,)), rays, tolerance=1e-6)
    stretched = PartSdf(part.part, part.grid * np.float32(factor), part.centre, part.edge)
    hits = trace(Body((stretched,)), rays, tolerance=1e-6)
    assert (hits.hit == plain.hit).mean() >= 0.99
    both = hits.hit & plain.hit
    assert gap(hits.depth, plain.depth)[both].max(initial=0) < 1e-5


@given(st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_random_grids_are_never_crossed_unseen(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8))
    body = Body((PartSdf(1, rng.normal(0.3, 1, (n, n, n)), rng.normal(size=3) * 0.1, 0.7),))
    rays = random_rays(60, seed)
    hits = trace(body, rays, tolerance=1e-6)
    brute = first_below(body, rays, 2.7, 1500)
    assert not (hits.depth > brute + 1e-5).any()
    for name in ("points", "normals"):
        assert np.isfinite(getattr(hits, name)).all()
    assert np.allclose(np.linalg.norm(hits.normals[hits.hit], axis=1), 1, atol=1e-5)
    inside = body.evaluate(hits.points[hits.hit] + 1e-5 * rays.directions[hits.hit])[0]
    # a corner of the cube may be cut by less than 1e-5: nearly all rays are inside just behind the hit
    assert (inside <= 1e-3).mean() > 0.95 if len(inside) else True


def test_thin_limb_is_seen_along_its_whole_length():
    """0.3 cells thick, on a grid line, where nodes sample it: the interpolant makes it a spindle about that line."""
    n = 33
    part = analytic.sample(analytic.capsule((0, -0.4, 0), (0, 0.4, 0), 0.15 / (n - 1)), 3, (0, 0, 0), 1.0, n)
    y = np.linspace(-0.37, 0.37, 500)  # the last node inside is at 0.375
    x = np.linspace(-1e-3, 1e-3, 500)
    hits = trace(Body((part,)), Rays(np.stack([x, y, np.full(500, 2.0)], axis=1), np.tile((0.0, 0.0, -1.0), (500, 1))))
    assert hits.hit.all()
    assert (hits.normals[:, 2] > 0.7).all()  # 45 degrees: the spindle's faces between the grid lines


def test_grazing_rays_end():
    part = ball(64)
    body = Body((part,))
    offsets = np.linspace(0.399, 0.401, 401)
    origins = np.stack([0.1 + offsets, np.full(401, -0.2), np.full(401, 3.0)], axis=1)
    hits = trace(body, Rays(origins, np.tile((0.0, 0.0, -1.0), (401, 1))))
    assert hits.hit[0]
    assert not hits.hit[-1]
    assert np.count_nonzero(np.diff(hits.hit)) == 1  # one silhouette, no speckle
    assert hits.steps.max() < 3 * 64


def test_the_nearest_of_overlapping_parts_is_hit():
    body, rays = pair(), random_rays(3000, 7)
    hits = trace(body, rays, tolerance=1e-6)
    single = np.stack([trace(Body((part,)), rays, tolerance=1e-6).depth for part in body.parts])
    assert np.array_equal(hits.depth, single.min(axis=0))
    clear = hits.hit & ~np.isclose(single[0], single[1], atol=1e-5)
    assert np.array_equal(hits.part_index[clear], single.argmin(axis=0)[clear])
    assert set(hits.part_index) == {-1, 0, 1}


def test_no_rays_no_parts_no_surface():
    rays = random_rays(50)
    assert len(trace(pair(), Rays(np.zeros((0, 3)), np.zeros((0, 3)))).depth) == 0
    positive = analytic.sample(lambda points: np.full(len(points), 0.2), 1, (0, 0, 0), 1.0, 16)
    for body in (Body(()), Body((positive,))):
        hits = trace(body, rays)
        assert not hits.hit.any()
        assert np.isinf(hits.depth).all()
        assert hits.steps.sum() == 0  # not even visited


def test_rays_from_inside_and_from_behind():
    inside = towards(np.tile((0.1, -0.2, 0.05), (50, 1)), np.random.default_rng(0).normal(size=(50, 3)))
    hits = trace(Body((ball(),)), inside)
    assert (hits.depth == 0).all()
    rays = random_rays(50)
    away = trace(Body((ball(),)), Rays(rays.origins, -rays.directions))
    assert not away.hit.any()


def test_a_part_cut_by_its_cube_ends_there():
    """A ball in a cube too small for it: a square face from the front."""
    part = analytic.sample(analytic.sphere((0, 0, 0), 0.5), 1, (0, 0, 0), 0.5, 24)
    body = Body((part,))
    rays = orthographic(0, size=(32, 32), height=0.6)
    hits = trace(body, rays)
    x, y = np.abs(rays.origins[:, 0]), np.abs(rays.origins[:, 1])
    assert np.array_equal(hits.hit, (x <= 0.25) & (y <= 0.25))
    assert np.allclose(hits.points[hits.hit][:, 2], 0.25, atol=1e-6)
    outside = hits.points[hits.hit] + np.array([0, 0, 0.01], np.float32)
    assert (body.distance(outside) > 0.009).all()


def test_more_nodes_cost_few_more_cells():
    rays = orthographic(0, size=(48, 48), height=1.2)
    steps = [trace(Body((ball(n),)), rays).steps.mean() for n in (32, 64, 128)]
    assert steps[2] < 2 * steps[0]


def test_threads_do_not_change_the_result(monkeypatch):
    rays, results = random_rays(2000, 9), []
    for threads in ("1", "2", "5"):
        monkeypatch.setenv(THREADS_VARIABLE, threads)
        results.append(trace(harsh(), rays))
    for name in ("depth", "part_index", "points", "normals", "steps"):
        assert np.array_equal(getattr(results[0], name), getattr(results[1], name))
        assert np.array_equal(getattr(results[0], name), getattr(results[2], name))


def test_calls_from_several_threads_at_once():
    body, rays = pair(), [random_rays(3000, seed) for seed in range(6)]
    with ThreadPoolExecutor(6) as pool:
        together = list(pool.map(lambda some: trace(body, some), rays))
    for some, hits in zip(rays, together, strict=True):
        assert np.array_equal(hits.depth, trace(body, some).depth)


def test_mannequin_from_four_sides():
    functions = analytic.mannequin_parts()
    body = Body(analytic.mannequin(48))
    seen: set[int] = set()
    for yaw in (0, 90, 180, 270):
        centre, height = framing(body.bounds(), (96, 128), yaw)
        hits = trace(body, orthographic(yaw, size=(96, 128), height=height, centre=centre))
        points = hits.points[hits.hit].astype(np.float64)
        distance = np.min([function(points) for function in functions.values()], axis=0)
        assert np.abs(distance).max() < 2e-3  # the thinnest limb has 3 cells across
        assert np.abs(distance).mean() < 3e-4
        seen |= set(body.labels[hits.part_index[hits.hit]])
    assert seen == set(BODY_PARTS)


def test_far_away_viewer():
    rays = orthographic(30, 20, size=(40, 40), height=1.2, distance=10)
    far = orthographic(30, 20, size=(40, 40), height=1.2, distance=1000)
    near_hits, far_hits = trace(pair(), rays), trace(pair(), far)
    assert (near_hits.hit == far_hits.hit).mean() > 0.995
    both = near_hits.hit & far_hits.hit
    # float32 steps are 6e-5 at a distance of 1000
    assert np.median(np.abs(near_hits.points - far_hits.points)[both]) < 2e-4


def test_without_normals_everything_else_is_the_same():
    rays = random_rays(500)
    full, bare = trace(pair(), rays), trace(pair(), rays, with_normals=False)
    assert np.array_equal(full.depth, bare.depth)
    assert not bare.normals.any()


def test_tolerance_must_be_positive():
    with pytest.raises(ValueError, match="tolerance"):
        trace(pair(), random_rays(2), tolerance=0)


def test_ball_formula_is_the_shared_one():
    assert BALL(np.array([[0.5, -0.2, 0.05]])) == pytest.approx(0)
