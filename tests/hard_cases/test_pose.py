"""Joints that coincide, line up, lie outside or are no numbers."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fig2mesh.image_frame import image_frame
from fig2mesh.mesh.topology import check_solid
from fig2mesh.pose.network import lift_by_network
from fig2mesh.records import Figure
from fig2mesh.skeleton import JOINT_NAMES
from tests.hard_cases.case import Worst, drawn, hard_case
from tests.hard_cases.figures import Job, drawn_mask, figure_of, joints_on, painted, refused, solid_of

MASK = drawn_mask()
PLAIN = joints_on(200, 300)
names = st.sampled_from(JOINT_NAMES)
places = st.tuples(st.floats(0, 200), st.floats(0, 300))

LOST = 0.02
WHY = (
    "the drawn contour wins over whatever the joints say; draft knows it to a pixel of its canvas, 7 mm, which rounds "
    "off fingers and folds"
)


def one_solid(figure: Figure, worst: Worst) -> None:
    made = solid_of(figure)
    report = check_solid(made.mesh)
    assert report.outward
    assert report.components == 1
    worst(1 - made.front_iou())


@given(places)
@drawn(2)
@hard_case(
    "all 21 joints in one point, anywhere on the picture",
    "one closed solid of the drawn outline",
    WHY,
    LOST,
    "(1 − IoU)",
)
def test_all_joints_in_one_point(worst: Worst, place: tuple[float, float]) -> None:
    one_solid(figure_of(MASK, {name: [*place, 1] for name in JOINT_NAMES}), worst)


@given(st.lists(st.tuples(names, names), min_size=1, max_size=4))
@drawn(4)
@hard_case(
    "one to four pairs of joints in one point each, such as elbow and wrist, head and pelvis",
    "one closed solid of the drawn outline",
    WHY,
    LOST,
    "(1 − IoU)",
)
def test_pairs_of_joints_in_one_point(worst: Worst, pairs: list[tuple[str, str]]) -> None:
    one_solid(figure_of(MASK, {**PLAIN, **{first: PLAIN[second] for first, second in pairs}}), worst)


@given(st.integers(0, 179))
@drawn(4)
@hard_case("all joints on one line, at any angle", "one closed solid of the drawn outline", WHY, LOST, "(1 − IoU)")
def test_collinear_joints(worst: Worst, angle: int) -> None:
    along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    middle = np.array([100.0, 150.0])
    joints = {}
    for name, (x, y, _) in PLAIN.items():
        flat = middle + ((np.array([x, y]) - middle) @ along) * along
        joints[name] = [*np.clip(flat, 0, [200, 300]), 1]
    one_solid(figure_of(MASK, joints), worst)


@given(st.lists(places, min_size=21, max_size=21), st.lists(st.booleans(), min_size=21, max_size=21))
@drawn(4)
@hard_case(
    "joints anywhere on the picture, on and off the silhouette, some of them hidden",
    "one closed solid of the drawn outline",
    WHY,
    LOST,
    "(1 − IoU)",
)
def test_joints_off_the_silhouette(worst: Worst, where: list[tuple[float, float]], seen: list[bool]) -> None:
    joints = {name: [*place, int(shown)] for name, place, shown in zip(JOINT_NAMES, where, seen, strict=True)}
    one_solid(figure_of(MASK, joints), worst)


@hard_case("no joint visible", "one closed solid of the drawn outline", WHY, LOST, "(1 − IoU)")
def test_all_joints_hidden(worst: Worst) -> None:
    one_solid(figure_of(MASK, joints_on(200, 300, visible=0)), worst)


@given(st.sampled_from(["point", "line", "anywhere"]), st.lists(places, min_size=21, max_size=21), st.booleans())
@drawn(12)
@hard_case(
    "the same joints, lifted by the network, seen and hidden",
    "x and y exactly as drawn; depth finite and of the size of a body",
    "no joint of a body is farther from its pelvis than its height; joints all over the picture make it taller, twice "
    "at most",
    3.58,
)
def test_depth_of_hard_joints_by_network(worst: Worst, kind: str, where: list[tuple[float, float]], seen: bool) -> None:
    if kind == "point":
        where = [where[0]] * 21
    if kind == "line":
        where = [(where[0][0], y) for _, y in where]
    joints = {name: [*place, int(seen)] for name, place in zip(JOINT_NAMES, where, strict=True)}
    figure = figure_of(MASK, joints)
    frame = image_frame(figure)
    lifted = lift_by_network(figure, frame).joints
    assert np.array_equal(lifted[:, :2], np.asarray(frame.figure_from_image(figure.joints_px), np.float32))
    worst(np.abs(lifted[:, 2]).max())


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["hidden", "line"])
@hard_case(
    "all joints hidden, or on one line; parts and textures by the networks",
    "one closed solid, textured",
    "topology is counted, not measured",
)
def test_hard_joints_with_networks(job: Job, kind: str) -> None:
    joints = {
        "hidden": joints_on(200, 300, visible=0),
        "line": {name: [100, y, 1] for name, (_, y, _) in PLAIN.items()},
    }[kind]
    made = job(painted(MASK), joints, "--parts", "network", "--textures", "wrap")
    assert made.code == 0, made.error
    assert made.measures["watertight"]
    assert made.measures["components"] == 1


@hard_case(
    "a file with all joints in one point",
    "one line, exit code 2, nothing written",
    "no figure has that; the file is normalised, or not annotated",
)
def test_a_file_with_all_joints_in_one_point(job: Job) -> None:
    refused(job(painted(MASK), {name: [100, 150, 1] for name in JOINT_NAMES}), "joints.json", "of one point")


OUTSIDE = {"right of it": [201.5, 10], "above it": [10, -1.5], "far away": [1e8, -1e8]}


@pytest.mark.parametrize("where", OUTSIDE)
@hard_case(
    "a joint two pixels right of, above, and 10⁸ pixels away from the picture",
    "one line with the joint's name, exit code 2, nothing written",
    "up to one pixel outside is an annotator's rounding, and is clipped; more belongs to another picture",
)
def test_joints_outside_of_the_picture(job: Job, where: str) -> None:
    refused(job(painted(MASK), {**PLAIN, "l_elbow": [*OUTSIDE[where], 1]}), "l_elbow", "outside the picture")


@given(st.floats(-1.0, 0.0), st.sampled_from(["l_hand", "head", "pelvis"]))
@drawn(2)
@hard_case(
    "a joint up to a pixel outside",
    "one closed solid of the drawn outline",
    WHY,
    LOST,
    "(1 − IoU)",
)
def test_joints_on_the_edge_of_the_picture(worst: Worst, x: float, name: str) -> None:
    one_solid(figure_of(MASK, {**PLAIN, name: [max(x, 0.0), 10.0, 1]}), worst)


NO_NUMBERS = ["NaN", "Infinity", "-Infinity", "1e999", "null", '"12"', "[1]", "1e400"]


@pytest.mark.parametrize("text", NO_NUMBERS)
@hard_case(
    "a coordinate that is " + ", ".join(NO_NUMBERS),
    "one line with the joint's name, or with the text that is no finite number of JSON, exit code 2, nothing written",
    "no coordinate is guessed",
)
def test_joints_that_are_no_numbers(job: Job, text: str) -> None:
    content = json.dumps({"keypoints": {**PLAIN, "l_knee": ["@", 5, 1]}}).replace('"@"', text)
    refused(job(painted(MASK), content), "l_knee" if text in ("null", '"12"', "[1]") else text)
