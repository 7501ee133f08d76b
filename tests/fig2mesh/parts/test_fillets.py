"""Fillets: between kinematic neighbours of different layers, inside the drawing, never against it."""

from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.field.analytic import capsule, sample
from fig2mesh.field.body import Body
from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.fillets import RADIUS, make_fillets
from fig2mesh.records import PartSdf
from fig2mesh.skeleton import PART

PITCH = 0.01
HALF = 0.5


def canvas(right: float = HALF) -> Canvas:
    """A wide drawing whose contour on the right is the line x = `right`."""
    count = round(2 * HALF / PITCH) + 1
    x = -HALF + PITCH * np.arange(count)
    sdf = np.broadcast_to(x - right, (count, count)).copy()
    return Canvas(sdf, np.zeros(sdf.shape, np.uint8), (-HALF, HALF), PITCH)


def bar(name: str, start: tuple[float, float, float], end: tuple[float, float, float], radius: float) -> PartSdf:
    return sample(capsule(start, end, radius), PART[name], (0.0, 0.0, 0.0), 1.2, 72)


TRUNK = bar("torso", (0.0, -0.3, 0.0), (0.0, 0.3, 0.0), 0.12)
ARM = bar("l_upper_arm", (0.0, 0.2, 0.0), (0.35, 0.2, 0.0), 0.06)
HAND = bar("l_hand", (0.0, -0.1, 0.14), (0.3, -0.1, 0.14), 0.06)
POINTS = np.random.default_rng(0).uniform(-0.45, 0.45, (40_000, 3))


def lowered(body: Body) -> np.ndarray:
    """By how much fillets lower the field at `POINTS`."""
    return np.asarray(Body(body.parts).evaluate(POINTS)[0] - body.evaluate(POINTS)[0])


def test_neighbours_of_different_layers_melt_together() -> None:
    fillets = make_fillets(canvas(), (TRUNK, ARM), (0, 1))
    assert [(first, second) for first, second, _ in fillets] == [(0, 1)]
    change = lowered(Body((TRUNK, ARM), fillets=fillets))
    assert change.max() > 0.1 * RADIUS
    armpit = np.array([[0.125, 0.135, 0.0]])
    assert Body((TRUNK, ARM)).distance(armpit)[0] > 0
    assert Body((TRUNK, ARM), fillets=fillets).distance(armpit)[0] < 0


@pytest.mark.parametrize(
    ("parts", "layers"),
    [((TRUNK, ARM), (0, 0)), ((TRUNK, HAND), (0, 1)), ((ARM, HAND), (0, 1))],
    ids=["one layer", "hand on the trunk", "hand on its own upper arm"],
)
def test_others_keep_their_crease(parts: tuple[PartSdf, ...], layers: tuple[int, ...]) -> None:
    assert make_fillets(canvas(), parts, layers) == ()


def test_order_of_the_parts_does_not_matter() -> None:
    assert [f[:2] for f in make_fillets(canvas(), (HAND, ARM, TRUNK), (1, 1, 0))] == [(1, 2)]


def test_neighbours_that_do_not_touch_have_no_fillet() -> None:
    away = bar("l_upper_arm", (0.3, 0.2, 0.0), (0.4, 0.2, 0.0), 0.06)
    assert make_fillets(canvas(), (TRUNK, away), (0, 1)) == ()


def test_a_fillet_takes_nothing_away_and_adds_a_quarter_of_its_radius_at_most() -> None:
    fillets = make_fillets(canvas(), (TRUNK, ARM), (0, 1))
    change = lowered(Body((TRUNK, ARM), fillets=fillets))
    assert change.min() >= 0.0
    near = np.abs(Body((TRUNK, ARM)).evaluate(POINTS)[0]) < 0.02
    # And what interpolation on the grid adds.
    assert change[near].max() < 0.25 * RADIUS + 0.15 * TRUNK.spacing


def test_a_fillet_vanishes_at_the_drawn_contour() -> None:
    """The silhouette is the drawing's: where the contour runs through the armpit nothing is added to it."""
    contour = 0.15
    free, held = (Body((TRUNK, ARM), fillets=make_fillets(canvas(x), (TRUNK, ARM), (0, 1))) for x in (HALF, contour))
    plain = Body((TRUNK, ARM))
    beyond = POINTS[:, 0] > contour
    outside = beyond & (plain.evaluate(POINTS)[0] > 0)
    assert ((plain.evaluate(POINTS)[0] - free.evaluate(POINTS)[0])[outside] > 0).any(), "without it something is added"
    assert (held.evaluate(POINTS)[0][outside] > 0).all()
    # Well inside the contour it is as without it.
    within = POINTS[:, 0] < contour - 1.2 * RADIUS
    np.testing.assert_allclose(held.evaluate(POINTS)[0][within], free.evaluate(POINTS)[0][within], atol=1e-6)


def test_thin_parts_have_small_fillets() -> None:
    """A fillet as wide as a finger would bury it."""
    radius = 0.012
    finger = sample(
        capsule((0.0, 0.2, 0.0), (0.35, 0.2, 0.0), radius), PART["l_upper_arm"], (0.175, 0.2, 0.0), 0.45, 110
    )
    fillets = make_fillets(canvas(), (TRUNK, finger), (0, 1))
    plain, blended = Body((TRUNK, finger)), Body((TRUNK, finger), fillets=fillets)
    gained = plain.evaluate(POINTS)[0] - blended.evaluate(POINTS)[0]
    near = np.abs(plain.evaluate(POINTS)[0]) < 0.02
    assert gained[near].max() <= 0.25 * radius + 0.15 * TRUNK.spacing
