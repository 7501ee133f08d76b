"""Kinds of parts: every part has one, and right parts are left ones in the mirror."""

from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.skeleton import (
    ANCHORS,
    BODY_PARTS,
    JOINT,
    JOINT_MIRROR,
    JOINT_NAMES,
    KINDS,
    MIRRORED,
    PART,
    PART_KIND,
    anchor_joints,
    part_centre,
)


def test_fourteen_parts_are_of_eight_kinds() -> None:
    assert list(PART_KIND) == list(MIRRORED) == list(BODY_PARTS)
    assert set(PART_KIND.values()) == set(KINDS) == set(ANCHORS)
    count = {kind: sum(k == kind for k in PART_KIND.values()) for kind in KINDS}
    assert count == {kind: 1 if kind in ("torso", "head") else 2 for kind in KINDS}
    assert sum(MIRRORED.values()) == 6


def test_the_mirror_swaps_sides_and_comes_back() -> None:
    assert [JOINT_MIRROR[k] for k in JOINT_MIRROR] == list(range(21))
    assert JOINT_NAMES[JOINT_MIRROR[JOINT["l_elbow"]]] == "r_elbow"
    assert JOINT_MIRROR[JOINT["neck"]] == JOINT["neck"]


@pytest.mark.parametrize("part", BODY_PARTS)
def test_anchors_and_centre_of_a_mirrored_figure_are_mirrored(part: int) -> None:
    joints = np.random.default_rng(part).normal(size=(5, 21, 3))
    flip = np.array([-1.0, 1, 1])
    mirrored = joints[:, list(JOINT_MIRROR)] * flip
    kind, paired = PART_KIND[part], PART_KIND[part] not in ("torso", "head")
    twin = next((p for p in BODY_PARTS if PART_KIND[p] == kind and p != part), part)
    assert MIRRORED[twin] != MIRRORED[part] or not paired
    expected = joints[:, list(anchor_joints(part))] * flip
    found = mirrored[:, list(anchor_joints(twin))]
    if kind == "torso":  # one part of both sides: its anchors swap
        found = found[:, [1, 0, 3, 2]]
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_allclose(part_centre(twin, mirrored), part_centre(part, joints) * flip)


def test_centres_lie_between_the_anchors_but_for_the_head() -> None:
    joints = np.random.default_rng(0).normal(size=(21, 3))
    np.testing.assert_array_equal(part_centre(PART["head"], joints), joints[JOINT["head"]])
    middle = (joints[JOINT["r_knee"]] + joints[JOINT["r_ankle"]]) / 2
    np.testing.assert_allclose(part_centre(PART["r_lower_leg"], joints), middle)
    corners = [JOINT[f"{side}_{name}"] for name in ("shoulder", "hip") for side in "lr"]
    np.testing.assert_allclose(part_centre(PART["torso"], joints), joints[corners].mean(axis=0))
