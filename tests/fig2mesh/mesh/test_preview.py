"""Views of solids whose colours are known for every direction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from exporters.asset import Texture, TexturedMesh
from fig2mesh.field.camera import axes
from fig2mesh.mesh.preview import LIGHT, render_mesh, view_bounds, views_sheet, write_preview
from tests.fig2mesh.mesh.outlined import PEN, hulled

# fmt: off
FRONT, LEFT, BACK, RIGHT, TOP, BOTTOM = (
    (220, 30, 30), (30, 200, 30), (30, 30, 220), (220, 200, 30), (200, 30, 200), (30, 200, 200),
)
# fmt: on
SIDES = {
    FRONT: ((0, 0, 1), (1, 0, 0)),
    LEFT: ((1, 0, 0), (0, 0, -1)),
    BACK: ((0, 0, -1), (-1, 0, 0)),
    RIGHT: ((-1, 0, 0), (0, 0, 1)),
    TOP: ((0, 1, 0), (1, 0, 0)),
    BOTTOM: ((0, -1, 0), (1, 0, 0)),
}
"""Colour of a side, its outward normal, and its rightward axis as viewed from outside; ASSET."""


def coloured_box(size: tuple[float, float, float] = (0.6, 1.8, 0.3)) -> TexturedMesh:
    """A box on the ground, each side one texel column wide apart; the front's upper left texel is white."""
    vertices, normals, uv, faces = [], [], [], []
    pixels = np.zeros((4, 4 * len(SIDES), 3), np.uint8)
    for index, (colour, (normal, right)) in enumerate(SIDES.items()):
        pixels[:, 4 * index : 4 * index + 4] = colour
        n, r = np.array(normal, float), np.array(right, float)
        up = np.cross(n, r)
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            vertices.append((n + a * r + b * up) / 2 * size + (0, size[1] / 2, 0))
            normals.append(n)
            # Inset by half a texel, so that bilinear samples do not mix two sides.
            uv.append(((4 * index + 2 + 1.5 * a) / pixels.shape[1], (2 - 1.5 * b) / 4))
        first = 4 * index
        faces += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    pixels[0, 0] = 255
    places = np.array(vertices, np.float32)
    _, solid = np.unique(places, axis=0, return_inverse=True)
    observed = np.zeros((4, pixels.shape[1], 1), np.uint8)
    observed[:, :4] = 255
    return TexturedMesh(
        places, np.array(faces), np.array(normals), solid.reshape(-1), np.array(uv), Texture(pixels), Texture(observed)
    )


@pytest.fixture(scope="module")
def box() -> TexturedMesh:
    return coloured_box()


@pytest.mark.parametrize(
    ("yaw", "pitch", "colour"),
    [(0, 0, FRONT), (90, 0, LEFT), (180, 0, BACK), (270, 0, RIGHT), (-90, 0, RIGHT), (0, 90, TOP), (0, -90, BOTTOM)],
)
def test_each_direction_shows_its_side(box: TexturedMesh, yaw: float, pitch: float, colour: tuple[int, ...]) -> None:
    picture = render_mesh(box, yaw_deg=yaw, pitch_deg=pitch, size=(40, 60))
    # Nothing but that side: the neighbours are edge-on.
    inside = picture[picture[..., 3] == 255][:, :3]
    plain = inside[(inside < 226).all(axis=1)]
    assert len(plain) > 100
    assert np.abs(plain.astype(int) - colour).max() <= 1 or colour == FRONT
    assert tuple(picture[30, 20, :3]) == colour


def test_picture_is_upright_and_not_mirrored(box: TexturedMesh) -> None:
    picture = render_mesh(box, yaw_deg=0, size=(60, 180), bounds=(-0.3, 0.0, 0.3, 1.8))
    # Bilinear samples lie a few hundredths of a texel from the white one's centre.
    assert picture[0, 0].min() > 240
    for row, column in ((0, -1), (-1, 0), (-1, -1)):
        assert tuple(picture[row, column]) == (*FRONT, 255)


def test_right_half_of_a_turned_box_is_its_left(box: TexturedMesh) -> None:
    picture = render_mesh(box, yaw_deg=45, size=(90, 180), background=(0, 0, 0))
    assert tuple(picture[90, 30, :3]) == FRONT
    assert tuple(picture[90, 70, :3]) == LEFT


def test_axes_are_a_rotation_for_any_angle() -> None:
    for yaw, pitch in np.random.default_rng(0).uniform(-180, 180, (20, 2)):
        rotation = axes(yaw, pitch)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_coverage_is_the_area_inside_a_pixel(box: TexturedMesh) -> None:
    # Bounds put the box's edges at a quarter of the outer pixels.
    picture = render_mesh(box, yaw_deg=0, size=(8, 1), bounds=(-0.35, 0.5, 0.35, 0.6), samples=8)
    pixel = 0.7 / 8
    expected = 1 - (0.35 - 0.3) / pixel
    assert picture[0, 0, 3] / 255 == pytest.approx(expected, abs=1 / 16)
    assert (picture[0, 1:-1, 3] == 255).all()
    # Colour of a partly covered pixel is straight, not darkened by its transparency.
    assert tuple(picture[0, 0, :3]) == FRONT


def test_background_is_blended(box: TexturedMesh) -> None:
    picture = render_mesh(box, yaw_deg=0, size=(40, 60), background=(10, 20, 30))
    assert (picture[..., 3] == 255).all()
    assert tuple(picture[0, 0, :3]) == (10, 20, 30)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e5])
def test_views_do_not_depend_on_the_size_of_the_figure(box: TexturedMesh, scale: float) -> None:
    small = TexturedMesh(box.vertices * scale, box.faces, box.normals, box.solid_index, box.uv, box.texture)
    both = [render_mesh(mesh, yaw_deg=30, size=(48, 64)) for mesh in (box, small)]
    # Rounding of float32 vertices may move an edge over a sample point.
    assert (both[0] != both[1]).any(axis=2).mean() < 0.01


def test_bands_join_without_seam(box: TexturedMesh, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = render_mesh(box, yaw_deg=20, size=(30, 50))
    monkeypatch.setattr("fig2mesh.mesh.preview.RAYS_AT_ONCE", 30 * 4 * 7)
    np.testing.assert_array_equal(render_mesh(box, yaw_deg=20, size=(30, 50)), whole)


def test_modes(box: TexturedMesh) -> None:
    front = {
        mode: render_mesh(box, yaw_deg=0, size=(40, 60), mode=mode)[30, 20, :3].astype(int)
        for mode in ("clay", "normals", "observed")
    }
    np.testing.assert_array_equal(front["normals"], [128, 128, 255])
    red, green, blue = front["clay"]
    assert red > green > blue > 120
    # The drawing showed the front and nothing else.
    assert front["observed"][1] > front["observed"][0]
    back = render_mesh(box, yaw_deg=180, size=(40, 60), mode="observed")[30, 20].astype(int)
    assert back[0] > back[1]


def test_untextured_mesh_shows_vertex_colours_then_clay(box: TexturedMesh) -> None:
    colours = np.full((len(box.vertices), 3), (12, 34, 56), np.uint8)
    painted = TexturedMesh(box.vertices, box.faces, box.normals, box.solid_index, colors=colours)
    assert tuple(render_mesh(painted, yaw_deg=0, size=(20, 30))[15, 10, :3]) == (12, 34, 56)
    bare = TexturedMesh(box.vertices, box.faces, box.normals, box.solid_index)
    textured, clay = (render_mesh(bare, yaw_deg=0, size=(20, 30), mode=mode) for mode in ("textured", "clay"))
    np.testing.assert_array_equal(textured, clay)


def test_sheet_stands_drawing_and_views_on_one_line(box: TexturedMesh) -> None:
    drawing = np.zeros((100, 80, 4), np.uint8)
    drawing[20:80, 30:50] = (*FRONT, 255)
    sheet = views_sheet(box, drawing, yaws=(0, 90, 180), height=200).astype(int)
    assert sheet.shape[0] == 200
    filled = np.abs(sheet - LIGHT).sum(axis=2) > 100
    starts = np.flatnonzero(np.diff(filled.any(axis=0).astype(int)) == 1) + 1
    ends = np.flatnonzero(np.diff(filled.any(axis=0).astype(int)) == -1) + 1
    assert len(starts) == 4
    tops = [np.flatnonzero(filled[:, start + 16])[[0, -1]] for start in starts]
    # One pixel of antialiasing.
    assert np.ptp(np.array(tops), axis=0).max() <= 1
    # All widths follow from the height: 0.6 and 0.3 by 1.8 m; the drawn figure is 20 by 60 pixels.
    inner = tops[1][1] - tops[1][0] + 1
    np.testing.assert_allclose(ends - starts, np.array([1 / 3, 1 / 3, 1 / 6, 1 / 3]) * inner, atol=2)


def test_sheet_of_several_meshes_has_rows(box: TexturedMesh) -> None:
    sheet = views_sheet([box, coloured_box((1.0, 1.0, 1.0))], yaws=(0,), clay_yaws=(90,), height=80)
    assert sheet.shape[0] == 160


def test_preview_is_written_whole(box: TexturedMesh, tmp_path: Path) -> None:
    write_preview(box, tmp_path / "box.png", height=90)
    assert [path.name for path in tmp_path.iterdir()] == ["box.png"]
    with Image.open(tmp_path / "box.png") as image:
        assert image.height == 90
    with pytest.raises(OSError, match="absent"):
        write_preview(box, tmp_path / "absent" / "box.png", height=90)


def test_bounds_of_views(box: TexturedMesh) -> None:
    np.testing.assert_allclose(view_bounds(box, 0), (-0.3, 0.0, 0.3, 1.8), atol=1e-7)
    np.testing.assert_allclose(view_bounds(box, 90), (-0.15, 0.0, 0.15, 1.8), atol=1e-7)


@pytest.mark.parametrize(
    ("yaw", "pitch", "colour"),
    [(0, 0, FRONT), (90, 0, LEFT), (180, 0, BACK), (270, 0, RIGHT), (0, 90, TOP), (0, -90, BOTTOM)],
)
def test_hull_shows_a_line_of_its_width_from_every_side(
    box: TexturedMesh, yaw: float, pitch: float, colour: tuple[int, ...]
) -> None:
    inset = 0.05
    left, bottom, right, top = view_bounds(box, yaw, pitch)
    size = round((right - left) * 100), round((top - bottom) * 100)
    picture = render_mesh(
        hulled(box, inset), yaw_deg=yaw, pitch_deg=pitch, size=size, bounds=(left, bottom, right, top), samples=1
    )
    inked = (picture[..., :3] == PEN).all(axis=2)
    rim = np.ones_like(inked)
    rim[5:-5, 5:-5] = False
    assert (picture[..., 3] == 255).all()
    np.testing.assert_array_equal(inked, rim)
    assert tuple(picture[size[1] // 2, size[0] // 2, :3]) == colour


def test_outline_of_two_sides_hides_what_is_behind_it(box: TexturedMesh) -> None:
    picture = render_mesh(hulled(box, 0.05, culled=False), yaw_deg=30, size=(40, 60), background=PEN)
    assert (picture[..., :3] == PEN).all()


def test_other_modes_show_the_surface_as_drawn(box: TexturedMesh) -> None:
    for mode in ("clay", "normals", "observed"):
        drawn, hull = (render_mesh(mesh, yaw_deg=20, size=(40, 60), mode=mode) for mesh in (box, hulled(box, 0.05)))
        np.testing.assert_array_equal(drawn, hull)


def test_silhouette_and_bounds_are_those_of_the_outline(box: TexturedMesh) -> None:
    hull = hulled(box, 0.05)
    np.testing.assert_allclose(view_bounds(hull, 35, 10), view_bounds(box, 35, 10))
    drawn, outlined = (render_mesh(mesh, yaw_deg=35, size=(60, 90))[..., 3] for mesh in (box, hull))
    np.testing.assert_array_equal(drawn, outlined)
    sheet = views_sheet(hull, yaws=(0, 90), clay_yaws=(0,), height=80)
    assert (sheet == PEN).all(axis=2).any()
