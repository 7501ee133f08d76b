"""Depth without a network, and where the model stands."""

from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.asset_frame import asset_from_figure
from fig2mesh.image_frame import image_frame
from fig2mesh.pose.prior import FORESHORTENED, MAX_DEPTH_STEP, lift
from fig2mesh.records import Figure, Pose3D
from fig2mesh.skeleton import FIGURE_HEIGHT, JOINT, JOINT_NAMES
from tests.drawn import JOINTS, draw_figure


def figure(**moved: tuple[float, float]) -> Figure:
    """The drawn figure with some joints elsewhere (the picture stays: only joints matter here)."""
    rgba = np.asarray(draw_figure(1))
    joints = np.array([(JOINTS | moved)[name] for name in JOINT_NAMES], np.float32)
    shape = rgba.shape[:2]
    return Figure("posed", rgba, rgba[..., 3] > 127, joints, np.ones(21, bool), np.zeros(shape, np.uint8))


def depth(drawn: Figure, joint: str) -> float:
    return float(lift(drawn, image_frame(drawn)).joints[JOINT[joint], 2])


def test_frame_round_trip() -> None:
    drawn = figure()
    frame = image_frame(drawn)
    points = frame.figure_from_image(drawn.joints_px)
    assert np.allclose(frame.image_from_figure(points), drawn.joints_px, atol=1e-4)
    assert np.allclose(points[JOINT["pelvis"]], 0)
    rows = np.flatnonzero(drawn.mask.any(axis=1))
    top, bottom = frame.figure_from_image(np.array([[0, rows[0]], [0, rows[-1] + 1]]))[:, 1]
    assert top - bottom == pytest.approx(FIGURE_HEIGHT)


def test_a_flat_pose_stays_flat() -> None:
    drawn = figure()
    joints = lift(drawn, image_frame(drawn)).joints
    straight = [index for name, index in JOINT.items() if name not in ("eyes", "l_foot", "r_foot")]
    assert np.allclose(joints[straight, 2], 0)
    assert joints[JOINT["eyes"], 2] > 0
    assert np.allclose(joints[:, :2], image_frame(drawn).figure_from_image(drawn.joints_px), atol=1e-6)


def test_foreshortened_limbs_lean_as_limbs_do() -> None:
    """A raised knee comes forward, the shin below it goes back; a forearm comes forward."""
    sitting = figure(l_knee=(118, 185))
    assert depth(sitting, "l_knee") > 0.1
    assert depth(sitting, "r_knee") == 0
    kneeling = figure(l_ankle=(124, 240))
    assert depth(kneeling, "l_ankle") < -0.1
    pointing = figure(l_wrist=(155, 118), l_hand=(157, 121))
    assert depth(pointing, "l_wrist") > 0.05
    assert depth(pointing, "l_hand") == depth(pointing, "l_wrist")


def test_small_differences_are_the_draughtsmans() -> None:
    thigh = np.subtract(JOINTS["l_knee"], JOINTS["l_hip"]) * (FORESHORTENED + 0.02)
    x, y = np.add(JOINTS["l_hip"], thigh)
    assert depth(figure(l_knee=(float(x), float(y))), "l_knee") == 0


def test_depth_is_bounded() -> None:
    joints = lift(figure(l_knee=JOINTS["l_hip"], l_ankle=JOINTS["l_hip"]), image_frame(figure())).joints
    assert (
        np.abs(np.diff(joints[[JOINT["l_hip"], JOINT["l_knee"], JOINT["l_ankle"]], 2])).max() <= MAX_DEPTH_STEP + 1e-6
    )


def test_coincident_joints_are_no_error() -> None:
    drawn = figure(**dict.fromkeys(JOINTS, (100.0, 160.0)))
    assert np.isfinite(lift(drawn, image_frame(drawn)).joints).all()


@pytest.mark.parametrize("height", [0.5, 1.79, 30.0])
def test_standing_figure_is_on_the_ground_between_its_feet(height: float) -> None:
    drawn = figure()
    pose = lift(drawn, image_frame(drawn))
    vertices = np.float32([[-0.3, -0.8, 0.1], [0.2, 0.9, 0.0]])
    moved = asset_from_figure(pose, vertices, height).apply(vertices)
    assert moved[:, 1].min() == pytest.approx(0, abs=1e-6)
    assert np.ptp(moved[:, 1]) == pytest.approx(1.7 * height / FIGURE_HEIGHT)
    feet = pose.joints[[JOINT[f"{side}_{joint}"] for side in "lr" for joint in ("ankle", "foot")]]
    assert np.allclose(asset_from_figure(pose, vertices, height).apply(feet).mean(axis=0)[[0, 2]], 0, atol=1e-6)


def test_a_raised_foot_does_not_count() -> None:
    drawn = figure()
    joints = lift(drawn, image_frame(drawn)).joints.copy()
    joints[[JOINT["l_ankle"], JOINT["l_foot"]], 1] += 0.5
    joints[[JOINT["l_ankle"], JOINT["l_foot"]], 0] += 0.6
    pose = Pose3D(joints)
    right = joints[[JOINT["r_ankle"], JOINT["r_foot"]]].mean(axis=0)
    origin = asset_from_figure(pose, np.float32([[0, -0.9, 0], [0, 0.8, 0]]), 1.79).apply(right[None])[0]
    assert np.allclose(origin[[0, 2]], 0, atol=1e-6)
