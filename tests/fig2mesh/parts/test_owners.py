"""Assignment of the pixels of a silhouette to layers: laws on a disc (the core) and a bar (a limb) across it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.limbs import Limb
from fig2mesh.parts.owners import owners
from fig2mesh.skeleton import PART

PITCH = 0.01
COUNT = 101
AXIS = PITCH * (np.arange(COUNT) - COUNT // 2)
X, Y = np.meshgrid(AXIS, -AXIS)
POINTS = np.stack([X, Y], axis=-1)


def canvas(sdf: NDArray[np.float64], labels: NDArray[np.uint8] | None = None) -> Canvas:
    return Canvas(sdf, np.zeros(sdf.shape, np.uint8) if labels is None else labels, (AXIS[0], -AXIS[0]), PITCH)


def bar(start: tuple[float, float], end: tuple[float, float], radius: float, *, seen: bool = True) -> Limb:
    """An arm along a line."""
    count = 30
    points = np.linspace(start, end, count)
    part = np.repeat(np.array([PART["l_upper_arm"], PART["l_lower_arm"], PART["l_hand"]], np.uint8), count // 3)
    radii, both = np.full(count, radius), np.ones((count, 2), bool)
    return Limb(
        "l_arm",
        points,
        np.zeros(count),
        radii,
        radii,
        part,
        both,
        both,
        np.full((count, 2), radius),
        np.full(count, seen),
    )


def disc(x: float, y: float, radius: float) -> NDArray[np.float64]:
    return np.asarray(np.hypot(X - x, Y - y) - radius)


ARM = bar((-0.4, 0.0), (0.4, 0.0), 0.06)
CORE = disc(0, 0, 0.3)


def along(limb: Limb) -> NDArray[np.float64]:
    return limb.excess(POINTS)[0]


def test_every_pixel_of_the_silhouette_has_one_owner() -> None:
    sheet = canvas(np.minimum(CORE, along(ARM)))
    owner = owners(sheet, CORE, [ARM], POINTS)
    assert ((owner == -1) == ~sheet.inside).all()
    assert set(np.unique(owner)) == {-1, 0, 1}


def test_a_limb_that_shows_owns_what_lies_before_the_core() -> None:
    owner = owners(canvas(np.minimum(CORE, along(ARM))), CORE, [ARM], POINTS)
    assert (owner[along(ARM) < 0] == 1).all()
    assert (owner[(CORE < 0) & (along(ARM) > 0.5 * 0.06)] == 0).all()


def test_a_hidden_limb_owns_only_what_sticks_out() -> None:
    hidden = replace(ARM, seen=np.zeros(30, bool))
    owner = owners(canvas(np.minimum(CORE, along(ARM))), CORE, [hidden], POINTS)
    assert (owner[CORE < -PITCH] == 0).all()
    assert (owner[(along(ARM) < 0) & (CORE > PITCH)] == 1).all()


def test_a_head_beyond_the_hand_before_its_neck_stays_with_the_core() -> None:
    """The arm cuts the core in two; both are along the core's bones, and both are core."""
    trunk, head = disc(0, -0.3, 0.2), disc(0, 0.22, 0.17)
    core = np.minimum(trunk, head)
    whole = np.minimum(core, along(ARM))
    owner = owners(canvas(whole), core, [ARM], POINTS)
    assert (owner[head < -2 * PITCH][Y[head < -2 * PITCH] > 0.12] == 0).all()
    assert ndimage.label(owner == 0)[1] == 2


def test_crumbs_go_to_the_layer_around_them() -> None:
    """A wide arm leaves a sliver of the core's bones beyond it: too small to be more than a fault of the split."""
    core = np.minimum(disc(0, -0.3, 0.2), disc(0, 0.09, 0.02))
    owner = owners(canvas(np.minimum(core, along(ARM))), core, [ARM], POINTS)
    assert ndimage.label(owner == 0, np.ones((3, 3)))[1] == 1
    assert owner[np.argmin(disc(0, 0.09, 0.0).min(axis=1)), COUNT // 2] != 0


@pytest.mark.parametrize(("place", "expected"), [((0.38, 0.1), 1), ((0.0, -0.32), 0)], ids=["bag", "skirt"])
def test_what_nobody_claims_goes_to_its_neighbour(place: tuple[float, float], expected: int) -> None:
    """Bags to the hand that holds them, cloth to the body that it hangs on."""
    thing = disc(*place, 0.07)
    sheet = canvas(np.minimum(np.minimum(CORE, along(ARM)), thing))
    owner = owners(sheet, CORE, [ARM], POINTS)
    alone = (thing < 0) & (CORE > 2 * PITCH) & (along(ARM) > 2 * PITCH)
    assert alone.any()
    assert (owner[alone] == expected).all()


def test_a_large_thing_that_also_touches_the_body_is_the_bodys() -> None:
    cape = np.maximum(np.abs(X - 0.1) - 0.28, np.abs(Y + 0.22) - 0.2)
    owner = owners(canvas(np.minimum(np.minimum(CORE, along(ARM)), cape)), CORE, [ARM], POINTS)
    assert owner[np.unravel_index(np.argmin(np.hypot(X - 0.3, Y + 0.35)), X.shape)] == 0


def test_labels_of_the_user_win_except_for_extras() -> None:
    sheet = canvas(np.minimum(CORE, along(ARM)))
    labels = np.zeros(X.shape, np.uint8)
    before, beside = (along(ARM) < 0) & (np.abs(X) < 0.15), sheet.inside & (Y > 0.12)
    labels[before], labels[beside] = PART["torso"], PART["l_hand"]
    owner = owners(canvas(sheet.sdf, labels), CORE, [ARM], POINTS)
    assert (owner[before] == 0).mean() > 0.95
    # Unless that leaves an island: the part of an arm that does not hang together goes back.
    assert set(np.unique(owner[beside])) <= {0, 1}
    labels[:] = 0
    labels[before] = PART["hair"]
    extra = owners(canvas(sheet.sdf, labels), CORE, [ARM], POINTS)
    np.testing.assert_array_equal(extra, owners(sheet, CORE, [ARM], POINTS))


def test_of_two_limbs_the_nearer_bone_owns() -> None:
    other = replace(bar((0.0, 0.4), (0.0, -0.4), 0.06), name="r_arm")
    sheet = canvas(np.minimum(np.minimum(CORE, along(ARM)), along(other)))
    owner = owners(sheet, CORE, [ARM, other], POINTS)
    first, second = along(ARM), along(other)
    assert (owner[(first < 0) & (second > 0.03)] == 1).all()
    assert (owner[(second < 0) & (first > 0.03)] == 2).all()


def test_the_core_alone_owns_everything() -> None:
    sheet = canvas(CORE)
    assert ((owners(sheet, CORE, [], POINTS) == 0) == sheet.inside).all()
