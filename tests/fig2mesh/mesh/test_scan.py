import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from fig2mesh.field.analytic import mannequin, sphere
from fig2mesh.field.body import Body
from fig2mesh.mesh.newton import newton
from fig2mesh.mesh.scan import scan
from fig2mesh.mesh.thin import thin
from fig2mesh.skeleton import PART

from .solids import SOLIDS, SPACING, Formula


@pytest.mark.parametrize("name", SOLIDS)
def test_points_lie_on_the_surface_with_normals_outwards(name: str) -> None:
    field = SOLIDS[name].field
    cloud = scan(field, spacing=SPACING, seed=3)
    assert np.abs(field.distance(cloud.points)).max() < 0.01 * SPACING
    np.testing.assert_allclose(np.linalg.norm(cloud.normals, axis=1), 1, atol=1e-5)
    # A hair's breadth outwards the field is positive, inwards negative; only in a crease is out of one limb in another.
    step = np.float32(0.2 * SPACING)
    assert (field.distance(cloud.points - step * cloud.normals) < 0).all()
    outside = field.distance(cloud.points + step * cloud.normals) > 0
    assert outside.mean() > 0.98 if name == "overlapping" else outside.all()


@pytest.mark.parametrize("scale", [0.3, 1.0, 3.0])
def test_spacing_is_kept_and_the_surface_covered(scale: float) -> None:
    field = Formula(sphere((0, 0, 0), 0.5), (-0.5, -0.5, -0.5), (0.5, 0.5, 0.5), scale)
    cloud = scan(field, spacing=SPACING, seed=0)
    tree = cKDTree(cloud.points)
    assert tree.query(cloud.points, k=2)[0][:, 1].min() >= SPACING * (1 - 1e-5)
    everywhere = np.random.default_rng(1).normal(size=(20_000, 3))
    everywhere *= 0.5 / np.linalg.norm(everywhere, axis=1, keepdims=True)
    assert tree.query(everywhere)[0].max() < 1.5 * SPACING


def test_thin_limbs_get_closer_points() -> None:
    cloud = scan(SOLIDS["thin capsule"].field, spacing=SPACING, seed=0)
    nearest = cKDTree(cloud.points).query(cloud.points, k=2)[0][:, 1]
    assert SPACING / 4 * (1 - 1e-5) <= nearest.min() < 0.7 * SPACING


def test_a_cavity_gets_no_points() -> None:
    cloud = scan(SOLIDS["hollow sphere"].field, spacing=SPACING, seed=0)
    assert np.linalg.norm(cloud.points, axis=1).min() > 0.39


def test_a_body_is_scanned_with_its_labels_and_the_seed_decides() -> None:
    body = Body(mannequin(24))
    cloud = scan(body, spacing=0.03, seed=0)
    assert set(np.unique(cloud.part)) == set(range(1, 15))
    assert set(cloud.part[cloud.points[:, 1] > 0.75]) == {PART["head"]}
    again, other = scan(body, spacing=0.03, seed=0), scan(body, spacing=0.03, seed=1)
    assert again.points.tobytes() == cloud.points.tobytes()
    assert other.points.tobytes() != cloud.points.tobytes()


@settings(max_examples=25, deadline=None)
@given(count=st.integers(0, 60), seed=st.integers(0, 2**32 - 1), radius=st.floats(0.01, 0.6), vary=st.booleans())
def test_thinning_is_what_its_definition_says(count: int, seed: int, radius: float, vary: bool) -> None:
    random = np.random.default_rng(seed)
    points = random.random((count, 3)).astype(np.float32)
    radii = np.full(count, radius, np.float32) * (random.uniform(0.25, 1, count) if vary else 1)
    kept: list[int] = []
    for index, point in enumerate(points):
        distance = np.linalg.norm(points[kept].astype(np.float64) - point, axis=1)
        if (distance >= np.minimum(radii[kept], radii[index])).all():
            kept.append(index)
    assert thin(points, radii if vary else radius).tolist() == kept


@given(start=st.tuples(*[st.floats(-0.3, 0.3)] * 3), scale=st.floats(0.2, 5))
@settings(max_examples=50, deadline=None)
def test_newton_arrives_or_says_so_and_leaves_the_point(start: tuple[float, float, float], scale: float) -> None:
    field = Formula(sphere((0, 0, 0), 0.25), (-0.25, -0.25, -0.25), (0.25, 0.25, 0.25), scale)
    point = np.array([start], np.float32)
    moved, arrived = newton(field, point, tolerance=1e-4, reach=0.1)
    if arrived[0]:
        assert abs(np.linalg.norm(moved[0]) - 0.25) < 1.1e-4 / scale + 1e-6
        assert np.linalg.norm(moved - point) <= 0.1 + 1e-6
    else:
        assert np.array_equal(moved, point)
        assert abs(np.linalg.norm(point) - 0.25) > 0.09
