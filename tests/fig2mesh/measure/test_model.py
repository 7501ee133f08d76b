"""Measures of solids for which the answer is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exporters.asset import Asset, Texture, TexturedMesh
from exporters.errors import ExportError
from exporters.gltf.glb import write_glb, write_gltf
from exporters.solid import measure_topology, solid_of
from fig2mesh.measure.model import (
    MAX_PSNR_DB,
    front_similarity,
    load_textured,
    shape_measures,
    silhouette_iou,
)
from fig2mesh.mesh.preview import render_mesh
from tests.fig2mesh.mesh.outlined import hulled

RADIUS, CENTRE_PX, RADIUS_PX = 0.9, (100.0, 110.0), 80.0
SCALE = RADIUS / RADIUS_PX
ORIGIN_PX = (CENTRE_PX[0], CENTRE_PX[1] + RADIUS_PX)
"""The sphere stands on the ASSET origin."""


def pattern(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(..., 3) uint8 smooth colours of a point of the front, x and y in [-1, 1], up."""
    waves = [np.sin(5 * x + 2 * y), np.cos(4 * y - x), np.sin(3 * x) * np.cos(6 * y)]
    return np.rint(127.5 + 100 * np.stack(waves, axis=-1)).astype(np.uint8)


def sphere(rings: int = 64, segments: int = 96) -> TexturedMesh:
    """A UV sphere on the ground; its texture is the front's picture, projected straight through."""
    polar, turn = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, segments, endpoint=False), indexing="ij"
    )
    ring = np.stack([np.sin(polar) * np.sin(turn), np.cos(polar), np.sin(polar) * np.cos(turn)], axis=-1)
    points = np.concatenate([[[0, 1, 0]], ring[1:-1].reshape(-1, 3), [[0, -1, 0]]])
    row, column = np.meshgrid(np.arange(rings - 2), np.arange(segments), indexing="ij")
    a = 1 + row * segments + column
    b = 1 + row * segments + (column + 1) % segments
    quads = np.concatenate([np.stack([a, a + segments, b], -1), np.stack([b, a + segments, b + segments], -1)])
    last, around = len(points) - 1, np.arange(segments)
    following = (around + 1) % segments
    caps = [
        np.stack([0 * around, 1 + around, 1 + following], -1),
        np.stack([0 * around + last, last - segments + following, last - segments + around], -1),
    ]
    faces = np.concatenate([quads.reshape(-1, 3), *caps])
    grid = (np.arange(256) + 0.5) / 128 - 1
    return TexturedMesh(
        vertices=RADIUS * (points + (0, 1, 0)),
        faces=faces,
        normals=points,
        solid_index=np.arange(len(points)),
        uv=np.clip(np.stack([(1 + points[:, 0]) / 2, (1 - points[:, 1]) / 2], axis=1), 0, 1),
        texture=Texture(pattern(*np.meshgrid(grid, -grid))),
    )


def split(mesh: TexturedMesh) -> TexturedMesh:
    """The same surface, every corner its own vertex, as along texture seams."""
    corners = mesh.faces.reshape(-1)
    assert mesh.uv is not None
    faces = np.arange(len(corners)).reshape(-1, 3)
    return TexturedMesh(mesh.vertices[corners], faces, mesh.normals[corners], corners, mesh.uv[corners], mesh.texture)


def drawing(size: tuple[int, int] = (200, 220)) -> tuple[np.ndarray, np.ndarray]:
    """RGBA and mask of the sphere as it would be drawn."""
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    x, y = (x - CENTRE_PX[0]) / RADIUS_PX, (CENTRE_PX[1] - y) / RADIUS_PX
    mask = np.hypot(x, y) <= 1
    return np.dstack([pattern(x, y), np.where(mask, 255, 0).astype(np.uint8)]), mask


@pytest.fixture(scope="module")
def ball() -> TexturedMesh:
    return sphere()


def test_sphere_covers_a_disc(ball: TexturedMesh) -> None:
    assert silhouette_iou(ball, drawing()[1], metres_per_pixel=SCALE, origin_px=ORIGIN_PX) > 0.99


def test_shifted_silhouette_has_the_overlap_of_two_discs(ball: TexturedMesh) -> None:
    shift = 40.0
    half = np.arccos(shift / (2 * RADIUS_PX))
    lens = 2 * RADIUS_PX**2 * half - shift / 2 * np.sqrt(4 * RADIUS_PX**2 - shift**2)
    expected = lens / (2 * np.pi * RADIUS_PX**2 - lens)
    origin = (ORIGIN_PX[0] + shift, ORIGIN_PX[1])
    found = silhouette_iou(ball, drawing()[1], metres_per_pixel=SCALE, origin_px=origin)
    # The chords of the polygon stay inside the circle by 0.05 %.
    assert found == pytest.approx(expected, abs=0.005)


@pytest.mark.parametrize("window", [np.s_[:, :100], np.s_[:110], np.s_[:, 100:], np.s_[110:]])
def test_what_sticks_out_of_the_picture_counts(ball: TexturedMesh, window: tuple[slice, ...]) -> None:
    mask = drawing()[1][window]
    first_row = 110 if window == np.s_[110:] else 0
    first_column = 100 if window == np.s_[:, 100:] else 0
    origin = (ORIGIN_PX[0] - first_column, ORIGIN_PX[1] - first_row)
    assert silhouette_iou(ball, mask, metres_per_pixel=SCALE, origin_px=origin) == pytest.approx(0.5, abs=0.01)


def test_model_beside_the_drawing_scores_nothing(ball: TexturedMesh) -> None:
    mask = drawing()[1]
    for origin in ((1e6, 0.0), (-1e6, 0.0), (0.0, 1e6)):
        assert silhouette_iou(ball, mask, metres_per_pixel=SCALE, origin_px=origin) == 0.0
        rgba = drawing()[0]
        assert front_similarity(ball, rgba, mask, metres_per_pixel=SCALE, origin_px=origin).ssim == 0.0
    assert silhouette_iou(ball, mask, metres_per_pixel=SCALE * 1e-6, origin_px=ORIGIN_PX) < 0.2


def test_silhouette_is_that_of_the_outline(ball: TexturedMesh) -> None:
    found = [
        silhouette_iou(mesh, drawing()[1], metres_per_pixel=SCALE, origin_px=ORIGIN_PX)
        for mesh in (ball, hulled(ball, 0.1), replace(hulled(ball, 0.1), outline=None))
    ]
    assert found[0] == found[1]
    assert found[2] == pytest.approx((0.8 / 0.9) ** 2, abs=0.01)


def test_front_with_the_drawing_on_it_is_similar(ball: TexturedMesh) -> None:
    found = front_similarity(ball, *drawing(), metres_per_pixel=SCALE, origin_px=ORIGIN_PX)
    # What remains is the rim, where half-covered pixels meet the drawing's hard edge.
    assert found.psnr_db > 30
    assert found.ssim > 0.97


def test_identical_pictures_reach_the_top(ball: TexturedMesh) -> None:
    x0, y0 = ORIGIN_PX
    bounds = (-x0 * SCALE, (y0 - 220) * SCALE, (200 - x0) * SCALE, y0 * SCALE)
    rgba = render_mesh(ball, yaw_deg=0, size=(200, 220), bounds=bounds, samples=2)
    mask = rgba[..., 3] >= 128
    found = front_similarity(ball, rgba, mask, metres_per_pixel=SCALE, origin_px=ORIGIN_PX, samples=2)
    # The border added for the windows moves sample points by a rounding error, and with them single edge samples.
    assert found.psnr_db > 50
    assert found.psnr_db <= MAX_PSNR_DB
    assert found.ssim > 0.9999


def test_worse_fronts_score_lower(ball: TexturedMesh) -> None:
    rgba, mask = drawing()
    good = front_similarity(ball, rgba, mask, metres_per_pixel=SCALE, origin_px=ORIGIN_PX)
    mirrored = front_similarity(ball, rgba[:, ::-1], mask, metres_per_pixel=SCALE, origin_px=ORIGIN_PX)
    shifted = front_similarity(ball, rgba, mask, metres_per_pixel=SCALE, origin_px=(ORIGIN_PX[0] + 4, ORIGIN_PX[1]))
    assert good.ssim > shifted.ssim > mirrored.ssim
    assert good.psnr_db > shifted.psnr_db > mirrored.psnr_db


def test_paper_around_an_opaque_drawing_does_not_count(ball: TexturedMesh) -> None:
    rgba, mask = drawing()
    scan = rgba.copy()
    scan[..., 3] = 255
    scan[~mask, :3] = (90, 60, 30)
    both = [front_similarity(ball, one, mask, metres_per_pixel=SCALE, origin_px=ORIGIN_PX) for one in (rgba, scan)]
    assert both[0] == both[1]


@pytest.mark.parametrize("size", [(1, 1), (3, 2)])
def test_pictures_smaller_than_a_window(ball: TexturedMesh, size: tuple[int, int]) -> None:
    rgba = np.full((*size, 4), 255, np.uint8)
    scale = 2 * RADIUS / size[0]
    found = front_similarity(ball, rgba, np.ones(size, np.bool_), metres_per_pixel=scale, origin_px=(0.5, size[0]))
    assert np.isfinite([found.psnr_db, found.ssim]).all()


@pytest.mark.parametrize("limit", [160, 100, 64])
def test_long_figures_are_measured_on_a_coarser_raster(
    ball: TexturedMesh, monkeypatch: pytest.MonkeyPatch, limit: int
) -> None:
    rgba, mask = drawing()
    place = {"metres_per_pixel": SCALE, "origin_px": (ORIGIN_PX[0] + 10, ORIGIN_PX[1])}
    whole = silhouette_iou(ball, mask, **place)
    monkeypatch.setattr("fig2mesh.measure.model.MAX_SIDE_PX", limit)
    # Steps of 1, 2 and 3 pixels; the overlap of discs of 27 coarse pixels' radius is counted to about a percent.
    assert silhouette_iou(ball, mask, **place) == pytest.approx(whole, abs=0.012)
    found = front_similarity(ball, rgba, mask, metres_per_pixel=SCALE, origin_px=ORIGIN_PX)
    assert found.psnr_db > 30
    assert found.ssim > 0.96


def test_drawing_may_be_a_small_part_of_its_picture(ball: TexturedMesh) -> None:
    rgba, mask = drawing()
    wide = ((300, 20), (40, 500))
    origin = (ORIGIN_PX[0] + 40, ORIGIN_PX[1] + 300)
    big, place = np.pad(mask, wide), {"metres_per_pixel": SCALE, "origin_px": origin}
    alone = {"metres_per_pixel": SCALE, "origin_px": ORIGIN_PX}
    assert silhouette_iou(ball, big, **place) == pytest.approx(silhouette_iou(ball, mask, **alone), abs=1e-3)
    found = front_similarity(ball, np.pad(rgba, (*wide, (0, 0))), big, **place)
    assert found.ssim == pytest.approx(front_similarity(ball, rgba, mask, **alone).ssim, abs=1e-3)


def test_a_line_missed_by_the_coarse_raster_is_no_error(ball: TexturedMesh, monkeypatch: pytest.MonkeyPatch) -> None:
    mask = np.ones((200, 1), np.bool_)
    monkeypatch.setattr("fig2mesh.measure.model.MAX_SIDE_PX", 50)
    place = {"metres_per_pixel": 100.0, "origin_px": (0.0, 0.0)}
    assert silhouette_iou(ball, mask, **place) == 0.0
    rgba = np.full((200, 1, 4), 255, np.uint8)
    assert front_similarity(ball, rgba, mask, **place).ssim == 0.0


def test_empty_mask_has_nothing_in_common(ball: TexturedMesh) -> None:
    rgba, mask = drawing()
    none = np.zeros_like(mask)
    assert silhouette_iou(ball, none, metres_per_pixel=SCALE, origin_px=ORIGIN_PX) == 0.0
    assert front_similarity(ball, rgba, none, metres_per_pixel=SCALE, origin_px=ORIGIN_PX).ssim == 0.0


def test_shape_of_a_split_sphere(ball: TexturedMesh) -> None:
    found = shape_measures(split(ball))
    volume = found.pop("volume_m3")
    assert found == {
        "watertight": True,
        "winding_consistent": True,
        "components": 1,
        "genus": 0,
        "triangles": len(ball.faces),
    }
    # An inscribed polyhedron of this many sides lacks a fifth of a percent.
    assert volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.003)


def test_shape_agrees_with_our_own_count(ball: TexturedMesh) -> None:
    holed = TexturedMesh(ball.vertices, ball.faces[5:], ball.normals, ball.solid_index)
    flipped_faces = ball.faces.copy()
    flipped_faces[:9] = flipped_faces[:9, ::-1]
    flipped = TexturedMesh(ball.vertices, flipped_faces, ball.normals, ball.solid_index)
    count = len(ball.vertices)
    two = TexturedMesh(
        np.concatenate([ball.vertices, ball.vertices + np.float32([3, 0, 0])]),
        np.concatenate([ball.faces, ball.faces + count]),
        np.concatenate([ball.normals, ball.normals]),
        np.arange(2 * count),
    )
    for mesh in (ball, holed, flipped, two):
        solid = solid_of(mesh)
        ours, theirs = measure_topology(mesh.vertices[solid.first], solid.faces), shape_measures(mesh)
        assert theirs["watertight"] == ours.closed
        assert theirs["winding_consistent"] == (ours.misoriented_edges == 0)
        assert theirs["components"] == ours.components
        assert theirs["genus"] == ours.genus


def test_torus_has_a_handle() -> None:
    import trimesh

    torus = trimesh.creation.torus(1.0, 0.3)
    mesh = TexturedMesh(torus.vertices, torus.faces, torus.vertex_normals, np.arange(len(torus.vertices)))
    assert shape_measures(mesh)["genus"] == 1


@pytest.mark.parametrize(("suffix", "writer"), [(".glb", write_glb), (".gltf", write_gltf)])
def test_file_holds_what_was_written(ball: TexturedMesh, tmp_path: Path, suffix: str, writer: object) -> None:
    mesh = split(ball)
    path = tmp_path / f"ball{suffix}"
    writer(Asset("ball", (mesh,)), path)  # type: ignore[operator]
    found = load_textured(path)
    np.testing.assert_array_equal(found.vertices, mesh.vertices)
    np.testing.assert_array_equal(found.faces, mesh.faces)
    # trimesh turns v twice: rounding of float32 near 1.
    np.testing.assert_allclose(found.uv, mesh.uv, atol=1e-7)
    np.testing.assert_allclose(found.normals, mesh.normals, atol=1e-6)
    assert found.texture is not None
    assert mesh.texture is not None
    np.testing.assert_array_equal(found.texture.pixels, mesh.texture.pixels)
    assert shape_measures(found) == pytest.approx(shape_measures(mesh))


def test_vertex_colours_come_back(ball: TexturedMesh, tmp_path: Path) -> None:
    colours = pattern(ball.normals[:, 0], ball.normals[:, 1])
    write_glb(
        Asset("ball", (TexturedMesh(ball.vertices, ball.faces, ball.normals, ball.solid_index, colors=colours),)),
        tmp_path / "ball.glb",
    )
    found = load_textured(tmp_path / "ball.glb").colors
    assert found is not None
    np.testing.assert_array_equal(found, colours)


def test_unreadable_files_are_named(tmp_path: Path) -> None:
    broken = tmp_path / "broken.glb"
    broken.write_bytes(b"no model")
    for path in (broken, tmp_path / "absent.glb"):
        with pytest.raises(ExportError, match=path.name):
            load_textured(path)
