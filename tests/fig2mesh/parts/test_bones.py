"""The bones that a layer's middle follows."""

from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.image_frame import image_frame
from fig2mesh.parts.bones import AT_HEM, MAX_CLOTH_SLOPE, MAX_SLOPE, Bones, core_bones, hem_depth, out_of_cloth, slopes2
from fig2mesh.parts.canvas import Canvas, make_canvas
from fig2mesh.parts.depth import mid_surface
from fig2mesh.parts.limbs import make_limb
from fig2mesh.parts.split import Split, head_radius, split
from fig2mesh.pose.prior import lift
from fig2mesh.records import Figure
from fig2mesh.skeleton import JOINT
from tests.drawn import Sketch


def divided(figure: Figure, **depths: float) -> tuple[Canvas, Split, np.ndarray]:
    """Canvas, split and (21, 3) joints of a figure whose named joints lie at these FIGURE z."""
    frame = image_frame(figure)
    joints = lift(figure, frame).joints.astype(np.float64)
    for name, depth in depths.items():
        joints[JOINT[name], 2] = depth
    canvas = make_canvas(figure, frame, 160)
    return canvas, split(canvas, joints, figure.visible), joints


def whole() -> Figure:
    return Sketch().legs().trunk().arms().head().figure()


def skirt() -> Figure:
    sketch = Sketch().legs().trunk().arms().head().polygon((84, 140), (116, 140), (150, 235), (50, 235))
    return sketch.figure(hidden=("l_knee", "r_knee"))


def chain(slope: float, count: int = 9) -> tuple[np.ndarray, np.ndarray]:
    """Points and depths of a straight chain askew in the drawing that runs in depth with this slope."""
    along = np.linspace(0.0, 0.5, count)
    return along[:, None] * [0.6, -0.8], slope * along


@pytest.mark.parametrize("slope", [0.0, 0.5, 1.0, -1.0])
def test_squared_slope_of_a_straight_chain(slope: float) -> None:
    """1 at 45 degrees: such a limb is √2 times as deep along the line of sight as across."""
    np.testing.assert_allclose(slopes2(*chain(slope)), slope**2, atol=1e-12)


def test_squared_slope_does_not_depend_on_direction_or_sampling() -> None:
    points, depth = chain(0.7)
    np.testing.assert_allclose(slopes2(points[::-1], depth[::-1]), slopes2(points, depth)[::-1])
    fine = slopes2(*chain(0.7, 40))
    assert fine == pytest.approx(0.49)


def test_squared_slope_is_bounded_and_defined_for_bones_of_no_length() -> None:
    """A forearm that points at the viewer is drawn as a dot: its slope has no end."""
    dot = slopes2(np.zeros((5, 2)), np.linspace(0.0, 0.3, 5))
    assert np.isfinite(dot).all()
    np.testing.assert_allclose(dot, MAX_SLOPE**2)
    np.testing.assert_allclose(slopes2(*chain(20.0)), MAX_SLOPE**2)
    assert slopes2(np.zeros((1, 2)), np.zeros(1)).tolist() == [0.0]


def test_bones_of_a_limb_add_up() -> None:
    _, _, joints = divided(whole(), l_elbow=0.1, l_wrist=0.2)
    arms = [Bones.of(make_limb(f"{side}_arm", joints, np.ones(21, bool))) for side in "lr"]
    both = arms[0] + arms[1]
    assert len(both.points) == len(both.depth) == len(both.slope2) == sum(len(arm.points) for arm in arms)
    np.testing.assert_array_equal(both.depth[: len(arms[0].depth)], arms[0].depth)


@pytest.mark.parametrize("lean", [-0.2, 0.15])
def test_a_head_is_equally_deep_everywhere_however_the_neck_leans(lean: float) -> None:
    """Else a head over a leaning neck would be sheared into an egg."""
    canvas, parts, joints = divided(whole(), head=lean, neck=lean / 3)
    bones = core_bones(canvas, parts, joints)
    middle = joints[JOINT["head"]]
    away = np.linalg.norm(bones.points - middle[:2], axis=1)
    radius = head_radius(canvas, joints)
    on_head = away < 0.9 * radius
    assert on_head.sum() >= 5
    assert np.ptp(bones.depth[on_head]) == 0.0
    assert bones.depth[on_head][0] == lean
    assert not bones.slope2[on_head].any()
    # And so is the surface interpolated from them, all but where the neck begins.
    surface = mid_surface(canvas, bones.points, bones.depth)
    points = canvas.points()
    head = (np.linalg.norm(points - middle[:2], axis=-1) < 0.7 * radius) & (points[..., 1] > middle[1])
    assert np.ptp(surface[head]) < 0.1 * abs(lean)
    assert surface[head].mean() == pytest.approx(lean, rel=0.15)


def test_core_bones_run_along_the_spine_and_the_limbs_of_the_core() -> None:
    canvas, parts, joints = divided(whole(), l_elbow=0.1, l_wrist=0.25, l_hand=0.25)
    assert [layer.name for layer in parts.layers] == ["core"]
    bones = core_bones(canvas, parts, joints)
    assert bones.points.shape == (len(bones.depth), 2)
    assert bones.slope2.shape == bones.depth.shape
    assert (bones.slope2 >= 0).all()
    assert (bones.slope2 <= MAX_SLOPE**2).all()
    wrist = joints[JOINT["l_wrist"]]
    nearest = np.argmin(np.linalg.norm(bones.points - wrist[:2], axis=1))
    assert bones.depth[nearest] == pytest.approx(wrist[2], abs=0.02)
    joints_before = joints.copy()
    core_bones(canvas, parts, joints)
    np.testing.assert_array_equal(joints, joints_before)


def test_a_limb_that_is_a_layer_does_not_pull_the_core() -> None:
    sketch = Sketch(l_elbow=(140, 130), l_wrist=(100, 140), l_hand=(90, 140)).legs().trunk().arms().head()
    canvas, parts, joints = divided(sketch.figure(), l_elbow=0.3, l_wrist=0.5, l_hand=0.5)
    assert "l_arm" in [layer.name for layer in parts.layers]
    assert core_bones(canvas, parts, joints).depth.max() < 0.2


@pytest.mark.parametrize("forward", [-0.4, 0.0, 0.02, 0.4])
def test_cloth_hangs_nearly_plumb(forward: float) -> None:
    """Its hem follows the legs that come out of it, within what cloth leans."""
    depths = {f"{side}_{joint}": forward for side in "lr" for joint in ("knee", "ankle", "foot")}
    canvas, parts, joints = divided(skirt(), **depths)
    assert parts.garment.any()
    assert any(limb.cloth for limb in parts.limbs)
    hem = hem_depth(parts, joints, 0.0, 0.6)
    assert abs(hem) <= MAX_CLOTH_SLOPE * 0.6 + 1e-12
    assert np.sign(hem) == np.sign(forward)
    bones = core_bones(canvas, parts, joints)
    below = bones.points[:, 1] < joints[JOINT["l_hip"], 1] - 0.1
    assert np.abs(bones.depth[below]).max() <= MAX_CLOTH_SLOPE * 0.7


def test_without_legs_below_cloth_hangs_plumb() -> None:
    _, parts, joints = divided(whole())
    assert hem_depth(parts, joints, 0.03, 0.6) == 0.03


@pytest.mark.parametrize("forward", [-0.4, 0.4])
def test_a_leg_leaves_its_garment_inside_of_it(forward: float) -> None:
    depths = {f"{side}_{joint}": forward for side in "lr" for joint in ("knee", "ankle", "foot")}
    canvas, parts, joints = divided(skirt(), **depths)
    rows = np.flatnonzero(parts.garment.any(axis=1))
    widest = canvas.pitch * parts.garment.sum(axis=1).max()
    drop = canvas.pitch * len(rows)
    for limb in parts.limbs:
        moved = out_of_cloth(limb, canvas, parts, joints)
        if not limb.cloth:
            assert moved is limb
            continue
        assert abs(moved.depth[0]) <= MAX_CLOTH_SLOPE * drop + AT_HEM * widest / 2
        np.testing.assert_allclose(np.diff(moved.depth), np.diff(limb.depth), atol=1e-12)
