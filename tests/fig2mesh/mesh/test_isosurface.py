import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fig2mesh.field.analytic import capsule, sample, sphere
from fig2mesh.field.body import Body
from fig2mesh.mesh.grid import sample_grid
from fig2mesh.mesh.isosurface import isosurface
from fig2mesh.mesh.tetrahedra import tetrahedra
from fig2mesh.mesh.topology import check_solid
from fig2mesh.records import Mesh

from .solids import SOLIDS, SPACING, Formula, assert_solid


@pytest.mark.parametrize("name", SOLIDS)
def test_the_isosurface_is_the_solid(name: str) -> None:
    solid = SOLIDS[name]
    mesh = isosurface(solid.field, spacing=SPACING)
    assert_solid(mesh, solid.components, solid.genus)
    if name != "thin capsule":
        assert np.percentile(np.abs(solid.field.distance(mesh.vertices)), 99) < 2e-3 * SPACING
        if solid.volume is not None:
            assert check_solid(mesh).volume == pytest.approx(solid.volume, rel=0.01)


@pytest.mark.parametrize("radius", [0.3, 0.5, 0.75, 1.0])
def test_limbs_thinner_than_a_cell_stay_whole(radius: float) -> None:
    radius *= SPACING
    field = Formula(
        capsule((0, 0, 0), (0.3, 0.6, 0.1), radius), (-radius,) * 3, (0.3 + radius, 0.6 + radius, 0.1 + radius)
    )
    assert_solid(isosurface(field, spacing=SPACING))


@pytest.mark.parametrize("scale", [0.2, 4.0])
def test_a_field_that_is_no_distance_gives_the_same_surface(scale: float) -> None:
    true = SOLIDS["overlapping"].field
    mesh = isosurface(Formula(true.function, true.low, true.high, scale), spacing=SPACING)
    assert_solid(mesh)
    assert check_solid(mesh).volume == pytest.approx(check_solid(isosurface(true, spacing=SPACING)).volume, rel=1e-3)


def test_blocks_left_out_hold_no_surface() -> None:
    field = SOLIDS["overlapping"].field
    grid = sample_grid(field, SPACING)
    nodes = np.stack(np.meshgrid(*(np.arange(n) for n in grid.values.shape), indexing="ij"), axis=-1)
    dense = field.distance((nodes * grid.spacing + grid.origin).reshape(-1, 3)).reshape(grid.values.shape)
    assert np.array_equal(dense < -1e-3 * SPACING, (grid.values < 0) & (dense < -1e-3 * SPACING))
    assert not ((dense > 1e-3 * SPACING) & (grid.values < 0)).any()
    assert grid.known.mean() < 0.6


def test_a_part_that_is_negative_at_its_cube_ends_there() -> None:
    body = Body((sample(capsule((0, 0, 0), (0, 1, 0), 0.2), 1, (0, 0.2, 0), 0.6, 32),))
    mesh = isosurface(body, spacing=SPACING)
    assert_solid(mesh)
    assert mesh.vertices[:, 1].max() == pytest.approx(0.5, abs=SPACING)


def test_a_body_without_inside_gives_no_triangles() -> None:
    assert len(isosurface(Formula(sphere((0, 0, 0), -0.1), (-1, -1, -1), (1, 1, 1)), spacing=0.2).faces) == 0


def test_a_mistaken_unit_is_refused() -> None:
    with pytest.raises(ValueError, match="spacing"):
        isosurface(SOLIDS["sphere"].field, spacing=1e-6)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(3, 9))
def test_tetrahedra_make_a_manifold_of_anything(seed: int, size: int) -> None:
    values = np.random.default_rng(seed).normal(size=(size, size + 1, size)).astype(np.float32)
    values[[0, -1]] = values[:, [0, -1]] = values[:, :, [0, -1]] = 1
    report = check_solid(Mesh(*tetrahedra(values)))
    if (values < 0).any():
        assert report.closed
        assert report.oriented
        assert report.manifold
        assert report.volume > 0


def test_tetrahedra_know_the_volume() -> None:
    axis = np.arange(20.0)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    values = np.linalg.norm(grid - [9.3, 9.1, 9.7], axis=-1) - 6.1
    mesh = Mesh(*tetrahedra(values.astype(np.float32)))
    assert_solid(mesh)
    assert check_solid(mesh).volume == pytest.approx(4 / 3 * np.pi * 6.1**3, rel=0.02)
