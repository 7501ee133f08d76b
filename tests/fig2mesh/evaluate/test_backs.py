"""Measures of backs whose answers are known."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from exporters.asset import TexturedMesh
from fig2mesh.evaluate.backs import (
    KEYS,
    METHODS,
    MIRRORED,
    OURS,
    Pixels,
    as_json,
    as_markdown,
    back_of,
    face_share,
    likeness,
    means,
    measure,
    measure_figure,
    nearest_seen,
    pixels_of,
)
from fig2mesh.records import Figure
from fig2mesh.settings import settings_for
from fig2mesh.training.bodies.subject import draw_subject
from fig2mesh.training.samples.drawn_figure import PICTURE, DrawnFigure, DrawnSide, drawn_figure
from tests.fig2mesh.mesh.test_preview import BACK, FRONT, coloured_box
from tests.fig2mesh.training.figures import capsule_pack

SIZE = 60
SKIN, HAIR, EYE, INK = (230, 190, 160), (70, 40, 20), (10, 30, 60), (20, 16, 12)


def side(colour: tuple[int, int, int], head: tuple[int, int, int], eye: tuple[int, int, int] | None) -> DrawnSide:
    """A block with a head of one colour on top, an eye in it and a contour of 2 pixels."""
    picture = np.full((SIZE, SIZE, 3), 255, np.uint8)
    mask, heads = np.zeros((SIZE, SIZE), bool), np.zeros((SIZE, SIZE), bool)
    mask[10:50, 20:40] = True
    heads[10:22, 20:40] = True
    picture[mask], picture[heads] = colour, head
    face = np.zeros_like(mask)
    if eye is not None:
        face[14:20, 24:36] = True
        picture[16:18, 26:29] = eye
    bare, inked = picture.copy(), mask.copy()
    inked[12:48, 22:38] = False
    picture[inked] = INK
    return DrawnSide(picture, bare, mask, inked, heads, face)


@pytest.fixture
def block() -> DrawnFigure:
    front, back = side((200, 60, 60), SKIN, EYE), side((60, 60, 200), HAIR, None)
    rgba = np.dstack([front.picture, np.full((SIZE, SIZE), 255, np.uint8)])
    figure = Figure(
        "block", rgba, front.mask, np.zeros((21, 2), np.float32), np.ones(21, bool), np.zeros((SIZE, SIZE), np.uint8)
    )
    return DrawnFigure(figure, front, back, np.array(SKIN, np.float32), 2.0)


def test_picture_is_like_itself_and_less_like_another() -> None:
    truth = np.random.default_rng(0).uniform(0, 255, (40, 40, 3))
    over = np.zeros((40, 40), bool)
    over[5:35, 5:35] = True
    same = likeness(truth, truth, over)
    assert same.psnr == 100
    assert same.ssim == pytest.approx(1)
    assert same.delta_e == 0
    assert same.palette == 0
    other = likeness(np.roll(truth, 1, axis=1), truth, over)
    assert other.psnr < 12
    assert other.delta_e > 10


def test_palette_does_not_depend_on_places() -> None:
    halves = np.full((20, 20, 3), 30.0)
    halves[:, :10] = 220.0
    over = np.ones((20, 20), bool)
    assert likeness(halves[:, ::-1], halves, over).palette == pytest.approx(0, abs=1.0)
    assert likeness(halves[:, ::-1], halves, over).delta_e > 50
    # All light against half light: half of the pixels have to change from dark to light.
    lightness = likeness(np.full_like(halves, 220.0), np.full_like(halves, 30.0), over).palette
    assert likeness(np.full_like(halves, 220.0), halves, over).palette == pytest.approx(lightness / 2, rel=0.1)


def test_psnr_of_a_constant_error_is_by_formula() -> None:
    truth = np.full((20, 20, 3), 100.0)
    found = likeness(truth + 10, truth, np.ones((20, 20), bool))
    assert found.psnr == pytest.approx(20 * np.log10(255 / 10))


def test_true_back_is_perfect_and_contours_count_only_in_the_whole(block: DrawnFigure) -> None:
    perfect = measure(block.back.picture.astype(float), block)
    assert (perfect["psnr"], perfect["area_psnr"], perfect["face"]) == (100, 100, 0)
    bare = measure(block.back.bare.astype(float), block)
    assert bare["psnr"] < 20
    assert bare["area_psnr"] == 100
    assert bare["area_delta_e"] == 0


def test_face_is_skin_and_eyes_where_the_truth_has_others(block: DrawnFigure) -> None:
    head, made = block.back.head, block.back.picture.astype(float)
    assert face_share(made, block) == 0
    assert face_share(block.front.picture[:, ::-1].astype(float), block) > 0.5
    made[13:15, 24:36] = np.array(SKIN) * 0.75
    assert face_share(made, block) == pytest.approx(2 * 12 / head.sum())
    eyes = block.back.picture.astype(float)
    eyes[16:18, SIZE - 29 : SIZE - 26] = EYE
    # As dark as hair may be: what counts is that it is the front's, about the eyes, and not the truth's.
    assert face_share(eyes, block) == pytest.approx(2 * 3 / head.sum())
    bald = replace(block, back=side((60, 60, 200), SKIN, None))
    assert face_share(block.front.bare[:, ::-1].astype(float), bald) < 0.05
    hidden = replace(block, back=replace(block.back, head=np.zeros_like(head)))
    assert np.isnan(face_share(made, hidden))


@pytest.fixture(scope="module")
def box() -> TexturedMesh:
    return coloured_box((0.6, 1.8, 0.3))


def test_view_from_behind_is_mirrored_and_in_place(box: TexturedMesh) -> None:
    # The drawing shows the box 10 pixels from its left edge and 5 from its top.
    scale = Pixels(0.02, (10 + 15, 5 + 90))
    picture = back_of(box, scale, (100, 80))
    assert tuple(picture[50, 79 - 25]) == BACK
    mask = np.zeros((100, 80), bool)
    mask[5:95, 10:40] = True
    found = pixels_of(box, mask)
    assert found.metres == pytest.approx(scale.metres)
    np.testing.assert_allclose(found.origin, scale.origin)
    # Beyond the model its colours are continued.
    assert (picture == BACK).all()


def test_nearest_seen_colours_are_those_of_the_nearest_half(box: TexturedMesh) -> None:
    scale = Pixels(0.02, (10 + 15, 5 + 90))
    bare = np.zeros((100, 80, 3), np.uint8)
    bare[:, :25], bare[:, 25:] = FRONT, (0, 0, 255)
    mask = np.zeros((100, 80), bool)
    mask[5:95, 10:40] = True
    nothing = np.zeros_like(mask)
    found = nearest_seen(box, scale, DrawnSide(bare, bare, mask, nothing, nothing, nothing))
    # From behind the figure's right half is on the right.
    assert tuple(found[50, 79 - 15]) == FRONT
    assert tuple(found[50, 79 - 35]) == (0, 0, 255)


def test_drawn_figure_has_one_silhouette_and_one_hand() -> None:
    subject = draw_subject(capsule_pack(), "valid-characters", 3)
    drawn = drawn_figure(subject, "one", 3)
    again = drawn_figure(subject, "one", 3)
    np.testing.assert_array_equal(drawn.front.picture, again.front.picture)
    np.testing.assert_array_equal(drawn.back.picture, again.back.picture)
    mirrored = drawn.back.mask[:, ::-1]
    assert drawn.figure.rgba.shape == (PICTURE, PICTURE, 4)
    assert (mirrored & drawn.front.mask).sum() / (mirrored | drawn.front.mask).sum() > 0.97
    for one in (drawn.front, drawn.back):
        assert one.inked.any()
        # Nearly the whole rim is a line.
        rim = one.mask & ~np.roll(one.mask, 1, axis=1)
        assert one.inked[rim].mean() > 0.8
    assert not drawn.back.face.any() or not drawn.front.face.any()


def test_measures_of_a_figure_and_their_report(box: TexturedMesh, block: DrawnFigure) -> None:
    rows = {"block": measure_figure(block, box, pixels_of(box, block.front.mask))}
    assert set(rows["block"]) == set(METHODS)
    assert set(rows["block"][OURS]) == {*KEYS, "face"}
    assert means(rows)[MIRRORED]["psnr"] == rows["block"][MIRRORED]["psnr"]
    text = as_markdown(rows, {"other": "no reason"}, "test", settings_for("draft"))
    assert text.count("| mirrored front |") == 2
    assert "- other: no reason" in text
    assert json.loads(as_json(rows, {}))["figures"]["block"][OURS]["ssim"] == rows["block"][OURS]["ssim"]
    assert means({}) == {}
