"""Distance fields that are thin, steep, empty, full or broken, and rays that graze, coincide or start far away."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fig2mesh.field import analytic
from fig2mesh.field.body import Body
from fig2mesh.field.camera import axes, orthographic
from fig2mesh.field.reference import distance_reference, gradient_reference, trace_reference
from fig2mesh.field.trace import trace
from fig2mesh.mesh.isosurface import isosurface
from fig2mesh.mesh.topology import check_solid
from fig2mesh.records import Mesh, PartSdf, Rays
from tests.fig2mesh.field.fields import ball, first_below, gap, limb, pair, random_rays, towards
from tests.hard_cases.case import Worst, drawn, hard_case

seeds = st.integers(0, 10_000)
degrees = st.integers(0, 359)
REACH = 3.0


def unit(rng: np.random.Generator, count: int) -> np.ndarray:
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def overestimating(part: PartSdf, rng: np.random.Generator, most: float = 3.0) -> PartSdf:
    """The part with every node's value up to `most` times too large, each by its own factor."""
    factor = 1 + (most - 1) * rng.random(part.grid.shape, np.float32)
    return PartSdf(part.part, part.grid * factor, part.centre, part.edge)


def thin_limb(rng: np.random.Generator, radius_cells: float, n: int = 33) -> tuple[PartSdf, np.ndarray]:
    """A limb of that radius in cells through the middle of its cube, in any direction; and its ends."""
    axis = 0.4 * unit(rng, 1)[0]
    ends = np.stack([-axis, axis]) + rng.uniform(-0.02, 0.02, 3)
    part = analytic.sample(analytic.capsule(*ends, radius_cells / (n - 1)), 3, (0, 0, 0), 1.0, n)
    return part, ends


@hard_case(
    "rays beside a ball of radius 0.4, within 0.002 of its silhouette, from any direction",
    "the silhouette lies where the formula has it, and every normal is across the ray or towards the viewer",
    "a chord between nodes h apart is h²/8r = 1e-4 inside of an arc, over a cell's diagonal three times that",
    3e-4,
)
@given(degrees, st.integers(-90, 90), degrees)
@drawn(40)
def test_grazing_rays(worst: Worst, yaw: int, pitch: int, around: int) -> None:
    right, up, back = axes(yaw, pitch)
    aside = np.cos(np.radians(around)) * right + np.sin(np.radians(around)) * up
    offsets = np.linspace(0.398, 0.402, 401)
    origins = np.array([0.1, -0.2, 0.05]) + 2.0 * back + offsets[:, None] * aside
    hits = trace(Body((ball(64),)), Rays(origins, np.broadcast_to(-back, origins.shape)), tolerance=1e-6)
    assert hits.hit[0]
    assert not hits.hit[-1]
    worst(0.4 - offsets[~hits.hit].min())
    worst(offsets[hits.hit].max() - 0.4)
    facing = -(hits.normals[hits.hit] * -back).sum(axis=1)
    # A facet of a cell may face away from the smooth normal by its own curvature, h / r.
    assert facing.min() > -1.1 / 63 / 0.4


@hard_case(
    "limbs of radius 2 to 0.2 cells in any direction, 300 rays across each",
    "no ray passes what a march of 3,000 steps meets",
    "the cubic in each cell is solved to 1e-6 along the ray; float32 rounds depths of 2 by 1.2e-7",
    2e-6,
)
@given(seeds, st.floats(0.2, 2.0))
@drawn(15)
def test_limbs_thinner_than_a_cell(worst: Worst, seed: int, radius: float) -> None:
    rng = np.random.default_rng(seed)
    part, ends = thin_limb(rng, radius)
    share = rng.random((300, 1))
    rays = towards(1.5 * unit(rng, 300), ends[0] + share * (ends[1] - ends[0]) + rng.normal(0, 0.01, (300, 3)))
    hits = trace(Body((part,)), rays, tolerance=1e-6)
    brute = first_below(Body((part,)), rays, REACH, 3000)
    met = np.isfinite(brute)
    worst((hits.depth[met] - brute[met]).max(initial=0.0))
    # And nothing is met that is not there: a node inside is at most a radius from the axis, a hit a diagonal from it.
    away = analytic.capsule(*ends, 0.0)(hits.points[hits.hit].astype(np.float64))
    assert away.max(initial=0.0) <= (radius + np.sqrt(3)) / 32


@hard_case(
    "balls and thin limbs whose nodes overestimate the distance, each by its own factor of 1 to 3",
    "no ray passes what a march of 3,000 steps meets",
    "steps are bounded by the grid's own slope, so the tolerance is that of true distances",
    2e-6,
)
@given(seeds, st.sampled_from([9, 17, 33]))
@drawn(12)
def test_fields_that_overestimate_up_to_three_times(worst: Worst, seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    parts = tuple(overestimating(part, rng) for part in (ball(n), limb(n), thin_limb(rng, 0.4)[0]))
    rays = random_rays(200, seed)
    hits = trace(Body(parts), rays, tolerance=1e-6)
    brute = first_below(Body(parts), rays, REACH, 3000)
    met = np.isfinite(brute)
    worst((hits.depth[met] - brute[met]).max(initial=0.0))


@hard_case(
    "the same bodies, meshed",
    "a closed, oriented manifold whose vertices have a value of nearly 0",
    "vertices move onto the field by Newton's method to a thousandth of the spacing of 0.02, except where a triangle "
    "would turn over: those stay on the chord of their cell",
    0.02,
)
@given(seeds)
@drawn(5)
def test_meshes_of_fields_that_overestimate(worst: Worst, seed: int) -> None:
    rng = np.random.default_rng(seed)
    body = Body(tuple(overestimating(part, rng) for part in (ball(48), limb(48))))
    mesh = isosurface(body, spacing=0.02)
    assert check_solid(mesh).outward
    worst(np.abs(body.distance(mesh.vertices)).max())


@hard_case(
    "a grid without a negative value, alone and beside a limb; values from 1e-30 to 1e30",
    "no hits, infinite distance, no bounds; a limb beside it is traced as if it were alone",
    "a part without a surface is left out altogether",
)
@given(seeds, st.integers(-30, 30))
@drawn(20)
def test_all_positive_grids(seed: int, exponent: int) -> None:
    rng = np.random.default_rng(seed)
    values = (10.0**exponent * rng.uniform(0.1, 1, (9, 9, 9))).astype(np.float32)
    empty, rays = PartSdf(2, values, np.zeros(3), 1.5), random_rays(100, seed)
    alone = Body((empty,))
    assert not trace(alone, rays).hit.any()
    assert np.isinf(alone.distance(rays.origins)).all()
    assert (alone.nearest_part(rays.origins) == -1).all()
    with pytest.raises(ValueError, match="no grid has a negative value"):
        alone.bounds()
    assert np.array_equal(trace(Body((limb(), empty)), rays).depth, trace(Body((limb(),)), rays).depth)


@hard_case(
    "a cube whose every node is negative, values from −1e-30 to −1e30, any place and size",
    "rays hit the cube's faces; its mesh is closed and as large as the cube",
    "depth: float32 of a ray from 3 units away. A jump says nothing of its place between nodes, so the mesh has each "
    "face within a cell of 1/12: (1 + 2/12)³ − 1 of the volume",
    0.59,
    "of the volume",
)
@given(seeds, st.integers(-30, 30), st.floats(0.1, 1.0))
@drawn(6)
def test_all_negative_grids(worst: Worst, seed: int, exponent: int, edge: float) -> None:
    rng = np.random.default_rng(seed)
    values = (-(10.0**exponent) * rng.uniform(0.5, 1, (5, 5, 5))).astype(np.float32)
    centre = rng.uniform(-0.2, 0.2, 3).astype(np.float32)
    body = Body((PartSdf(1, values, centre, edge),))
    across = rng.uniform(-0.45, 0.45, (50, 2)) * edge
    origins = centre.astype(np.float64) + np.column_stack([across, np.full(50, 3.0)])
    hits = trace(body, Rays(origins, np.tile((0.0, 0.0, -1.0), (50, 1))))
    assert np.abs(hits.depth - (3.0 - edge / 2)).max() < 1e-6
    assert np.isfinite(hits.normals).all()
    report = check_solid(isosurface(body, spacing=edge / 12))
    assert report.outward
    assert report.components == 1
    worst(abs(report.volume / edge**3 - 1))


BROKEN = {
    "grid": lambda bad: PartSdf(1, np.where(np.indices((4, 4, 4)).sum(0) == 5, bad, -1.0), np.zeros(3), 1.0),
    "centre": lambda bad: PartSdf(1, np.zeros((4, 4, 4)), np.array([0.0, bad, 0.0]), 1.0),
    "origins": lambda bad: Rays(np.array([[0.0, 0.0, bad]]), np.array([[0.0, 0.0, 1.0]])),
    "directions": lambda bad: Rays(np.zeros((1, 3)), np.array([[bad, 0.0, 1.0]])),
    "vertices": lambda bad: Mesh(np.full((3, 3), bad), np.array([[0, 1, 2]])),
}


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", BROKEN)
@hard_case(
    "NaN and ±inf in grids, their centres, rays and vertices",
    "refused where the record is made, by the name of the array",
    "one NaN would spread over a whole limb and surface three stages later",
)
def test_nan_and_infinity_in_records(name: str, bad: float) -> None:
    with pytest.raises(ValueError, match=f"{name}: holds NaN or infinite values"):
        BROKEN[name](bad)


@hard_case(
    "points with NaN, ±inf and ±1e300 coordinates, among good ones",
    "the good ones have the values they have alone; NaN gives NaN, the others infinity or a large distance",
    "points are independent of each other",
)
def test_nan_and_infinity_in_points() -> None:
    body, good = pair(), np.random.default_rng(0).uniform(-1, 1, (50, 3))
    bad = np.array([[np.nan, 0, 0], [0, np.nan, np.nan], [np.inf, 0, 0], [-np.inf, np.inf, 0], [1e300, 0, -1e300]])
    values, parts, gradients = body.evaluate(np.concatenate([good, bad]), with_parts=True, with_gradients=True)
    alone = body.evaluate(good, with_parts=True, with_gradients=True)
    for mixed, own in zip((values, parts, gradients), alone, strict=True):
        assert np.array_equal(mixed[:50], own)
    assert not (values[50:] < 1e300).any()


@hard_case(
    "one part 2 to 5 times over, with and without a fillet between the first two",
    "hits, values and gradients of one, to the bit; the mesh is one closed solid",
    "a union takes the smaller of equal values",
)
@given(seeds, st.integers(2, 5))
@drawn(10)
def test_coincident_parts(seed: int, copies: int) -> None:
    part, rays = limb(24), random_rays(150, seed)
    one, many = Body((part,)), Body((part,) * copies)
    first, again = trace(one, rays), trace(many, rays)
    assert np.array_equal(first.depth, again.depth)
    assert np.array_equal(first.normals, again.normals)
    assert np.array_equal(one.distance(rays.origins * 0.5), many.distance(rays.origins * 0.5))
    melted = Body((part,) * copies, smooth=((0, 1, 0.05),))
    assert np.isfinite(melted.distance(rays.origins)).all()
    for body in (many, melted):
        report = check_solid(isosurface(body, spacing=0.05))
        assert report.outward
        assert report.components == 1


@hard_case(
    "rays from 200 points inside the mannequin and from points on its surface, in any direction",
    "inside: depth 0 in the nearest part. On the surface, inwards: as good as 0",
    "a point is on the surface to 1e-5 of the field's own measure; along a ray that is longer by the slope",
    1e-4,
)
@given(seeds)
@drawn(10)
def test_a_ray_that_starts_inside(worst: Worst, seed: int) -> None:
    rng, body = np.random.default_rng(seed), Body(analytic.mannequin(24))
    low, high = body.bounds()
    points = rng.uniform(low, high, (20_000, 3)).astype(np.float32)
    inside = points[body.distance(points) < -1e-4][:200]
    hits = trace(body, Rays(inside, unit(rng, len(inside))))
    assert (hits.depth == 0).all()
    assert (hits.part_index >= 0).all()
    surface, done = body.project(points[np.abs(body.distance(points)) < 0.02])
    inwards = -body.gradient(surface)
    length = np.linalg.norm(inwards, axis=1, keepdims=True)
    fine = done & (length[:, 0] > 0.5)
    entering = trace(body, Rays(surface[fine], inwards[fine] / length[fine]), tolerance=1e-6)
    # On a crease the gradient of one part may run along the other: there a ray need not enter.
    worst(np.quantile(entering.depth, 0.98))


@hard_case(
    "rays along the axes through nodes, edges and faces of cells, of a grid whose nodes are exact in binary",
    "the depth of a ray 1e-6 beside it, and of the NumPy twin",
    "1e-6 aside, depth changes by at most the slope of the ball's rim that is looked at (3) times that, and rounding",
    5e-6,
)
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rays_along_cell_faces(worst: Worst, axis: int, sign: float) -> None:
    part = analytic.sample(analytic.sphere((0, 0, 0), 0.4), 1, (0, 0, 0), 1.0, 33)
    body = Body((part,))
    lines = np.arange(-12, 13) / 32
    u, v = (grid.ravel() for grid in np.meshgrid(np.append(lines, lines + 1 / 64), lines))
    near = np.hypot(u, v) < 0.38
    origins = np.insert(np.column_stack([u, v])[near], axis, 2.0 * sign, axis=1)
    direction = np.zeros(3)
    direction[axis] = -sign
    exact = Rays(origins, np.broadcast_to(direction, origins.shape))
    beside = Rays(origins + 1e-6 * (np.arange(3) != axis), exact.directions)
    hits = trace(body, exact, tolerance=1e-6)
    assert hits.hit.all()
    worst(gap(hits.depth, trace(body, beside, tolerance=1e-6).depth).max())
    worst(gap(hits.depth, trace_reference(body, exact, tolerance=1e-6).depth).max())


@hard_case(
    "values and gradients at random points: the compiled kernel and its NumPy twin; inputs as float32 and as float64",
    "the same numbers",
    "float32 points are off by 6e-8 of their size, which a slope of 1 passes on; arithmetic is in float64 in both",
    5e-7,
)
@given(seeds)
@drawn(20)
def test_float32_against_float64(worst: Worst, seed: int) -> None:
    points = np.random.default_rng(seed).uniform(-1.5, 1.5, (500, 3))
    body = pair()
    fast, _, slope = body.evaluate(points, with_gradients=True)
    slow = distance_reference(body, points)[0]
    worst(np.abs(fast - slow).max())
    worst(np.quantile(np.abs(slope - gradient_reference(body, points)).max(axis=1), 0.99))
    worst(np.abs(body.distance(points.astype(np.float32)) - slow).max())


@hard_case(
    "a camera 10 to 10,000 units away, from any direction",
    "what is hit lies on the surface that the camera at 10 sees",
    "float32 starts of rays at 10,000 are off by 5e-4 across, which moves a hit along the surface, not off it; what is "
    "left is a tolerance of 1e-5 along the ray and the chord of a cell",
    8e-4,
)
@given(st.floats(10.0, 1e4), degrees, st.integers(-80, 80))
@drawn(25)
def test_far_away_cameras(worst: Worst, distance: float, yaw: int, pitch: int) -> None:
    function = analytic.capsule((-0.3, -0.25, 0.0), (0.35, 0.3, 0.1), 0.12)
    camera = {"yaw_deg": yaw, "pitch_deg": pitch, "size": (40, 40), "height": 1.2}
    far = trace(Body((limb(),)), orthographic(**camera, distance=distance), tolerance=1e-5)
    near = trace(Body((limb(),)), orthographic(**camera, distance=10.0), tolerance=1e-5)
    worst(np.abs(function(far.points[far.hit].astype(np.float64))).max())
    # Pixels on the silhouette may change sides.
    assert (far.hit != near.hit).mean() < 0.005


@hard_case(
    "figures from 1e-6 to 1e6 units tall, distances scaled alike",
    "depths and normals of the figure of 1 unit, times the scale",
    "float32 rounds grid, origin and depth once each: a few 1e-7 of the size, seen at a slant ten times that",
    5e-6,
    "of the size",
)
@given(st.integers(-6, 6), seeds)
@drawn(20)
def test_tiny_and_huge_figures(worst: Worst, exponent: int, seed: int) -> None:
    scale, part, rays = 10.0**exponent, limb(32), random_rays(200, seed)
    other = PartSdf(part.part, part.grid * np.float32(scale), part.centre * np.float32(scale), part.edge * scale)
    plain = trace(Body((part,)), rays, tolerance=1e-7)
    scaled = trace(Body((other,)), Rays(rays.origins * np.float32(scale), rays.directions), tolerance=1e-7 * scale)
    both = plain.hit & scaled.hit
    assert (plain.hit != scaled.hit).mean() <= 0.01
    facing = -(plain.normals * rays.directions).sum(axis=1)
    worst(gap(scaled.depth / scale, plain.depth)[both & (facing > 0.1)].max(initial=0.0))


@hard_case(
    "a field in units of its own: all values times 1e-30 to 1e30",
    "the hits of the field itself",
    "the zero level does not depend on the values' unit; float32 rounds each value once",
    5e-6,
)
@given(st.integers(-30, 30), seeds)
@drawn(20)
def test_values_of_any_magnitude(worst: Worst, exponent: int, seed: int) -> None:
    part, rays = limb(32), random_rays(200, seed)
    values = (part.grid.astype(np.float64) * 10.0**exponent).astype(np.float32)
    plain = trace(Body((part,)), rays, tolerance=1e-6)
    scaled = trace(Body((PartSdf(part.part, values, part.centre, part.edge),)), rays, tolerance=1e-6)
    facing = -(plain.normals * rays.directions).sum(axis=1)
    worst(gap(scaled.depth, plain.depth)[facing > 0.1].max(initial=0.0))
    assert (plain.hit != scaled.hit).mean() <= 0.01
