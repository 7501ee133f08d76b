"""Joints from maps of likelihood."""

from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.parse.joints import decode, doubts, visible_inside
from fig2mesh.skeleton import JOINT, JOINT_MIRROR
from tests.drawn import JOINTS, SIZE

CELLS = 48
PLACES = np.array([JOINTS[name] for name in JOINT]) / max(SIZE)
"""(21, 2) shares of a square picture."""


def bells(places: np.ndarray, spread: float = 1.0) -> np.ndarray:
    """(21, n, n) likelihoods round places (21, 2)."""
    cell = (np.arange(CELLS) + 0.5) / CELLS
    y = np.exp(-0.5 * ((cell[None, :] - places[:, 1:2]) * CELLS / spread) ** 2)
    x = np.exp(-0.5 * ((cell[None, :] - places[:, 0:1]) * CELLS / spread) ** 2)
    heat = y[:, :, None] * x[:, None, :]
    return (heat / heat.sum(axis=(1, 2), keepdims=True)).astype(np.float32)


def test_places_are_finer_than_cells() -> None:
    places, sure = decode(bells(PLACES), 0.95)
    assert np.abs(places - PLACES).max() * CELLS < 0.1
    assert (sure > 0.85).all()


def test_mirrored_maps_have_mirrored_joints() -> None:
    heat = bells(PLACES) * 0.7 + bells(PLACES[list(JOINT_MIRROR)]) * 0.3
    turned = heat[list(JOINT_MIRROR)][:, :, ::-1]
    places, _ = decode(heat, 0.95)
    other, _ = decode(turned, 0.95)
    assert np.allclose(other[list(JOINT_MIRROR)] * [-1, 1] + [1, 0], places, atol=0.15 / CELLS)


def test_one_joint_of_a_limb_on_the_wrong_side_is_put_back() -> None:
    heat = bells(PLACES)
    left, right = JOINT["l_elbow"], JOINT["r_elbow"]
    # Both sides are about as likely for the elbows alone; the rest of the arm decides.
    heat[[left, right]] = 0.45 * heat[[left, right]] + 0.55 * heat[[right, left]]
    places, _ = decode(heat, 0.95)
    assert np.abs(places - PLACES).max() * CELLS < 0.5


def test_two_hands_are_not_found_at_one_place() -> None:
    heat = bells(PLACES)
    left, right = JOINT["l_wrist"], JOINT["r_wrist"]
    heat[right] = 0.6 * heat[left] + 0.4 * heat[right]
    places, _ = decode(heat, 0.95)
    assert np.abs(places[[left, right]] - PLACES[[left, right]]).max() * CELLS < 0.5


def test_uncertain_maps_are_unlikely() -> None:
    _, sure = decode(np.full((21, CELLS, CELLS), 1 / CELLS**2, np.float32), 0.95)
    assert (sure < 0.05).all()


def test_joints_beside_the_silhouette_move_onto_it() -> None:
    mask = np.zeros((100, 100), bool)
    mask[10:90, 40:60] = True
    joints = np.full((21, 2), 50.0)
    joints[0], joints[1] = (62.5, 50), (90, 50)
    moved = visible_inside(joints, mask, 80)
    assert moved[0].tolist() == [59.5, 50.5]
    assert moved[1].tolist() == [90, 50]  # too far to be a slip
    assert np.array_equal(moved[2:], joints[2:])


@pytest.fixture
def skeleton() -> dict[str, np.ndarray]:
    mask = np.ones((300, 200), bool)
    joints = np.array([JOINTS[name] for name in JOINT], float)
    return {"joints": joints, "sure": np.full(21, 0.9), "visible": np.ones(21, bool), "mask": mask}


def test_a_plausible_skeleton_has_no_doubts(skeleton: dict[str, np.ndarray]) -> None:
    assert doubts(**skeleton) == []


def test_doubts_name_the_joints(skeleton: dict[str, np.ndarray]) -> None:
    skeleton["sure"][JOINT["l_hand"]] = 0.1
    skeleton["mask"][:, :60] = False
    skeleton["joints"][JOINT["l_elbow"]] = 132, 90
    found = "; ".join(doubts(**skeleton))
    assert "unsure of l_hand" in found
    assert "r_elbow" in found
    assert "outside the silhouette" in found
    assert "upper arms of very different lengths" in found


def test_hidden_joints_are_not_doubted(skeleton: dict[str, np.ndarray]) -> None:
    skeleton["sure"][JOINT["l_hand"]] = 0.1
    skeleton["visible"][JOINT["l_hand"]] = False
    assert doubts(**skeleton) == []
