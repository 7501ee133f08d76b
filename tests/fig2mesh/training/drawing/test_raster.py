"""The NumPy rasteriser against formulas, and against the compiled one."""

from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.mesh.raster_kernel import rasterise_triangles
from fig2mesh.training.drawing import raster
from fig2mesh.training.drawing.raster import coverage, rasterise


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def ball(rings: int = 40, radius: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A sphere, counter-clockwise from outside."""
    theta = np.linspace(0, np.pi, rings + 1)
    phi = np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    vertices = radius * np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(rings), np.arange(2 * rings), indexing="ij")
    a, b = i * 2 * rings + j, i * 2 * rings + (j + 1) % (2 * rings)
    c, d = a + 2 * rings, b + 2 * rings
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([b, d, c], -1).reshape(-1, 3)])
    return vertices, faces


def test_a_sphere_is_seen_where_its_formula_says() -> None:
    vertices, faces = ball(80)
    size, low, pitch = 96, (-1.2, -1.2), 2.4 / 96
    seen = rasterise(vertices, faces, size=size, low=low, pitch=pitch)
    x = low[0] + (np.arange(size) + 0.5) * pitch
    y = low[1] + size * pitch - (np.arange(size) + 0.5) * pitch
    radius = np.hypot(*np.meshgrid(x, y))
    assert seen.mask[radius < 0.995].all()
    assert not seen.mask[radius > 1.0].any()
    inner = radius < 0.9
    # The polyhedron lies at most 1 - cos(step / 2) below the sphere; its slope magnifies that towards the rim.
    np.testing.assert_allclose(seen.depth[inner], np.sqrt(1 - radius[inner] ** 2), atol=3e-3)
    assert np.isneginf(seen.depth[~seen.mask]).all()
    where = seen.blend(vertices, faces)
    np.testing.assert_allclose(where[..., 0][seen.mask], np.broadcast_to(x, (size, size))[seen.mask], atol=1e-6)
    np.testing.assert_allclose(
        where[..., 1][seen.mask], np.broadcast_to(y[:, None], (size, size))[seen.mask], atol=1e-6
    )
    np.testing.assert_allclose(where[..., 2][seen.mask], seen.depth[seen.mask], atol=1e-6)
    np.testing.assert_allclose(seen.bary[seen.mask].sum(axis=1), 1, atol=1e-6)


@pytest.mark.parametrize("shape", ["ball", "soup"])
def test_covers_the_pixels_of_the_compiled_rasteriser(shape: str, rng: np.random.Generator) -> None:
    vertices, faces = ball() if shape == "ball" else (rng.uniform(-2, 2, (90, 3)), np.arange(90).reshape(-1, 3))
    size, low, pitch = 64, np.array([-1.1, -1.3]), 2.4 / 64
    corners = np.stack([(vertices[:, 0] - low[0]) / pitch, size - (vertices[:, 1] - low[1]) / pitch], axis=1)
    owner = np.full((size, size), -1, np.int32)
    rasterise_triangles(corners, faces.astype(np.int32), owner, np.zeros((size, size, 3), np.float32))
    np.testing.assert_array_equal(coverage(vertices, faces, size=size, low=low, pitch=pitch), owner >= 0)
    np.testing.assert_array_equal(rasterise(vertices, faces, size=size, low=low, pitch=pitch).mask, owner >= 0)


def test_depth_is_the_largest_of_all_faces(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, faces = rng.uniform(0, 1, (120, 3)), np.arange(120).reshape(-1, 3)
    frame = {"size": 32, "low": (0, 0), "pitch": 1 / 32}
    whole = rasterise(vertices, faces, **frame)
    each = np.stack([rasterise(vertices, face[None], **frame).depth for face in faces])
    np.testing.assert_array_equal(whole.depth, each.max(axis=0))
    np.testing.assert_array_equal(whole.face[whole.mask], each.argmax(axis=0)[whole.mask])
    monkeypatch.setattr(raster, "AT_ONCE", 500)
    for got, expected in zip(rasterise(vertices, faces, **frame), whole, strict=True):
        np.testing.assert_array_equal(got, expected)


def test_rows_run_down_and_columns_right() -> None:
    corner = np.array([[0.8, 0.8, 0], [1.0, 0.8, 0], [1.0, 1.0, 0], [0.8, 1.0, 0]])  # upper right
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    mask = coverage(corner, faces, size=10, low=(0, 0), pitch=0.1)
    expected = np.zeros((10, 10), bool)
    expected[:2, 8:] = True
    np.testing.assert_array_equal(mask, expected)


def test_a_closed_surface_looks_the_same_without_its_far_side() -> None:
    vertices, faces = ball()
    frame = {"size": 50, "low": (-1.1, -1.1), "pitch": 0.044}
    both, near = rasterise(vertices, faces, **frame), rasterise(vertices, faces, cull=True, **frame)
    np.testing.assert_array_equal(both.face[both.depth > 0.05], near.face[both.depth > 0.05])
    np.testing.assert_array_equal(coverage(vertices, faces, cull=True, **frame), both.mask)


def test_what_lies_outside_or_edge_on_is_not_seen() -> None:
    edge_on = np.array([[0.2, 0, 0], [0.2, 1, 0], [0.2, 0.5, 1.0]])
    outside = np.array([[5, 5, 0], [6, 5, 0], [5, 6, 0.0]])
    for vertices in (edge_on, outside):
        seen = rasterise(vertices, np.array([[0, 1, 2]]), size=8, low=(0, 0), pitch=0.125)
        assert not seen.mask.any()
    assert not coverage(edge_on, np.zeros((0, 3), int), size=8, low=(0, 0), pitch=0.125).any()
