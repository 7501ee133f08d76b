"""Held things that are labelled: solids of their own, as deep as wide, at the depth of what they touch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fig2mesh.measure.solid import inner_shells
from fig2mesh.mesh.topology import check_solid
from fig2mesh.parts.props import find_props, prop_depth
from fig2mesh.skeleton import JOINT, PART
from tests.drawn import Assembled, Sketch, assemble

STAFF = 8.0
HAND = (178.0, 150.0)
BAG = ((82.0, 112.0), (118.0, 112.0), (118.0, 152.0), (82.0, 152.0))


def labelled(plain: Sketch, things: Sketch, label: str = "prop", depths: dict[str, float] | None = None) -> Assembled:
    """A figure with what `things` draws on a sheet of its own, over the plain figure."""
    figure = plain.figure()
    thing = np.asarray(things.image) > 127
    mask = figure.mask | thing
    rgba = np.where(mask[..., None], np.array([200, 160, 140, 255], np.uint8), np.uint8(0))
    labels = np.where(thing, np.uint8(PART[label]), np.uint8(0))
    return assemble(replace(figure, rgba=rgba, mask=mask, part_labels=labels), depths)


def whole() -> Sketch:
    return Sketch().legs().trunk().arms().head()


def staff(depth: float = 0.25) -> Assembled:
    """A staff from above the head to the ground, in a hand that reaches forward; the fist is drawn over it."""
    things = Sketch().capsules((178, 30), (178, 285), width=STAFF).disc(HAND, 12, ink=0)
    return labelled(whole().disc(HAND, 12), things, depths={"l_elbow": depth / 2, "l_wrist": depth, "l_hand": depth})


def of_part(figure: Assembled, part: str) -> NDArray[np.float64]:
    """(3, 2) bounds of a part's field."""
    field = next(field for field in figure.outline.parts if field.part == PART[part])
    points = field.origin + field.spacing * np.argwhere(field.grid < 0)
    return np.stack([points.min(axis=0), points.max(axis=0)], axis=1)


@pytest.mark.parametrize("depth", [-0.2, 0.0, 0.25])
def test_a_staff_is_a_rod_in_the_hand_that_holds_it(depth: float) -> None:
    figure = staff(depth)
    assert check_solid(figure.mesh).outward
    assert check_solid(figure.mesh).components == 1
    assert inner_shells(figure.mesh) == 0
    assert figure.front_iou() > 0.97
    low, high = of_part(figure, "prop")[2]
    thick = figure.length(STAFF)
    assert high - low == pytest.approx(thick, abs=0.4 * thick)
    assert (low + high) / 2 == pytest.approx(figure.pose.joints[JOINT["l_hand"], 2], abs=0.03)


def test_a_rod_goes_on_in_the_fist() -> None:
    props = find_props(staff().outline.canvas)
    assert len(props) == 1
    assert props[0].region.sum() > props[0].shown.sum()


def test_without_the_label_a_staff_is_no_part_of_its_own() -> None:
    things = Sketch().capsules((178, 30), (178, 285), width=STAFF)
    figure = labelled(whole(), things, label="none")
    assert all(part.part != PART["prop"] for part in figure.outline.parts)


def test_a_bag_before_the_belly_lies_before_it_and_holds() -> None:
    figure = labelled(whole(), Sketch().polygon(*BAG))
    bare = assemble(whole().figure())
    assert check_solid(figure.mesh).components == 1
    middle = figure.at((100, 132))
    assert figure.thickness(middle)[0] > 1.2 * bare.thickness(middle)[0]
    assert of_part(figure, "prop")[2].mean() > of_part(bare, "torso")[2].mean() + 0.05
    # Behind it the trunk is what it was.
    np.testing.assert_allclose(of_part(figure, "torso"), of_part(bare, "torso"), atol=0.02)


def test_a_thing_that_touches_nothing_lies_at_the_pelvis() -> None:
    nothing = np.full((20, 20), np.nan)
    half = np.zeros((20, 20))
    half[5:8, 5:8] = 0.1
    assert prop_depth(half, half > 0, [(nothing, nothing)]) == 0.0


def test_a_thing_beside_the_body_is_as_deep_as_what_it_touches() -> None:
    half, front, back = np.zeros((20, 20)), np.full((20, 20), np.nan), np.full((20, 20), np.nan)
    half[5:15, 10:14] = 0.1
    front[5:15, 2:10], back[5:15, 2:10] = 0.4, 0.2
    assert prop_depth(half, half > 0, [(front, back)]) == pytest.approx(0.3)
