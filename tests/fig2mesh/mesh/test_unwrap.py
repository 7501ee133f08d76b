import numpy as np
import pytest
from scipy import ndimage

from fig2mesh.field.analytic import mannequin
from fig2mesh.field.body import Body
from fig2mesh.mesh.bake import drawn_faces
from fig2mesh.mesh.isosurface import isosurface
from fig2mesh.mesh.topology import edge_pairs, face_areas
from fig2mesh.mesh.unwrap import MAX_PATCH, Drawn, unwrap
from fig2mesh.records import Mesh, UvMesh

from .solids import SOLIDS, closed


def texel_areas(mesh: UvMesh) -> np.ndarray:
    """(F,) areas in the picture, whose rows go down: positive where it shows a face as viewed from outside."""
    corners = mesh.uv.astype(np.float64)[mesh.faces] * mesh.atlas_size
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return (first[:, 1] * second[:, 0] - first[:, 0] * second[:, 1]) / 2


def charts(mesh: UvMesh) -> np.ndarray:
    """(F,) chart of each face: faces that share an edge of split vertices."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    first, second = (half // 3 for half in edge_pairs(mesh.faces))
    size = len(mesh.faces)
    return connected_components(coo_array((np.ones(len(first)), (first, second)), shape=(size, size)))[1]


def painted(mesh: UvMesh, scale: int) -> tuple[np.ndarray, bool]:
    """Chart at each point of a fine raster, -1 for none; and whether two charts claim one point."""
    size = mesh.atlas_size[0] * scale
    picture, clash = np.full((size, size), -1), False
    for face, chart in zip(mesh.uv.astype(np.float64)[mesh.faces] * size, charts(mesh), strict=True):
        low = np.maximum(np.floor(face.min(axis=0)).astype(int), 0)
        high = np.minimum(np.ceil(face.max(axis=0)).astype(int) + 1, size)
        x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
        inside = np.ones_like(x, bool)
        for k in range(3):
            a, b = face[k], face[(k + 1) % 3]
            inside &= (b[1] - a[1]) * (x - a[0]) - (b[0] - a[0]) * (y - a[1]) > 1e-6
        window = picture[low[1] : high[1], low[0] : high[0]]
        clash |= bool((inside & (window >= 0) & (window != chart)).any())
        window[inside] = chart
    return picture, clash


@pytest.mark.parametrize("name", SOLIDS)
def test_every_face_has_its_place_and_none_is_mirrored(name: str) -> None:
    solid = closed(name)
    mesh = unwrap(solid, texture_size=256)
    assert np.array_equal(mesh.solid_index[mesh.faces], solid.faces)
    assert set(mesh.solid_index) == set(range(len(solid.vertices)))
    assert mesh.uv.min() >= 0
    assert mesh.uv.max() <= 1
    assert mesh.atlas_size == (256, 256)
    assert (texel_areas(mesh) > 0).all()


def test_charts_keep_apart_and_texels_are_square() -> None:
    mesh = unwrap(closed("overlapping"), texture_size=128, padding=4)
    picture, clash = painted(mesh, 2)
    assert not clash
    # Between two charts lie 4 texels, 8 points of this raster: grown by 3 each, no two of them touch.
    for chart in np.unique(picture[picture >= 0]):
        grown = ndimage.binary_dilation(picture == chart, np.ones((3, 3)), iterations=7)
        assert np.isin(picture[grown], (-1, chart)).all()
    density = texel_areas(mesh) / face_areas(mesh.solid)
    assert np.percentile(density, 95) < 1.6 * np.percentile(density, 5)
    corners = mesh.uv.astype(np.float64)[mesh.faces]
    spatial = mesh.solid.vertices.astype(np.float64)[mesh.solid.faces]
    for axis in range(2):  # an edge along u is as many texels long as one along v
        flat = np.abs(corners[:, 1, 1 - axis] - corners[:, 0, 1 - axis]) < 0.2 * np.abs(
            corners[:, 1, axis] - corners[:, 0, axis]
        )
        texels = np.linalg.norm(corners[flat, 1] - corners[flat, 0], axis=1) * 128
        lengths = np.linalg.norm(spatial[flat, 1] - spatial[flat, 0], axis=1)
        assert np.median(texels / lengths) == pytest.approx(np.sqrt(np.median(density)), rel=0.1)


def test_the_texture_is_used() -> None:
    mesh = unwrap(closed("sphere"), texture_size=512)
    assert texel_areas(mesh).sum() > 0.4 * 512**2
    assert mesh.uv.max() > 0.95


def test_a_mesh_of_several_patches() -> None:
    solid = isosurface(Body(mannequin(24)), spacing=0.02)
    assert len(solid.faces) > MAX_PATCH
    mesh = unwrap(solid, texture_size=512)
    assert np.array_equal(mesh.solid_index[mesh.faces], solid.faces)
    assert (texel_areas(mesh) >= 0).all()
    again = unwrap(solid, texture_size=512)
    assert again.uv.tobytes() == mesh.uv.tobytes()


def test_the_unit_does_not_matter() -> None:
    solid = closed("capsule")
    tiny = Mesh(solid.vertices * np.float32(2.0**-10), solid.faces)
    np.testing.assert_allclose(unwrap(tiny, texture_size=256).uv, unwrap(solid, texture_size=256).uv, atol=1e-3)


PIXELS = 300.0
"""Drawn pixels a unit of length."""


def drawn(solid: Mesh) -> Drawn:
    """The front of a solid as a drawing at (40.25, 31.5) of its picture has it."""
    pixels = solid.vertices[:, :2].astype(np.float64) * [PIXELS, -PIXELS] + [40.25, 31.5]
    return Drawn(drawn_faces(solid), pixels)


@pytest.mark.parametrize(("size", "exact"), [(1024, True), (256, False)])
def test_what_is_drawn_lies_in_the_texture_as_drawn(size: int, exact: bool) -> None:
    solid = closed("sphere")
    front = drawn(solid)
    mesh = unwrap(solid, texture_size=size, drawn=front)
    assert np.array_equal(mesh.solid_index[mesh.faces], solid.faces)
    assert (texel_areas(mesh) > 0).all()
    rows = mesh.faces[front.faces]
    texels = mesh.uv.astype(np.float64)[rows] * size
    pixels = front.pixels[mesh.solid_index[rows]]
    scale = np.ptp(texels[..., 0]) / np.ptp(pixels[..., 0])
    for chart in np.unique(charts(mesh)[front.faces]):
        here = charts(mesh)[front.faces] == chart
        shift = texels[here] - scale * pixels[here]
        assert np.ptp(shift.reshape(-1, 2), axis=0).max() < 0.01
    if exact:
        assert scale == pytest.approx(1.0, abs=1e-4)
        off = texels - pixels
        np.testing.assert_allclose(off, np.round(off), atol=0.01)
    else:
        assert 0.2 < scale < 1.0


@pytest.mark.parametrize("size", [64, 128, 512])
def test_a_drawing_larger_than_the_texture_fits_whole(size: int) -> None:
    """A long thin figure of 3,000 pixels: its area would fit sooner than its length."""
    solid = closed("capsule")
    longest = int(np.ptp(solid.vertices, axis=0).argmax())
    tall = Mesh(np.roll(solid.vertices, 1 - longest, axis=1) * np.array([1, 4, 1], np.float32), solid.faces)
    pixels = tall.vertices[:, :2].astype(np.float64)
    pixels *= 3000 / np.ptp(pixels[:, 1]) * np.array([1, -1])
    front = Drawn(drawn_faces(tall), pixels)
    mesh = unwrap(tall, texture_size=size, drawn=front)
    assert mesh.uv.min() >= 0
    assert mesh.uv.max() <= 1
    rows = mesh.faces[front.faces]
    drawn_at = front.pixels[mesh.solid_index[rows]]
    texels = mesh.uv.astype(np.float64)[rows] * size
    for axis in range(2):
        scale = np.ptp(texels[..., axis]) / np.ptp(drawn_at[..., axis])
        assert scale == pytest.approx(np.ptp(texels[..., 1]) / np.ptp(drawn_at[..., 1]), rel=0.02)
    assert not painted(mesh, 2)[1]


def test_drawn_charts_keep_apart_from_the_others() -> None:
    solid = closed("overlapping")
    mesh = unwrap(solid, texture_size=128, padding=4, drawn=drawn(solid))
    picture, clash = painted(mesh, 2)
    assert not clash
    for chart in np.unique(picture[picture >= 0]):
        # Charts move by up to half a texel each from where they were packed.
        grown = ndimage.binary_dilation(picture == chart, np.ones((3, 3)), iterations=5)
        assert np.isin(picture[grown], (-1, chart)).all()


def test_the_rest_has_no_more_texels_than_what_is_drawn() -> None:
    solid = closed("sphere")
    front = drawn(solid)
    mesh = unwrap(solid, texture_size=1024, drawn=front)
    density = np.sqrt(texel_areas(mesh) / face_areas(solid))
    assert np.median(density[~front.faces]) < 1.15 * PIXELS


def test_faces_behind_others_are_not_drawn() -> None:
    """A small ball before a large one: its shadow on the large one is not visible, nor are both backs."""
    solid = closed("sphere")
    centred = solid.vertices - solid.vertices.mean(axis=0)
    solid = Mesh(centred, solid.faces)
    small = centred * np.float32(0.3) + np.array([0, 0, 2], np.float32)
    both = Mesh(
        np.concatenate([solid.vertices, small]), np.concatenate([solid.faces, solid.faces + len(solid.vertices)])
    )
    seen = drawn_faces(both)
    middles = both.vertices[both.faces].mean(axis=1)
    radius = np.abs(solid.vertices).max()
    first = np.arange(len(both.faces)) < len(solid.faces)
    shadow = first & (np.hypot(middles[:, 0], middles[:, 1]) < 0.25 * radius)
    assert not seen[shadow].any()
    clear = first & (np.hypot(middles[:, 0], middles[:, 1]) > 0.5 * radius) & (middles[:, 2] > 0.2 * radius)
    assert seen[clear].all()
    assert not seen[first & (middles[:, 2] < -0.1 * radius)].any()
    assert seen[~first & (middles[:, 2] > 2 + 0.05 * radius)].all()


def test_nonsense_is_refused() -> None:
    with pytest.raises(ValueError, match="texture_size"):
        unwrap(closed("sphere"), texture_size=0)
    with pytest.raises(ValueError, match="no faces"):
        unwrap(Mesh(np.zeros((0, 3)), np.zeros((0, 3))), texture_size=64)
