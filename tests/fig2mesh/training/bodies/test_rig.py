"""Rigs and poses: whatever the rest stance, one pose means the same for all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fig2mesh.skeleton import JOINT, JOINT_MIRROR
from fig2mesh.training.bodies.rig import KEY, KEY_MIRROR, KEYS, T_POSE, PoseSet, axis_angle, pose, swing
from tests.fig2mesh.training.figures import NAMES, capsule_man, poses

# fmt: off
LIMBS = {"upper_arm": ("shoulder", "elbow"), "lower_arm": ("elbow", "wrist"),
         "upper_leg": ("hip", "knee"), "lower_leg": ("knee", "ankle")}
# fmt: on
SIDES = [(side, limb) for side in "lr" for limb in LIMBS]
STRAIGHT = np.zeros(2)


@pytest.mark.parametrize("drop_deg", [0.0, 35.0, 80.0])
def test_limbs_point_where_the_pose_says_whatever_the_rest_stance(drop_deg: float) -> None:
    rig = capsule_man("man", drop_deg)
    identity = np.tile(np.eye(3), (len(KEYS), 1, 1))
    for rotations in (identity, *poses("seen", 8, 1).rotations):
        _, joints = pose(rig, rotations, STRAIGHT)
        for side, limb in SIDES:
            first, last = (joints[JOINT[f"{side}_{name}"]] for name in LIMBS[limb])
            key = KEY[f"{side}_{limb}"]
            expected = np.linalg.norm(last - first) * rotations[key] @ T_POSE[key]
            # The ankle sits 5 mm above the bone of the foot, which the lower leg's bone points at.
            np.testing.assert_allclose(last - first, expected, atol=0.01 if limb == "lower_leg" else 1e-5)


def test_the_rest_stance_is_a_pose_of_its_own() -> None:
    rig = capsule_man("man", 35.0)
    both = zip(T_POSE, rig.rest_direction, strict=True)
    rotations = np.stack([swing(target, rest) if target.any() else np.eye(3) for target, rest in both])
    vertices, joints = pose(rig, rotations, STRAIGHT)
    np.testing.assert_allclose(vertices, rig.vertices, atol=1e-6)
    np.testing.assert_allclose(joints, rig.joint_rest, atol=1e-6)


def test_what_hangs_on_one_bone_moves_rigidly() -> None:
    rig = capsule_man("man", 20.0)
    vertices, _ = pose(rig, poses("seen", 8, 1).rotations[0], np.array([0.5, 0.2]))
    alone = rig.bone_weight.max(axis=1) > 0.99999
    owner = rig.bone_index[np.arange(len(vertices)), rig.bone_weight.argmax(axis=1)]
    for bone in range(len(NAMES)):
        mine = np.flatnonzero(alone & (owner == bone))[:40]
        if len(mine) > 1:
            before, after = (np.linalg.norm(x[mine, None] - x[mine], axis=-1) for x in (rig.vertices, vertices))
            np.testing.assert_allclose(after, before, atol=1e-5)
    # The blend at a joint keeps the body in one piece: no edge is torn.
    edges = rig.faces[:, [0, 1]]
    assert np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1).max() < 0.2


def test_a_mirrored_pose_of_a_symmetric_rig_is_its_mirror_image() -> None:
    rig = capsule_man("man", 20.0)
    flip = np.diag([-1.0, 1, 1])
    for rotations in poses("seen", 8, 1).rotations[:3]:
        _, joints = pose(rig, rotations, STRAIGHT)
        _, mirrored = pose(rig, flip @ rotations[list(KEY_MIRROR)] @ flip, STRAIGHT)
        np.testing.assert_allclose(mirrored, joints[list(JOINT_MIRROR)] @ flip, atol=1e-6)


@pytest.mark.parametrize(("hand", "finger"), [(0, "l_finger"), (1, "r_finger")])
def test_curl_bends_the_fingers_of_one_hand_to_its_palm(hand: int, finger: str) -> None:
    rig = capsule_man("man")
    rotations = np.tile(np.eye(3), (len(KEYS), 1, 1))
    straight, joints = pose(rig, rotations, STRAIGHT)
    bent, same = pose(rig, rotations, np.eye(2)[hand])
    np.testing.assert_array_equal(same, joints)
    share = (rig.bone_weight * (rig.bone_index == NAMES.index(finger))).sum(axis=1)
    np.testing.assert_allclose(bent[share == 0], straight[share == 0], atol=1e-12)
    tip = np.flatnonzero(share > 0.999)[np.abs(straight[share > 0.999, 0]).argmax()]
    assert bent[tip, 1] < straight[tip, 1] - 0.05


@given(st.tuples(*[st.floats(-1, 1)] * 3), st.tuples(*[st.floats(-1, 1)] * 3))
def test_swing_is_the_smallest_rotation_between_two_directions(a: tuple[float, ...], b: tuple[float, ...]) -> None:
    source, target = np.array(a), np.array(b)
    if min(np.linalg.norm(source), np.linalg.norm(target)) < 1e-3:
        return
    u, v = source / np.linalg.norm(source), target / np.linalg.norm(target)
    turn = swing(source, target)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(turn @ u, v, atol=1e-7)
    # A rotation by the angle φ has the trace 1 + 2 cos φ.
    assert np.trace(turn) == pytest.approx(1 + 2 * u @ v, abs=1e-6)
    assert np.linalg.det(turn) == pytest.approx(1)


def test_no_axis_no_rotation() -> None:
    np.testing.assert_array_equal(axis_angle(np.zeros(3), 1.0), np.eye(3))


def test_records_of_wrong_shape_are_refused() -> None:
    rig = capsule_man("man")
    with pytest.raises(ValueError, match="before its parent"):
        replace(rig, parents=rig.parents[::-1].copy())
    with pytest.raises(ValueError, match="curl"):
        PoseSet(np.array(["a/0"]), np.tile(np.eye(3), (1, len(KEYS), 1, 1)), np.zeros((2, 2), np.float32))
