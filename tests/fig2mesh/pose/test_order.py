"""Limbs that the user puts before or behind the body."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fig2mesh.pose.order import ordered
from fig2mesh.records import DepthOrder, Figure, Pose3D
from fig2mesh.skeleton import JOINT, LIMB_JOINTS, LIMBS

POSES = arrays(np.float32, (21, 3), elements=st.floats(-0.875, 0.875, width=32)).map(Pose3D)
ORDERS = st.dictionaries(st.sampled_from(LIMBS), st.sampled_from(["front", "behind"]))


@given(POSES, ORDERS)
def test_only_the_depth_of_the_limbs_named_changes_and_has_the_sign_asked_for(
    pose: Pose3D, order: dict[str, DepthOrder]
) -> None:
    result = ordered(pose, order).joints
    assert np.array_equal(result[:, :2], pose.joints[:, :2])
    moved = set()
    for limb, where in order.items():
        side, kind = limb.split("_")
        chain = [JOINT[f"{side}_{name}"] for name in LIMB_JOINTS[kind]]
        moved |= set(chain[1:])
        away = (result[chain[1:], 2] - result[chain[0], 2]) * (1 if where == "front" else -1)
        assert (away >= 0.0799).all()
        assert (np.diff(away) >= -1e-6).all()
    still = [joint for joint in range(21) if joint not in moved]
    assert np.array_equal(result[still], pose.joints[still])


@given(POSES, ORDERS)
def test_front_and_behind_mirror_each_other_and_twice_is_once(pose: Pose3D, order: dict[str, DepthOrder]) -> None:
    once = ordered(pose, order)
    np.testing.assert_allclose(ordered(once, order).joints, once.joints, atol=1e-6)
    opposite: dict[str, DepthOrder] = {k: "behind" if v == "front" else "front" for k, v in order.items()}
    turned = ordered(pose, opposite).joints
    for limb in order:
        side, kind = limb.split("_")
        chain = [JOINT[f"{side}_{name}"] for name in LIMB_JOINTS[kind]]
        root = pose.joints[chain[0], 2]
        np.testing.assert_allclose(turned[chain, 2] - root, root - once.joints[chain, 2], atol=1e-5)


def test_figures_refuse_other_limbs() -> None:
    with pytest.raises(ValueError, match="depth_order"):
        Figure(
            "",
            np.zeros((1, 1, 4)),
            np.ones((1, 1)),
            np.zeros((21, 2)),
            np.ones(21),
            np.zeros((1, 1)),
            {"tail": "front"},
        )
