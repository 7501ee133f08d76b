"""Pictures of solids whose light, shade and size are known by formula."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from skimage.metrics import structural_similarity

from exporters.colour import linear_from_srgb, srgb_from_linear
from fig2mesh.field.body import Body
from fig2mesh.field.camera import axes
from fig2mesh.parts.smooth_union import smooth_union
from fig2mesh.render.effects import Effect
from fig2mesh.render.needs import Needs
from fig2mesh.render.outline import ink_cover
from fig2mesh.render.picture import AO_REACH, PictureRequest, render, view_of
from fig2mesh.render.scene import FieldScene, MeshScene
from fig2mesh.render.shading import (
    AMBIENT,
    CLAY,
    FILL,
    KEY,
    fill_direction,
    hemisphere,
    key_direction,
    lit,
)
from fig2mesh.skeleton import PART_COLOURS
from tests.drawn import Sketch, assemble
from tests.fig2mesh.mesh.outlined import PEN, hulled
from tests.fig2mesh.render.scenes import (
    DRAWN,
    HEAD,
    PLAIN,
    TORSO,
    ball,
    balls,
    balls_mesh,
    balls_scene,
    mannequin_body,
    mesh_of,
    solid,
)

SIDE = 160
INK = (10, 20, 30)


def ball_normals(request: PictureRequest, scene: FieldScene, radius: float) -> NDArray[np.float64]:
    """(H, W, 3) normals of a ball about the origin in an orthographic picture; NaN outside of it."""
    pixel = view_of(scene, request).camera.height / request.size[1]
    offset = (np.arange(SIDE) + 0.5 - SIDE / 2) * pixel / radius
    right, up = offset[None, :], -offset[:, None]
    with np.errstate(invalid="ignore"):
        back = np.sqrt(1 - right**2 - up**2)
    flat = np.stack([right + 0 * up, up + 0 * right, back], axis=-1)
    return np.asarray(flat @ axes(request.yaw_deg, request.pitch_deg))


@pytest.mark.parametrize(("yaw", "pitch"), [(0.0, 0.0), (70.0, 25.0)])
def test_ball_in_a_known_light_is_lambert(yaw: float, pitch: float) -> None:
    scene, request = ball(), PictureRequest("clay", frozenset(["light"]), (SIDE, SIDE), yaw, pitch)
    normals = ball_normals(request, scene, 0.5)
    lamp, fill = key_direction(yaw), fill_direction(yaw)
    light = AMBIENT + FILL * (0.5 + 0.5 * normals @ fill) + KEY * np.maximum(normals @ lamp, 0)
    linear = np.minimum(linear_from_srgb(np.array(CLAY) / 255) * light[..., None], 1)
    picture = render(scene, request).rgba
    inside = (picture[..., 3] == 255) & (normals @ axes(yaw, pitch)[2] > 0.15)
    assert inside.sum() > 5000
    # The grid of 96 nodes knows a ball's normal to a third of a degree.
    assert np.abs(picture[inside][:, :3] - 255 * srgb_from_linear(linear[inside])).max() <= 2.0


def test_lamp_stays_at_the_viewers_upper_left() -> None:
    """Seen from any yaw the same picture: the lamp comes along."""
    pictures = [
        render(ball(), PictureRequest("clay", frozenset(["light"]), (64, 64), yaw)).rgba.astype(int) for yaw in (0, 130)
    ]
    assert np.abs(pictures[0] - pictures[1]).max() <= 6
    rows, columns = np.nonzero(pictures[0][..., 0] == pictures[0][..., 0].max())
    assert rows.mean() < 32
    assert columns.mean() < 32


def test_light_is_added_linearly() -> None:
    """Half of the light is sRGB 188 on white, not 128."""
    assert lit(np.full((1, 3), 255.0), np.array([0.5]))[0, 0] == pytest.approx(187.5, abs=0.1)
    colours = np.arange(0.0, 255.5, 0.5)
    assert np.allclose(255 * srgb_from_linear(linear_from_srgb(colours / 255)), colours, atol=1e-4)


def test_shadow_of_a_ball_lies_where_geometry_predicts() -> None:
    """Seen from straight above: a point of the ground is dark where a ray towards the sun meets the ball."""
    scene, radius = ball(0.2), 0.2
    sun = np.array([0.35, 0.9, 0.2])
    sun /= np.linalg.norm(sun)
    request = PictureRequest(
        "clay", frozenset(["sun", "shadow"]), (SIDE, SIDE), pitch_deg=90.0, ground=True, sun=tuple(sun.tolist())
    )
    picture = render(scene, request).rgba
    pixel = view_of(scene, request).camera.height / SIDE
    x = (np.arange(SIDE) + 0.5 - SIDE / 2) * pixel
    points = np.stack([x[None, :] + 0 * x[:, None], np.full((SIDE, SIDE), -radius), x[:, None] + 0 * x[None, :]], -1)
    along = points @ sun
    miss = np.sqrt((points**2).sum(-1) - along**2)
    beside = np.hypot(points[..., 0], points[..., 2])
    on_ground = (picture[..., 3] == 255) & (beside > radius + 2 * pixel)
    dark = picture[..., 0] < 190
    sure = on_ground & (np.abs(miss - radius) > 1.5 * pixel)
    assert (dark & sure).sum() > 100
    assert (dark[sure] == (miss < radius)[sure]).all()


def test_ambient_occlusion_of_a_plane_is_one_and_of_a_corner_a_half() -> None:
    """A stair: a right angle between tread and riser, both far larger than the reach."""

    def stair(points: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y, z = points.T
        behind, below = np.maximum(z, y - 0.9), np.maximum(y + 0.5, z - 0.9)
        return np.maximum(np.minimum(behind, below), np.abs(x) - 0.9)

    scene = solid(stair, 2.0, 81)
    # The tread is z > 0, y = -0.5. Seen from above each row of pixels has one distance from the corner.
    size = (120, 120)
    request = PictureRequest("clay", frozenset(["ao"]), size, pitch_deg=90.0)
    bare, shaded = (render(scene, replace(request, effects=effects)).rgba for effects in (frozenset(), request.effects))
    lit_by, unshaded = linear_from_srgb(shaded[..., 0] / 255), linear_from_srgb(bare[..., 0] / 255)
    openness = lit_by / np.maximum(unshaded, 1e-9)
    pixel = view_of(scene, request).camera.height / size[1]
    z = (np.arange(size[1]) + 0.5 - size[1] / 2) * pixel + scene.bounds.mean(axis=0)[2]
    reach = AO_REACH * (scene.bounds[1, 1] - scene.bounds[0, 1])
    # The riser takes the directions that get to it within the reach: all of one half in the corner, none further off.
    towards = np.maximum(-hemisphere(np.array([[0.0, 1.0, 0.0]]), 50_000, np.zeros(1))[0, :, 2], 1e-9)
    # Within a cell of the corner the grid's own normals turn from one face to the other.
    tread = (z > 0.03) & (z < 0.85)
    expected = np.array([1 - (at / towards < reach).mean() for at in z[tread]])
    assert expected.min() < 0.55
    assert (expected == 1.0).sum() > 10
    assert np.abs(openness[tread, 45:75].mean(axis=1) - expected).max() < 0.05


def test_hemisphere_is_cosine_weighted() -> None:
    """The mean of n·d over Lambert's distribution is 2/3, and of the directions 2/3 n."""
    normals = np.random.default_rng(0).normal(size=(50, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    directions = hemisphere(normals, 4096, np.linspace(0, 1, 50))
    assert np.allclose(np.linalg.norm(directions, axis=2), 1)
    assert np.allclose(directions.mean(axis=1), normals * 2 / 3, atol=2e-3)
    assert (np.einsum("nkd,nd->nk", directions, normals) > 0).all()


def test_depth_of_a_ball_is_its_formula() -> None:
    scene, request = ball(), PictureRequest("depth", size=(SIDE, SIDE), yaw_deg=40.0)
    view = view_of(scene, request)
    picture = render(scene, request).rgba
    towards = 0.5 * (ball_normals(request, scene, 0.5) @ axes(40.0)[2])
    expected = 255 * (view.far - (view.camera.distance - towards)) / (view.far - view.near)
    inside = picture[..., 3] == 255
    assert np.isnan(expected[~inside]).sum() > 0.95 * (~inside).sum()
    good = inside & np.isfinite(expected)
    assert np.abs(picture[good][:, 0] - expected[good]).max() <= 1.0
    assert (picture[..., 0] == picture[..., 1]).all()


def test_silhouette_is_orthographic_or_perspective_by_its_law() -> None:
    """A ball of radius r at distance d looks like a disc of r, or of r / sqrt(1 - r²/d²) in the plane of its middle."""
    for effects in (frozenset(), frozenset(["perspective"])):
        scene, request = ball(), PictureRequest("depth", effects, (400, 400))
        view = view_of(scene, request)
        area = (render(scene, request).rgba[..., 3] == 255).sum() * (view.camera.height / 400) ** 2
        radius = 0.5 / np.sqrt(1 - (0.5 / view.camera.distance) ** 2) if effects else 0.5
        assert np.sqrt(area / np.pi) == pytest.approx(radius, rel=2e-3)


@pytest.mark.parametrize("nearby", [False, True])
@pytest.mark.parametrize("pitch", [-60.0, 0.0, 35.0, 90.0])
def test_nothing_leaves_the_picture_in_a_turn(nearby: bool, pitch: float) -> None:
    scene = FieldScene(mannequin_body())
    effects = frozenset(["perspective"]) if nearby else frozenset()
    for yaw in (0.0, 60.0, 135.0):
        alpha = render(scene, PictureRequest("depth", effects, (60, 80), yaw, pitch, ground=True)).rgba[..., 3]
        border = np.concatenate([alpha[0], alpha[-1], alpha[:, 0], alpha[:, -1]])
        assert not border.any()
        assert alpha.any()


def test_outline_lies_on_the_silhouette_and_nowhere_else() -> None:
    scene = ball()
    request = PictureRequest(
        "clay", frozenset(["outline"]), (SIDE, SIDE), samples=2, outline_px=3.0, outline_colour=INK
    )
    picture = render(scene, request).rgba
    pixel = view_of(scene, request).camera.height / SIDE
    x = (np.arange(SIDE) + 0.5 - SIDE / 2) * pixel
    off = (np.hypot(x[None, :], x[:, None]) - 0.5) / pixel
    inked = (picture[..., 3] == 255) & (np.abs(picture[..., :3].astype(int) - INK).max(axis=-1) <= 2)
    assert inked[np.abs(off) < 0.5].all()
    touched = render(scene, replace(request, effects=frozenset())).rgba != picture
    assert not touched.any(axis=-1)[np.abs(off) > 3.0].any()
    # As much ink as a ring of that width.
    assert inked.sum() * pixel == pytest.approx(3.0 * np.pi, rel=0.35)


def test_outline_follows_steps_and_creases_but_no_bend() -> None:
    """A step in depth, a right angle, and a slope as steep as either, on 20 x 20 pixels."""
    kinds = np.ones((20, 20), np.int16)
    columns = np.broadcast_to(np.arange(20.0), (20, 20))
    flat = np.zeros((20, 20, 3)) + (0, 0, 1)
    step = np.stack([columns, 0 * columns, np.where(columns < 10, 0.0, 8.0)], axis=-1)
    assert inked_columns(ink_cover(kinds, step, flat, 1.0, 100.0, 2.0)) == [9, 10]
    roof = np.stack([columns, 0 * columns, -np.abs(columns - 9.5)], axis=-1)
    turned = np.where(columns[..., None] < 9.5, (-1.0, 0.0, 1.0), (1.0, 0.0, 1.0)) / np.sqrt(2)
    assert inked_columns(ink_cover(kinds, roof, turned, 1.0, 100.0, 2.0)) == [9, 10]
    slope = np.stack([columns, 0 * columns, 8 * columns], axis=-1)
    tilted = np.zeros((20, 20, 3)) + np.array([-8, 0, 1]) / np.sqrt(65)
    assert inked_columns(ink_cover(kinds, slope, tilted, 1.0, 100.0, 2.0)) == []


def inked_columns(cover: NDArray[np.float64]) -> list[int]:
    assert (cover == cover[:1]).all()
    return np.flatnonzero(cover[0]).tolist()


def test_bands_make_the_same_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    request = PictureRequest(
        "parts", frozenset(["light", "shadow", "ao"]), (60, 80), pitch_deg=20.0, samples=2, ground=True
    )
    whole = render(balls_scene(), request)
    monkeypatch.setattr("fig2mesh.render.picture.RAYS_AT_ONCE", 2000)
    bands = render(balls_scene(), request)
    assert (whole.rgba == bands.rgba).all()
    assert whole.counts == bands.counts


def test_same_request_gives_same_bytes() -> None:
    request = PictureRequest(
        "textured", frozenset(["light", "shadow", "ao", "outline", "blend"]), (60, 80), 30.0, samples=2
    )
    assert render(balls_scene(), request).rgba.tobytes() == render(balls_scene(), request).rgba.tobytes()


def test_fields_take_the_drawing_in_front_and_their_parts_colour_behind() -> None:
    scene = balls_scene()
    front, back = (render(scene, PictureRequest("textured", size=(60, 80), yaw_deg=yaw)).rgba for yaw in (0.0, 180.0))
    seen = front[..., 3] == 255
    drawn = (front[..., :3] == np.uint8(DRAWN)).all(axis=-1)
    assert drawn[seen].mean() > 0.95
    colours = {tuple(c) for c in back[back[..., 3] == 255][:, :3].tolist()}
    assert colours == {tuple(int(v) for v in PLAIN[part]) for part in (TORSO, HEAD)}


def test_blend_is_smooth_where_the_hard_border_jumps() -> None:
    scene = balls_scene()
    hard, soft = (
        render(scene, PictureRequest("textured", effects, (200, 240), yaw_deg=90.0)).rgba.astype(int)
        for effects in (frozenset(), frozenset(["blend"]))
    )
    row = 150
    inside = hard[row, :, 3] == 255
    jump_hard, jump_soft = (np.abs(np.diff(picture[row, inside, :3], axis=0)).max() for picture in (hard, soft))
    assert jump_hard > 150
    assert jump_soft < 12
    # What faces the drawing's viewer, and what is turned away from it, keep their colours.
    front = render(scene, PictureRequest("textured", frozenset(["blend"]), (200, 240))).rgba
    assert tuple(front[row, 100, :3]) == tuple(int(v) for v in DRAWN)


@pytest.mark.parametrize("mode", ["depth", "parts", "clay", "normals"])
def test_fields_and_their_mesh_look_alike(mode: str) -> None:
    body = mannequin_body()
    effects = frozenset(["light", "shadow", "ao"]) if mode == "clay" else frozenset()
    request = PictureRequest(mode, effects, (150, 200), 35.0, 10.0, samples=2, ground=True)  # type: ignore[arg-type]
    first, second = (render(scene, request).rgba for scene in (FieldScene(body), MeshScene(mesh_of(body, 0.008))))
    alpha = [picture[..., 3] >= 128 for picture in (first, second)]
    assert (alpha[0] & alpha[1]).sum() / (alpha[0] | alpha[1]).sum() > 0.99
    assert structural_similarity(first, second, channel_axis=2) > 0.98


def test_mesh_of_any_size_makes_the_same_picture() -> None:
    mesh = balls_mesh()
    request = PictureRequest("clay", frozenset(["light", "shadow", "ao"]), (60, 80), pitch_deg=20.0, ground=True)
    small, large = (
        render(MeshScene(replace(mesh, vertices=mesh.vertices * scale)), request).rgba.astype(int)
        for scale in (1e-3, 1e4)
    )
    assert (np.abs(small - large).max(axis=-1) > 2).mean() < 0.01


def test_parts_have_their_colours() -> None:
    for scene in (balls_scene(), MeshScene(balls_mesh())):
        picture = render(scene, PictureRequest("parts", size=(60, 80))).rgba
        colours = {tuple(c) for c in picture[picture[..., 3] == 255][:, :3].tolist()}
        assert colours == {PART_COLOURS[TORSO], PART_COLOURS[HEAD]}


def test_background_is_behind_and_transparent_unless_asked_for() -> None:
    bare, paper = (render(ball(), PictureRequest("clay", size=(64, 64), background=c)).rgba for c in (None, (9, 8, 7)))
    outside = bare[..., 3] == 0
    assert outside.any()
    assert (paper[outside] == (9, 8, 7, 255)).all()
    assert (paper[..., 3] == 255).all()


def test_smooth_union_rounds_creases_and_leaves_the_rest() -> None:
    body = balls()
    round_ = smooth_union(body)
    assert len(round_.fillets) == 1
    # The ring where the balls cross lies inside of the smooth union now; far from it nothing has changed.
    scene = FieldScene(body)
    camera = view_of(scene, PictureRequest("depth", size=(120, 160))).camera
    hits = [s.meet(camera, (0, 160), Needs(normals=True))[0] for s in (scene, FieldScene(round_))]
    both = np.isfinite(hits[0].depth) & np.isfinite(hits[1].depth)
    gain = hits[0].depth[both] - hits[1].depth[both]
    assert gain.min() > -1e-3
    assert gain.max() > 0.01
    assert (np.abs(gain) < 1e-4).mean() > 0.8


def test_smooth_union_does_not_swell_limbs_that_share_a_surface() -> None:
    """One ball cut in two halves that overlap: a plain smooth minimum would leave a ring around it."""
    whole = ball(0.4).body.parts[0]
    y = np.linspace(-whole.edge / 2, whole.edge / 2, whole.grid.shape[0], dtype=np.float32)[None, :, None]
    halves = Body(
        (
            replace(whole, grid=np.maximum(whole.grid, y - 0.05)),
            replace(whole, part=HEAD, grid=np.maximum(whole.grid, -0.05 - y)),
        )
    )
    assert not smooth_union(halves).fillets


def test_smooth_union_keeps_the_drawn_contour() -> None:
    joints = {"r_elbow": (95.0, 130.0), "r_wrist": (125.0, 140.0), "r_hand": (133.0, 141.0)}
    drawn = assemble(Sketch(**joints).legs().arms(width=26).trunk().head().figure())
    round_ = smooth_union(drawn.body, drawn.outline.canvas)
    assert len(round_.fillets) > len(drawn.body.fillets)
    bare, grown = (
        render(FieldScene(body), PictureRequest("depth", size=(240, 320))).rgba for body in (drawn.body, round_)
    )
    more = (bare[..., 3] != grown[..., 3]).sum() / (bare[..., 3] > 0).sum()
    assert more < 0.003
    assert (bare[..., 0] != grown[..., 0]).any()


@pytest.mark.parametrize("effects", [(), ("perspective",)])
@pytest.mark.parametrize("yaw", [0.0, 70.0, 180.0])
def test_finished_model_shows_its_hull_as_a_line(effects: tuple[Effect, ...], yaw: float) -> None:
    radius, width = 0.5, 0.05
    mesh = mesh_of(ball(radius).body, 0.02)
    request = PictureRequest(size=(SIDE, SIDE), yaw_deg=yaw, effects=frozenset(effects))
    scene = MeshScene(hulled(mesh, width))
    assert scene.line_width * scene.unit == pytest.approx(width)
    assert MeshScene(mesh).line_width == 0
    shown = render(scene, request).rgba
    drawn, inked = shown[..., 3] > 0, (shown == (*PEN, 255)).all(axis=2)
    # In perspective both outlines are those of tangent cones; their radii still have the ratio of the balls', nearly.
    assert (drawn & ~inked).sum() / drawn.sum() == pytest.approx(((radius - width) / radius) ** 2, abs=0.02)
    np.testing.assert_array_equal(drawn, render(MeshScene(mesh), request).rgba[..., 3] > 0)
    assert not inked[SIDE // 2 - 20 : SIDE // 2 + 20, SIDE // 2 - 20 : SIDE // 2 + 20].any()
