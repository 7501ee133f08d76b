"""The pose network that ships, on drawn joints."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fig2mesh.image_frame import image_frame
from fig2mesh.pose.network import lift_by_network, upright
from fig2mesh.records import Figure
from fig2mesh.skeleton import JOINT, JOINT_MIRROR, JOINT_NAMES
from tests.drawn import JOINTS, draw_figure


def drawn_figure() -> Figure:
    rgba = np.asarray(draw_figure(1))
    mask = rgba[..., 3] >= 128
    joints = np.array([JOINTS[name] for name in JOINT_NAMES], np.float32)
    return Figure("drawn", rgba, mask, joints, np.ones(21, bool), np.zeros(mask.shape, np.uint8))


def mirrored(figure: Figure) -> Figure:
    width = figure.mask.shape[1]
    joints = figure.joints_px[list(JOINT_MIRROR)] * [-1, 1] + [width, 0]
    visible = figure.visible[list(JOINT_MIRROR)]
    return Figure("m", figure.rgba[:, ::-1], figure.mask[:, ::-1], joints, visible, figure.part_labels[:, ::-1])


def test_what_is_drawn_stays() -> None:
    figure = drawn_figure()
    frame = image_frame(figure)
    joints = lift_by_network(figure, frame).joints
    np.testing.assert_allclose(joints[:, :2], frame.figure_from_image(figure.joints_px), atol=1e-6)
    assert joints[JOINT["pelvis"], 2] == 0


def test_a_mirrored_drawing_has_the_mirrored_depths() -> None:
    figure = drawn_figure()
    depth = lift_by_network(figure, image_frame(figure)).joints[:, 2]
    other = mirrored(figure)
    twin = lift_by_network(other, image_frame(other)).joints[:, 2]
    np.testing.assert_allclose(twin[list(JOINT_MIRROR)], depth, atol=1e-5)


def test_the_face_looks_at_the_viewer_and_depths_are_a_persons() -> None:
    figure = drawn_figure()
    joints = lift_by_network(figure, image_frame(figure)).joints
    assert joints[JOINT["eyes"], 2] > joints[JOINT["head"], 2]
    assert np.abs(joints[:, 2]).max() < 0.6


@pytest.mark.parametrize("factor", [0.5, 3.0])
def test_the_scale_of_a_drawing_does_not_matter(factor: float) -> None:
    from fig2mesh.nets.pose_lift import POSE_WEIGHTS, SHIPPED, lift_joints

    net = POSE_WEIGHTS.shipped(SHIPPED)
    figure = drawn_figure()
    drawn = image_frame(figure).figure_from_image(figure.joints_px)
    np.testing.assert_allclose(
        lift_joints(net, factor * drawn), factor * lift_joints(net, drawn), rtol=1e-3, atol=1e-3 * factor
    )


def standing(lean: float) -> NDArray[np.float32]:
    joints = np.zeros((21, 3), np.float32)
    for name, (x, y) in JOINTS.items():
        joints[JOINT[name]] = ((x - 100) / 140, (160 - y) / 140, 0)
    joints[:, 2] += lean * joints[:, 1]
    return joints


@pytest.mark.parametrize("lean", [-0.2, 0.0, 0.3])
def test_a_standing_figure_is_upright(lean: float) -> None:
    np.testing.assert_allclose(upright(standing(lean)), standing(0.0), atol=1e-6)


def test_a_seated_figure_keeps_its_depths() -> None:
    joints = standing(0.0)
    for side in "lr":
        # Thighs come forward to the viewer, shins hang down.
        for name in ("knee", "ankle", "foot"):
            joints[JOINT[f"{side}_{name}"]] += (0, 0.35, 0.4)
    np.testing.assert_array_equal(upright(joints), joints)
