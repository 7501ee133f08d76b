"""Plain colours for hidden sides: fills stay, ink and faces go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PIL import ImageDraw
from scipy import ndimage

from fig2mesh.image_frame import image_frame
from fig2mesh.parts.canvas import make_canvas
from fig2mesh.parts.outline import outline_parts
from fig2mesh.pose.prior import lift
from fig2mesh.records import Figure
from fig2mesh.skeleton import JOINT, JOINT_MIRROR, JOINT_NAMES, PART, PART_MIRROR
from fig2mesh.texture.sources import Sources, continued, make_sources
from tests.drawn import JOINTS, draw_figure

SCALE = 2
EYE, HAIR, INK = (20, 200, 20), (120, 60, 10), (0, 0, 0)


def colours_of(figure: Figure) -> Sources:
    frame = image_frame(figure)
    canvas = make_canvas(figure, frame, 256)
    outline = outline_parts(canvas, lift(figure, frame), figure.visible, voxel=0.03)
    return make_sources(figure, frame, outline, texture_size=1024, seed=0)


@pytest.fixture(scope="module")
def figure() -> Figure:
    """The drawn figure with hair, green eyes and black contours across shirt and trousers."""
    image = draw_figure(SCALE)
    pen = ImageDraw.Draw(image)
    x, y = (SCALE * c for c in JOINTS["head"])
    pen.chord((x - 52, y - 52, x + 52, y + 52), 185, 355, fill=HAIR)
    for dx in (-18, 18):
        pen.ellipse((x + dx - 9, y - 2, x + dx + 9, y + 16), fill=EYE)
    for row in range(180, 330, 30):
        pen.line((140, row, 260, row), fill=INK, width=4)
    rgba = np.asarray(image)
    joints = np.array([JOINTS[name] for name in JOINT_NAMES], np.float32) * SCALE
    shape = rgba.shape[:2]
    return Figure("inked", rgba, rgba[..., 3] > 127, joints, np.ones(21, bool), np.zeros(shape, np.uint8))


@pytest.fixture(scope="module")
def sources(figure: Figure) -> Sources:
    return colours_of(figure)


def near(picture: np.ndarray, colour: tuple[int, int, int], tolerance: float = 40.0) -> np.ndarray:
    return np.linalg.norm(picture - np.array(colour), axis=-1) < tolerance


def at(sources: Sources, part: str, joint: str) -> np.ndarray:
    x, y = (int(SCALE * c * sources.plain_scale) for c in JOINTS[joint])
    return sources.back[PART[part]][y, x]


def test_fills_stay_and_ink_goes(sources: Sources) -> None:
    shirt = sources.back[PART["torso"]]
    x, y = (int(SCALE * c * sources.plain_scale) for c in JOINTS["thorax"])
    window = shirt[y - 10 : y + 60, x - 20 : x + 20]
    assert near(window, (200, 40, 40)).mean() > 0.99
    assert near(window, INK).sum() == 0
    assert near(at(sources, "l_lower_leg", "l_knee"), (40, 60, 170))
    assert near(at(sources, "l_hand", "l_hand"), (40, 160, 60))


def test_no_face_on_the_back_of_the_head(sources: Sources, figure: Figure) -> None:
    head = sources.back[PART["head"]]
    assert near(head, EYE, 60).sum() == 0
    x, y = (int(SCALE * c * sources.plain_scale) for c in JOINTS["head"])
    assert near(head[y + 8, x], HAIR), "hair is carried on over the face"


def test_faceless_heads_keep_their_colours(figure: Figure) -> None:
    visible = figure.visible.copy()
    visible[JOINT["eyes"]] = False
    head = colours_of(replace(figure, visible=visible)).back[PART["head"]]
    x, y = (int(SCALE * c) for c in JOINTS["head"])
    assert near(head[y + 34, x], (230, 180, 150))


def test_background_is_not_mixed_in(figure: Figure) -> None:
    rgba = figure.rgba.copy()
    rgba[~figure.mask] = (255, 0, 255, 255)
    seen = make_sources_seen(replace(figure, rgba=rgba))
    assert near(seen, (255, 0, 255), 60).sum() == 0


def make_sources_seen(figure: Figure) -> np.ndarray:
    return colours_of(figure).seen


def test_deterministic(figure: Figure, sources: Sources) -> None:
    again = colours_of(figure)
    assert all(np.array_equal(sources.plain[part], again.plain[part]) for part in sources.plain)
    assert all(np.array_equal(sources.back[part], again.back[part]) for part in sources.back)


def test_mirrored_drawings_have_mirrored_backs(figure: Figure, sources: Sources) -> None:
    joints = figure.joints_px[list(JOINT_MIRROR)] * (-1, 1) + (figure.mask.shape[1], 0)
    turned = replace(figure, rgba=figure.rgba[:, ::-1], mask=figure.mask[:, ::-1], joints_px=joints)
    mirrored = colours_of(turned)
    for part in ("torso", "head", "l_hand", "r_lower_leg"):
        here, there = sources.back[PART[part]], mirrored.back[PART_MIRROR[PART[part]]][:, ::-1]
        apart = np.linalg.norm(here - there, axis=-1) > 60
        assert apart[figure.mask].mean() < 0.03


def test_flat_colours_are_exact(sources: Sources) -> None:
    shirt = sources.back[PART["torso"]]
    x, y = (int(SCALE * c * sources.plain_scale) for c in JOINTS["thorax"])
    np.testing.assert_array_equal(shirt[y + 20, x], (200, 40, 40))


BUTTON, BELT = (250, 250, 60), (90, 20, 120)


def test_belts_go_round_and_buttons_do_not(figure: Figure) -> None:
    image = draw_figure(SCALE)
    pen = ImageDraw.Draw(image)
    x, y = (SCALE * c for c in JOINTS["thorax"])
    for row in range(4):
        pen.ellipse((x - 5, y + 18 * row, x + 5, y + 18 * row + 10), fill=BUTTON)
    waist = (y + SCALE * JOINTS["pelvis"][1]) // 2 + 20
    pen.rectangle((0, waist, 2000, waist + 16), fill=BELT)
    rgba = np.asarray(image).copy()
    rgba[..., 3] = figure.rgba[..., 3]
    back = colours_of(replace(figure, rgba=rgba)).back[PART["torso"]]
    torso = back[y : waist + 40, x - 20 : x + 20]
    assert near(torso, BUTTON, 60).sum() == 0
    assert near(back[waist + 8, x - 15 : x + 15], BELT).all()


PAPER, RED = (240, 235, 225), (200, 40, 40)


def on_paper(rim: tuple[int, int, int], fill: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """An opaque scan of a disc whose outermost pixel has a colour of its own."""
    y, x = np.mgrid[:80, :80] + 0.5
    away = np.hypot(x - 40, y - 40)
    mask = away < 30
    colour = np.where((away > 29)[..., None], rim, fill)
    colour = np.where(mask[..., None], colour, PAPER)
    return np.dstack([colour, np.full(mask.shape, 255)]).astype(np.uint8), mask


def test_a_contour_of_one_pixel_is_no_paper() -> None:
    rgba, mask = on_paper(INK, PAPER)
    seen = continued(rgba, mask)
    assert near(seen[10, 40], INK)
    assert near(seen[2, 40], INK), "carried on beyond the silhouette"


def test_a_rim_mixed_with_paper_is_left_out() -> None:
    rgba, mask = on_paper(RED, RED)
    rim = mask & ~ndimage.binary_erosion(mask)
    rgba[rim, :3] = (rgba[rim, :3] // 2) + np.array(PAPER, np.uint8) // 2
    assert near(continued(rgba, mask), RED, 5).all()


def test_cut_out_figures_keep_their_rim() -> None:
    rgba, mask = on_paper(INK, RED)
    rgba[~mask] = 0
    assert near(continued(rgba, mask)[2, 40], INK)
