"""Heads: round where they are drawn round, with discs for brims and lobes of their own width."""

from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.parts.heads.frame import HeadFrame, head_frame
from fig2mesh.parts.heads.raised import bounded
from fig2mesh.skeleton import JOINT
from tests.drawn import Assembled, Point, Sketch, assemble

HEAD: Point = (100, 40)
RADIUS = 26


def person(*, crown: bool = False, brim: float = 0.0) -> Sketch:
    sketch = Sketch().legs().arms().trunk().head(RADIUS)
    if crown:
        sketch = sketch.polygon((80, 4), (120, 4), (122, 24), (78, 24))
    if brim:
        sketch = sketch.polygon((100 - brim, 19), (100 + brim, 19), (100 + brim, 27), (100 - brim, 27))
    return sketch


@pytest.fixture(scope="module")
def hatted() -> Assembled:
    return assemble(person(crown=True, brim=52).figure())


def test_round_head_is_a_ball() -> None:
    drawn = assemble(person().figure())
    places = [HEAD, (88, 34), (112, 34), (100, 22)]
    offsets = np.linalg.norm(np.array(places, float) - HEAD, axis=1)
    expected = 2.0 * drawn.length(1.0) * np.sqrt(RADIUS**2 - offsets**2)
    assert drawn.thickness(drawn.at(*places)) == pytest.approx(expected, rel=0.1)


def test_brim_is_a_disc(hatted: Assembled) -> None:
    """Half as deep as it is wide at its middle, and as a circle towards its ends."""
    half = 52.0
    for aside in (0.0, 32.0, 40.0):
        expected = 2.0 * hatted.length(1.0) * np.sqrt(half**2 - aside**2)
        for sign in (-1.0, 1.0):
            thickness = hatted.thickness(hatted.at((100 + sign * aside, 23)))
            assert thickness[0] == pytest.approx(expected, rel=0.15)


def test_crown_is_as_deep_as_wide(hatted: Assembled) -> None:
    thickness = hatted.thickness(hatted.at((100, 12)))
    assert thickness[0] == pytest.approx(hatted.length(41.0), rel=0.2)


def test_hat_changes_nothing_of_the_front(hatted: Assembled) -> None:
    assert hatted.front_iou() > 0.96


def test_hat_is_the_same_on_both_sides(hatted: Assembled) -> None:
    aside = np.arange(6.0, 48.0, 6.0)
    left = hatted.thickness(hatted.at(*[(100 - x, 23.0) for x in aside]))
    right = hatted.thickness(hatted.at(*[(100 + x, 23.0) for x in aside]))
    assert left == pytest.approx(right, rel=0.05)


def test_pony_tail_is_as_deep_as_wide() -> None:
    drawn = assemble(person().capsules((122, 30), (150, 24), (156, 50), width=10).figure())
    assert drawn.thickness(drawn.at((140, 26)))[0] == pytest.approx(drawn.length(10.0), rel=0.35)


def test_ears_are_no_brim() -> None:
    """Below the eyes discs stick out on both sides: what is behind them is as deep as without them."""
    plain = assemble(person().figure())
    eared = assemble(person().disc((72, 44), 7).disc((128, 44), 7).figure())
    middle = [(100.0, 44.0)]
    assert eared.thickness(eared.at(*middle)) == pytest.approx(plain.thickness(plain.at(*middle)), rel=0.1)


def test_frame_of_a_head(hatted: Assembled) -> None:
    frame = head_frame(hatted.outline.canvas, hatted.pose.joints.astype(np.float64))
    assert frame.up == pytest.approx([0.0, 1.0], abs=0.05)
    assert frame.looks == 0
    assert frame.facing == pytest.approx(1.0)
    assert -1.5 * frame.radius <= frame.chin <= -0.9 * frame.radius


def test_frame_of_a_profile() -> None:
    drawn = assemble(Sketch(eyes=(118, 36)).legs().arms().trunk().head(RADIUS).figure())
    joints = drawn.pose.joints.astype(np.float64)
    frame = head_frame(drawn.outline.canvas, joints)
    assert frame.looks == (1 if joints[JOINT["eyes"], 0] > joints[JOINT["head"], 0] else -1)
    assert frame.facing == 0.0


def test_coordinates_of_a_frame_are_inverse() -> None:
    frame = HeadFrame(np.array([0.1, 1.5]), np.array([0.6, 0.8]), 0.1, -0.1, (0.0, 0.0))
    points = np.random.default_rng(0).normal(size=(20, 2))
    across, along = frame.coordinates(points)
    assert frame.points(across, along) == pytest.approx(points)


def test_bound_of_thickness_leaves_small_ones() -> None:
    half = np.array([0.1, 0.5, 1.0, 10.0])
    result = np.sqrt(bounded(half**2, 1.0))
    assert result[:2] == pytest.approx(half[:2], rel=0.002)
    assert (result <= 1.0).all()
    assert (np.diff(result) > 0).all()
