"""Four sides of a body, and the networks' changes of the locations from which hidden points take their colours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from fig2mesh.field import analytic
from fig2mesh.field.body import Body
from fig2mesh.field.camera import VIEW_YAW_DEG, axes
from fig2mesh.image_frame import ImageFrame
from fig2mesh.nets.head_hsv import HeadHsv, HeadShape
from fig2mesh.nets.texture_fill import FillShape, TextureFill
from fig2mesh.nets.uv_unet import UvUnet, UvUnetShape
from fig2mesh.nets.view_refine import RefineShape, ViewRefine
from fig2mesh.records import Pose3D
from fig2mesh.skeleton import JOINT, JOINT_NAMES, PART
from fig2mesh.texture.sides import FILLED, SideViews, body_labels, trace_sides
from fig2mesh.texture.unobserved import (
    TextureNets,
    front_picture,
    paint,
    place_changes,
    texture_coordinates,
)
from fig2mesh.training.networks.loop import seeded

SIZE = 64
POSE = Pose3D(np.zeros((len(JOINT_NAMES), 3), np.float32))


@pytest.fixture(scope="module")
def body() -> Body:
    head = analytic.sample(analytic.sphere((0.1, 0.6, 0.05), 0.2), PART["head"], (0.1, 0.6, 0.05), 0.6, 64)
    trunk = analytic.sample(analytic.capsule((0, -0.3, 0), (0, 0.3, 0), 0.25), PART["torso"], (0, 0, 0), 1.4, 96)
    return Body((head, trunk))


@pytest.fixture(scope="module")
def sides(body: Body) -> SideViews:
    return trace_sides(body, POSE, SIZE)


def test_sides_show_the_surface(body: Body, sides: SideViews) -> None:
    seen = sides.labels > 0
    assert np.abs(body.distance(sides.points[seen])).max() < 2e-3
    for view, yaw in enumerate(VIEW_YAW_DEG.values()):
        depth = sides.points[view] @ axes(yaw)[2]
        np.testing.assert_allclose(depth[seen[view]], sides.depth[view][seen[view]], atol=1e-5)
    assert not np.isfinite(sides.depth[~seen]).any()


def test_sides_are_framed_as_training_pictures_are(sides: SideViews) -> None:
    for view in sides.labels:
        rows, columns = (np.flatnonzero((view > 0).any(axis=axis)) for axis in (1, 0))
        longest = max(np.ptp(rows), np.ptp(columns)) + 1
        assert longest == pytest.approx(FILLED * SIZE, abs=2.5)
        assert (rows[0] + rows[-1] + 1) / 2 == pytest.approx(SIZE / 2, abs=1)


def test_places_in_front_are_pixels(sides: SideViews) -> None:
    along = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
    seen = sides.labels[0] > 0
    x, y = np.meshgrid(along, along)
    np.testing.assert_allclose(sides.places()[0][seen], np.stack([x, y], axis=-1)[seen], atol=1e-4)
    # From behind left and right are the other way round.
    back = sides.labels[2] > 0
    np.testing.assert_allclose(sides.places()[2][back][:, 0], -x[back], atol=1e-4)


def test_extras_count_as_what_they_cover() -> None:
    joints = np.zeros((len(JOINT_NAMES), 3), np.float32)
    for side, x in (("l", 0.1), ("r", -0.1)):
        joints[JOINT[f"{side}_hip"]] = (x, 0.0, 0)
        joints[JOINT[f"{side}_knee"]] = (x, -0.4, 0)
    points = np.array([[0, 0.2, 0], [0.1, -0.2, 0], [-0.1, -0.2, 0], [0.1, -0.6, 0], [-0.1, -0.6, 0]])
    labels = np.full(5, PART["garment"], np.uint8)
    wanted = [PART[n] for n in ("torso", "l_upper_leg", "r_upper_leg", "l_lower_leg", "r_lower_leg")]
    assert body_labels(labels, points, Pose3D(joints)).tolist() == wanted
    turned = Pose3D(joints * np.array([-1, 1, 1], np.float32))
    assert body_labels(labels, points, turned)[1] == PART["r_upper_leg"], "from behind"
    others = np.array([PART["hair"], PART["prop"], 0, PART["l_hand"]], np.uint8)
    assert body_labels(others, points[:4], POSE).tolist() == [PART["head"], 0, 0, PART["l_hand"]]


def test_the_front_picture_is_the_drawing_in_the_frame_of_the_sides(sides: SideViews) -> None:
    frame = ImageFrame((50.0, 60.0), 0.01)
    columns = np.arange(100, dtype=np.float32) + 0.5
    picture = np.broadcast_to(columns[None, :, None], (120, 100, 3)).copy()
    found = front_picture(picture, frame, sides)
    seen = sides.labels[0] > 0
    x = frame.image_from_figure(sides.points[0][seen][:, :2].astype(np.float64))[:, 0]
    np.testing.assert_allclose(found[seen][:, 0], np.clip(x, 0.5, 99.5), atol=0.6)


def networks() -> TextureNets:
    uv = seeded(0, lambda: UvUnet(UvUnetShape(filters=4))).eval()
    refine, head = ViewRefine(RefineShape(4)), HeadHsv(HeadShape(4, 8))
    return TextureNets(uv, seeded(0, lambda: TextureFill(FillShape(32, 4))).eval(), refine.eval(), head.eval())


def changed(sides: SideViews, nets: TextureNets) -> np.ndarray:
    front = np.zeros((SIZE, SIZE, 3), np.float32)
    return place_changes(sides, front, texture_coordinates(sides, nets.uv), nets.fill)


def test_untrained_networks_change_nothing(sides: SideViews) -> None:
    assert not changed(sides, networks()).any()


def test_a_change_in_texture_space_moves_every_place_by_as_much(sides: SideViews) -> None:
    nets = networks()
    with torch.no_grad():
        nets.fill.net.give[0].bias[:4] = 0.1
    found = changed(sides, nets)
    seen = sides.labels > 0
    np.testing.assert_allclose(found[seen], np.broadcast_to([0.5 * np.tanh(0.1), 0.0], (seen.sum(), 2)), atol=1e-4)
    assert not found[~seen].any()


def test_untrained_networks_paint_the_front_straight_through(sides: SideViews) -> None:
    rng = np.random.default_rng(0)
    front = rng.uniform(0, 255, (SIZE, SIZE, 3)).astype(np.float32)
    nets = networks()
    made = paint(sides, front, replace(nets, head=None))
    seen = sides.labels[0] > 0
    np.testing.assert_allclose(made[0][seen], front[seen], atol=0.1)
    back = sides.labels[2] > 0
    # The box is not quite symmetric to the pixels: compare where both sides see the body.
    mirrored = front[:, ::-1]
    assert np.abs(made[2][back] - mirrored[back]).mean() < 1.0
