"""Contents of a page: bricks, colour atlas, depth map, HTML."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from fig2mesh.field.analytic import mannequin, sphere
from fig2mesh.field.analytic import sample as sampled
from fig2mesh.field.body import Body
from fig2mesh.field.distance import lipschitz, trilinear
from fig2mesh.records import PartSdf
from fig2mesh.view import field_atlas as fields
from fig2mesh.view.colour_atlas import NOTHING, colour_atlas, depth_map
from fig2mesh.view.field_atlas import Brick, field_atlas
from fig2mesh.view.globe import globe_page
from fig2mesh.view.page import EFFECTS, default_effects, figure_json, view_page
from fig2mesh.view.template import asset
from georef.placement import GeoPlacement
from tests.fig2mesh.view.conftest import Painted


def values_at(brick: Brick, points: np.ndarray) -> np.ndarray:
    at = (points - brick.origin) / brick.spacing
    return trilinear(brick.values.astype(np.float32), np.clip(at, 0, np.array(brick.values.shape) - 1))


def test_bricks_keep_the_surface_and_lose_the_room_round_it() -> None:
    body = Body(mannequin(48))
    atlas = field_atlas(body)
    assert len(atlas.bricks) == atlas.parts == 14
    assert sum(brick.values.size for brick in atlas.bricks) < 0.5 * sum(part.grid.size for part in body.parts)
    for part, brick in zip(body.parts, atlas.bricks, strict=True):
        inside = np.argwhere(part.grid <= 0) * part.spacing + part.origin
        assert (inside >= brick.box[0] - 1e-6).all()
        assert (inside <= brick.box[1] + 1e-6).all()
        near = np.argwhere(np.abs(part.grid) < 1.5 * part.spacing) * part.spacing + part.origin
        own = trilinear(part.grid, (near - part.origin) / part.spacing)
        np.testing.assert_allclose(values_at(brick, near), own, atol=2e-4 * part.spacing + 2**-10 * np.abs(own).max())


def test_bricks_do_not_overlap_and_fit() -> None:
    atlas = field_atlas(Body(mannequin(64)))
    assert max(atlas.size) <= 256
    taken = np.zeros(atlas.size, int)
    for brick, place in zip(atlas.bricks, atlas.places, strict=True):
        taken[tuple(slice(a, a + n) for a, n in zip(place, brick.values.shape, strict=True))] += 1
    assert taken.max() == 1
    assert taken.sum() == len(atlas.values())


def test_values_that_overestimate_are_tamed_and_keep_their_sign() -> None:
    ball = sampled(sphere((0, 0, 0), 0.2), 1, (0, 0, 0), 0.8, 48)
    wild = replace(ball, grid=np.where(ball.grid > 0, ball.grid * (1 + 1e4 * ball.grid), ball.grid))
    (brick,) = field_atlas(Body((wild,))).bricks
    assert lipschitz(wild.grid, wild.spacing) > 1000
    # Across the surface the solid's own slope, which is 1, comes on top.
    assert brick.slope <= (1 + fields.MAX_STEP) * 3**0.5
    tame = values_at(brick, np.argwhere(np.ones_like(ball.grid)) * ball.spacing + ball.origin).reshape(ball.grid.shape)
    inner = (np.abs(np.indices(ball.grid.shape) - 23.5) < 15).all(axis=0)
    assert ((tame > 0) == (wild.grid > 0))[inner].all()
    assert (tame <= wild.grid + 1e-3 * ball.spacing)[inner & (wild.grid > 0)].all()


def test_a_part_cut_off_by_its_cube_ends_there() -> None:
    cut = sampled(sphere((0, 0, 0), 0.5), 1, (0, 0, 0), 0.6, 32)
    (brick,) = field_atlas(Body((cut,))).bricks
    np.testing.assert_allclose(brick.box, [[-0.3] * 3, [0.3] * 3], atol=1e-6)


def test_specks_beside_a_part_are_left_out() -> None:
    ball = sampled(sphere((0, 0, 0), 0.2), 1, (0, 0, 0), 0.8, 48)
    grid = ball.grid.copy()
    grid[2:4, 2:4, 2:4] = -0.01
    (clean,), (brick,) = (field_atlas(Body((part,))).bricks for part in (ball, replace(ball, grid=grid)))
    np.testing.assert_array_equal(brick.box, clean.box)
    speck = sampled(sphere((0, 0, 0), 0.02), 1, (0, 0, 0), 0.8, 48)  # all that there is
    assert (speck.grid <= 0).sum() < fields.SPECK
    assert len(field_atlas(Body((speck,))).bricks) == 1


def test_too_many_voxels_are_resampled(monkeypatch: pytest.MonkeyPatch) -> None:
    body = Body(mannequin(64))
    full = len(field_atlas(body).values())
    monkeypatch.setattr(fields, "MAX_VOXELS", full // 4)
    coarse = field_atlas(body)
    assert len(coarse.values()) < 0.3 * full
    random = np.random.default_rng(1)
    for part, brick in zip(body.parts, coarse.bricks, strict=True):
        points = random.uniform(*brick.box, (400, 3))
        exact = body_value(part, points)
        near = np.abs(exact) < part.spacing
        assert np.abs(values_at(brick, points) - exact)[near].max() < 0.35 * brick.spacing


def body_value(part: PartSdf, points: np.ndarray) -> np.ndarray:
    return trilinear(part.grid, (points - part.origin) / part.spacing)


def test_no_surface_is_an_error() -> None:
    empty = PartSdf(1, np.ones((8, 8, 8), np.float32), np.zeros(3, np.float32), 1.0)
    with pytest.raises(ValueError, match="no grid has a negative value"):
        field_atlas(Body((empty,)))


def test_colours_lie_where_the_slots_say(painted: Painted) -> None:
    sources, frame = painted.sources, painted.frame
    atlas = colour_atlas(sources, frame, painted.body)
    assert len(atlas.slots) == 3  # drawing, head, rest: parts of one layer share a picture
    random = np.random.default_rng(0)
    for part, box in zip(painted.body.parts, painted.body.grids.boxes, strict=False):
        points = random.uniform(box[0, :2], box[1, :2], (50, 2))
        plain = atlas.slot_of_label[part.part]
        for index, picture, scale in (0, sources.seen, 1.0), (plain, sources.plain[part.part], sources.plain_scale):
            (ax, bx, ay, by), (x0, y0, x1, y1) = atlas.slots[index].place, atlas.slots[index].window
            texels = np.floor(points * (ax, ay) + (bx, by)).astype(int)
            assert (texels >= (x0, y0)).all()
            assert (texels < (x1, y1)).all()
            columns, rows = np.floor(frame.image_from_figure(points) * scale).astype(int).T
            expected = np.round(picture[rows, columns]).astype(np.uint8)
            np.testing.assert_array_equal(atlas.picture[texels[:, 1], texels[:, 0]], expected)


def test_large_drawings_are_reduced(painted: Painted) -> None:
    factor = 12
    seen = np.kron(painted.sources.seen, np.ones((factor, factor, 1), np.float32))
    (x, y), units = painted.frame.origin_px, painted.frame.units_per_px
    frame = replace(painted.frame, origin_px=(factor * x, factor * y), units_per_px=units / factor)
    sources = replace(painted.sources, seen=seen, plain_scale=painted.sources.plain_scale / factor)
    large = colour_atlas(sources, frame, painted.body)
    assert max(large.picture.shape[:2]) < 1700
    ax, bx, ay, by = large.slots[0].place
    u, v, w, z = colour_atlas(painted.sources, painted.frame, painted.body).slots[0].place
    assert -ay == pytest.approx(ax, rel=2e-3)
    # Where the small drawing's texel (20, 20) ends up; its colour is the same.
    point = np.array([(20.5 - v) / u, (20.5 - z) / w])
    texel = np.floor(point * (ax, ay) + (bx, by)).astype(int)
    expected = colour_atlas(painted.sources, painted.frame, painted.body).picture[20, 20]
    np.testing.assert_allclose(large.picture[texel[1], texel[0]], expected, atol=2)


def test_the_depth_map_shows_the_front(painted: Painted) -> None:
    depth = depth_map(painted.body)
    _, bx, ay, by = depth.place
    # The torso's axis is at x = z = 0, its radius there 0.145.
    assert float(depth.z[int(0.22 * ay + by), int(bx)]) == pytest.approx(0.145, abs=4e-3)
    assert depth.z[0, 0] == NOTHING


class Addresses(HTMLParser):
    """Collects what a page would load."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data", "action")]


def test_a_page_needs_nothing_from_elsewhere(painted: Painted) -> None:
    text = view_page(painted.scene)
    parser = Addresses()
    parser.feed(text)
    assert parser.found == ["data:,"]
    assert re.findall(r"https?://|//cdn|@import|url\(", text) == []
    assert "{{" not in text.replace(figure_json(painted.scene), "")
    assert "<title>Mannequin &amp; &lt;friend&gt;</title>" in text
    assert len(text) < 3_000_000


def test_a_page_is_the_same_each_time(painted: Painted) -> None:
    assert view_page(painted.scene) == view_page(painted.scene)


def test_names_cannot_end_the_script(painted: Painted) -> None:
    scene = replace(painted.scene, name="</script><b>")
    facts = figure_json(scene)
    assert "</" not in facts
    assert json.loads(facts)["name"] == scene.name
    assert "<b>" not in view_page(scene).replace(facts, "")


def test_effects_are_those_of_the_script_and_the_shader(painted: Painted) -> None:
    listed = re.search(r"const EFFECTS = \[(.*?)\]", asset("view.js"), re.DOTALL)
    assert listed is not None
    assert re.findall(r"'([a-z-]+)'", listed[1]) == list(EFFECTS)
    tested = set(re.findall(r"#ifdef (\w+)", asset("shader.glsl")))
    assert tested == {effect.upper().replace("-", "_") for effect in EFFECTS}
    assert json.loads(figure_json(painted.scene, ["light"]))["effects"] == ["light"]


def test_outlines_are_on_where_the_drawing_has_none(painted: Painted) -> None:
    assert "outline" not in default_effects(painted.scene)
    assert "outline" in default_effects(replace(painted.scene, contours=False))


def test_the_globe_loads_cesium_alone(painted: Painted) -> None:
    text = globe_page(painted.scene, GeoPlacement(8.5, 47.4, 400, heading_deg=90), "cesium/")
    parser = Addresses()
    parser.feed(text)
    assert parser.found == ["data:,", "cesium/Widgets/widgets.css", "cesium/Cesium.js"]
    assert re.findall(r"https?://|url\(", text) == []
