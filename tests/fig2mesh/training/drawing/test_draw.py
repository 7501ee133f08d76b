"""Drawn pictures: what must hold whatever the style."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fig2mesh.skeleton import PART
from fig2mesh.training.drawing.background import BACKGROUNDS, draw_background
from fig2mesh.training.drawing.draw import Layers, contours, draw, ink
from fig2mesh.training.drawing.faces import Face
from fig2mesh.training.drawing.marks import blur, distance, noise, stroke, warp, write
from fig2mesh.training.drawing.styles import FILLS, PALETTES, PATTERNS, Pattern, palette, pattern_coverage, random_style
from tests.fig2mesh.training.demo_body import MATERIALS, body, render_view


@pytest.fixture(scope="module")
def seen() -> tuple[Layers, Face]:
    layers, face = render_view(body(np.random.default_rng(3)))
    assert face is not None
    return layers, face


def style_with(seed: int = 0, **changes: object):
    plain = {
        "background": "white",
        "slip": (0.0, 0.0),
        "wobble": 0.0,
        "broken": 0.0,
        "glaze": False,
        "softness": 0.0,
        "speckle": 0.0,
    }
    return replace(random_style(MATERIALS, np.random.default_rng(seed)), **{**plain, **changes})


def test_the_seed_decides_and_the_layers_stay(seen: tuple[Layers, Face]) -> None:
    layers, face = seen
    before = [field.copy() for field in layers]
    pictures = [[draw(layers, MATERIALS, np.random.default_rng(s), face=face) for s in range(12)] for _ in range(2)]
    np.testing.assert_array_equal(pictures[0], pictures[1])
    assert len({picture.tobytes() for picture in pictures[0]}) == 12
    for field, old in zip(layers, before, strict=True):
        np.testing.assert_array_equal(field, old)
    assert pictures[0][0].shape == (256, 256, 3)
    assert pictures[0][0].dtype == np.uint8


def test_lines_keep_to_the_contours(seen: tuple[Layers, Face]) -> None:
    layers, _ = seen
    outer, inner = contours(layers)
    away = distance(outer | inner, 12)
    for seed in range(6):
        lines = ink(layers, style_with(seed, width=2.0, outline=1.8, wobble=0.9), np.random.default_rng(seed))
        # Half the widest line, and twice the wobble along both axes.
        assert away[lines > 0].max() <= 2 + 0.5 + 2 * 0.9 * np.sqrt(2) + 1.5
    straight = ink(layers, style_with(width=1.0, outline=1.0), np.random.default_rng(0))
    assert (straight[outer | inner] > 0.4).all()
    assert away[straight > 0].max() <= 1.5


def test_contours_follow_outline_material_and_depth_but_not_joints(seen: tuple[Layers, Face]) -> None:
    layers, _ = seen
    outer, inner = contours(layers)
    body_mask = layers.labels > 0
    padded = np.pad(body_mask, 1)
    rim = body_mask & ~(padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:])
    np.testing.assert_array_equal(outer, rim)
    flat = layers._replace(
        material=np.where(body_mask, 0, -1), depth=np.where(body_mask, 0, -np.inf).astype(np.float32)
    )
    assert not contours(flat)[1].any()
    assert contours(flat, joints=True)[1].any()
    assert inner.sum() > 50


def test_a_slope_is_no_contour_and_a_step_is_one() -> None:
    size = 40
    depth = np.broadcast_to(np.arange(size) * 0.2, (size, size)).astype(np.float32)  # steeper than the threshold
    zero = np.zeros((size, size), np.uint8)
    layers = Layers(
        zero + 1, zero.astype(int), np.zeros((size, size, 2), np.float32), depth, np.zeros((size, size, 3), np.float32)
    )
    assert not contours(layers)[1].any()
    step = layers._replace(depth=np.where(np.arange(size) < 20, 0, 0.1) * np.ones((size, 1), np.float32))
    assert np.flatnonzero(contours(step)[1].any(axis=0)).tolist() == [20]  # the nearer side


def test_without_lines_only_the_materials_colours_are_left(seen: tuple[Layers, Face]) -> None:
    layers, _ = seen
    style = style_with(width=0.0, fill="flat", patterns=(None,) * len(MATERIALS))
    assert not ink(layers, style, np.random.default_rng(0)).any()
    picture = draw(layers, MATERIALS, np.random.default_rng(1), style=style)
    expected = np.where((layers.material >= 0)[..., None], style.colours[np.maximum(layers.material, 0)], 255)
    np.testing.assert_allclose(picture, expected, atol=0.51)


def test_a_face_is_drawn_on_bare_skin_where_it_is_told_and_nowhere_else(seen: tuple[Layers, Face]) -> None:
    layers, face = seen
    style = style_with(beard="full", fill="flat", width=0.0)
    with_face, without = (draw(layers, MATERIALS, np.random.default_rng(1), style=style, face=f) for f in (face, None))
    changed = (with_face != without).any(axis=-1)
    assert changed.sum() > 20
    skin = (layers.labels == PART["head"]) & (layers.material == MATERIALS.index("skin"))
    assert skin[changed].all()
    eye = np.asarray(face.eyes[0], int)
    assert changed[eye[1], eye[0]]


@pytest.mark.parametrize("name", PALETTES)
def test_palettes_stay_in_range(name: str) -> None:
    for seed in range(40):
        colours = palette(name, MATERIALS, np.random.default_rng(seed))
        assert colours.shape == (len(MATERIALS), 3)
        assert colours.min() >= 0
        assert colours.max() <= 255
        skin = colours[0]
        assert skin.mean() >= 40  # never black: a face must show on it
        np.testing.assert_array_equal(colours[MATERIALS.index("eye")], skin)
        if name in ("map", "bright", "any"):
            assert skin[0] >= skin[1] >= skin[2]  # redder than blue, whatever the tone
        if name == "greys":
            np.testing.assert_allclose(np.ptp(colours, axis=1), 0, atol=1e-4)


def test_given_colours_are_kept() -> None:
    own = np.arange(18).reshape(6, 3) * 10.0
    np.testing.assert_array_equal(random_style(MATERIALS, np.random.default_rng(0), own).colours, own)


def test_patterns_are_for_cloth_and_follow_the_body(seen: tuple[Layers, Face]) -> None:
    styles = [random_style(MATERIALS, np.random.default_rng(seed)) for seed in range(60)]
    for style in styles:
        for material, pattern in zip(MATERIALS, style.patterns, strict=True):
            assert pattern is None or material.startswith("cloth")
    assert {p.kind for s in styles for p in s.patterns if p} == set(PATTERNS) - {"none"}
    assert {style.fill for style in styles} == set(FILLS)
    uv = np.random.default_rng(0).uniform(0, 3, (50, 60, 2)).astype(np.float32)
    for kind in set(PATTERNS) - {"none"}:
        field = pattern_coverage(Pattern(kind, (0, 0, 0), 0.05, 0.0, 0.5), uv, 2.0)
        assert field.min() >= 0
        assert field.max() <= 1
        assert 0.02 < field.mean() < 0.98
        # One repeat further along the body it is the same, wherever the pixel lies.
        further = pattern_coverage(Pattern(kind, (0, 0, 0), 0.05, 0.0, 0.5), uv + np.float32(0.2), 2.0)
        np.testing.assert_allclose(further, field, atol=2e-3)


@pytest.mark.parametrize("kind", BACKGROUNDS)
def test_backgrounds_are_opaque_and_deterministic(kind: str) -> None:
    for seed in range(3):
        first, again = (draw_background(kind, (90, 120), np.random.default_rng(seed)) for _ in range(2))
        np.testing.assert_array_equal(first, again)
        assert first.shape == (90, 120, 3)
        assert np.isfinite(first).all()
        assert first.mean() > 80


def test_every_fill_shrinks_to_a_picture(seen: tuple[Layers, Face]) -> None:
    layers, face = render_view(body(np.random.default_rng(3)), "left", 128)
    for fill in FILLS:
        picture = draw(
            layers, MATERIALS, np.random.default_rng(2), style=style_with(fill=fill, glaze=True), face=face, shrink=2
        )
        assert picture.shape == (64, 64, 3)
        assert picture.std() > 5


def test_nothing_to_see_leaves_the_background() -> None:
    empty = Layers(
        np.zeros((64, 64), np.uint8),
        np.full((64, 64), -1),
        np.zeros((64, 64, 2), np.float32),
        np.full((64, 64), -np.inf, np.float32),
        np.zeros((64, 64, 3), np.float32),
    )
    for fill in FILLS:
        assert (draw(empty, MATERIALS, np.random.default_rng(1), style=style_with(fill=fill, width=1.0)) == 255).all()


def test_marks() -> None:
    rng = np.random.default_rng(0)
    field = noise(rng, (200, 200), 20, 2)
    assert abs(field.std() - 1) < 0.15
    np.testing.assert_allclose(blur(np.full((9, 9), 7, np.float32), 2), 7, rtol=1e-5)
    mask = np.zeros((31, 31), bool)
    mask[15, 15] = True
    y, x = np.mgrid[:31, :31] - 15
    away, true = distance(mask, 6), np.hypot(x, y)
    np.testing.assert_allclose(away[true <= 6], true[true <= 6], rtol=1e-6)
    zero = np.zeros((31, 31), np.float32)
    np.testing.assert_allclose(warp(field[:31, :31], zero + 1, zero)[:, :-1], field[:31, 1:31], atol=1e-6)
    stroke(zero, [[5.5, 5.5], [25.5, 5.5]], 3)
    assert zero[5, 5:26].min() == 1
    assert zero[9:].max() == 0
    page = np.zeros((20, 60), np.float32)
    write(page, "TIL", (2, 3), 14)
    assert page[3:5, 2:12].all()  # the bar of the T, two pixels a dot
    assert page[:3].max() == 0
