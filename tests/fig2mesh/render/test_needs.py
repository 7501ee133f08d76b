"""Only requested work is done: the pure function, and the counters that prove it."""

from __future__ import annotations

from itertools import combinations

import pytest

from fig2mesh.errors import InputError
from fig2mesh.render.counts import Counts
from fig2mesh.render.effects import EFFECTS, MODES, Effect, Mode, check_effects, parse_effects
from fig2mesh.render.needs import Needs, needs
from fig2mesh.render.picture import PictureRequest, render
from fig2mesh.render.scene import FieldScene, MeshScene
from tests.fig2mesh.render.scenes import balls_mesh, balls_scene

SIZE = (48, 64)
UNLIT_EFFECTS: tuple[Effect, ...] = ("perspective", "smooth-union")


def test_depth_and_parts_need_neither_normals_nor_textures() -> None:
    for fields in (True, False):
        for effects in (frozenset(), frozenset(UNLIT_EFFECTS)):
            assert needs("depth", effects, fields=fields) == Needs()
            assert needs("parts", effects, fields=fields) == Needs(labels=True)


def test_mesh_finds_its_colours_in_its_texture_alone() -> None:
    assert needs("textured", frozenset(), fields=False) == Needs(textures=True)
    assert needs("textured", frozenset(), fields=True) == Needs(normals=True, labels=True, textures=True, sight=True)


def test_more_effects_never_need_less() -> None:
    for mode in MODES:
        for number in (1, 2):
            for effects in combinations(EFFECTS, number):
                less, more = needs(mode, frozenset(effects[1:])), needs(mode, frozenset(effects))
                for name in ("normals", "labels", "textures", "sight", "shadow", "ao_samples", "edges", "blend"):
                    assert getattr(more, name) >= getattr(less, name)


@pytest.fixture(scope="module")
def fields() -> FieldScene:
    return balls_scene()


@pytest.fixture(scope="module")
def mesh() -> MeshScene:
    return MeshScene(balls_mesh())


def spent(scene: FieldScene | MeshScene, mode: Mode, *effects: Effect, ground: bool = False) -> Counts:
    return render(scene, PictureRequest(mode, frozenset(effects), SIZE, pitch_deg=20.0, ground=ground)).counts


@pytest.mark.parametrize("kind", ["fields", "mesh"])
def test_what_is_not_asked_for_costs_nothing(kind: str, request: pytest.FixtureRequest) -> None:
    scene = request.getfixturevalue(kind)
    rays = SIZE[0] * SIZE[1]
    for mode in ("depth", "parts"):
        assert spent(scene, mode) == Counts(camera_rays=rays)
        assert spent(scene, mode, "perspective") == Counts(camera_rays=rays)
    seen = spent(scene, "normals").normals
    assert spent(scene, "normals") == Counts(camera_rays=rays, normals=seen)
    assert spent(scene, "clay", "light") == Counts(camera_rays=rays, normals=seen)
    assert spent(scene, "clay", "ao") == Counts(camera_rays=rays, normals=seen, ao_rays=8 * seen)
    assert spent(scene, "clay", "outline") == Counts(camera_rays=rays, normals=seen, pixels_compared=rays)
    shadows = spent(scene, "clay", "light", "shadow")
    assert 0 < shadows.shadow_rays < seen
    assert shadows == Counts(camera_rays=rays, normals=seen, shadow_rays=shadows.shadow_rays)


def test_textures_are_sampled_once_a_point_and_twice_where_they_blend(fields: FieldScene, mesh: MeshScene) -> None:
    rays = SIZE[0] * SIZE[1]
    plain, blended = spent(fields, "textured"), spent(fields, "textured", "blend")
    assert plain.texture_samples == plain.normals
    assert 0 < plain.sight_rays < plain.normals
    assert plain.normals < blended.texture_samples < 2 * plain.normals
    # The texture of a mesh needs no normals.
    seen = spent(mesh, "normals").normals
    assert spent(mesh, "textured") == Counts(camera_rays=rays, texture_samples=seen)


def test_sun_below_the_horizon_casts_no_shadow_rays(fields: FieldScene) -> None:
    assert spent(fields, "clay", "sun", "shadow").shadow_rays == 0


@pytest.mark.parametrize(
    ("mode", "effects", "fields", "expected"),
    [
        ("depth", "light", True, "light cannot be combined with --mode depth"),
        ("normals", "ao", True, "ao cannot be combined with --mode normals"),
        ("clay", "light,sun", True, "light cannot be combined with sun"),
        ("clay", "shadow", True, "shadow requires light or sun"),
        ("clay", "blend", True, "blend"),
        ("textured", "blend", False, "drawing instead"),
        ("clay", "smooth-union", False, "drawing instead"),
    ],
)
def test_what_does_not_go_together_is_rejected(mode: Mode, effects: str, fields: bool, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        check_effects(mode, parse_effects([effects]), fields=fields)


def test_effects_are_named_in_lists_or_one_by_one() -> None:
    assert parse_effects(["light, shadow", "ao"]) == {"light", "shadow", "ao"}
    assert parse_effects([]) == frozenset()
    with pytest.raises(InputError, match="glow"):
        parse_effects(["light,glow"])
