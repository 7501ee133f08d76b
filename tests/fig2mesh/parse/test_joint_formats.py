"""Joints in the files of annotation tools: round trips, names, what is missing, what is damaged."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fig2mesh.errors import FigureError
from fig2mesh.parse.joint_names import canonical
from fig2mesh.parse.joint_writers import LONG_NAMES, WRITERS
from fig2mesh.parse.keypoints import read_keypoints
from fig2mesh.skeleton import BONES, JOINT, JOINT_NAMES
from tests.drawn import JOINTS

DRAWN = np.array([JOINTS[name] for name in JOINT_NAMES], np.float32)
SEEN = np.array([name not in ("l_hand", "r_hip") for name in JOINT_NAMES])

# fmt: off
COCO_17 = (
    "nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder", "left_elbow",
    "right_elbow", "left_wrist", "right_wrist", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle",
    "right_ankle",
)
# fmt: on
"""The names of COCO's person category: https://cocodataset.org/#keypoints-2020"""


def saved(tmp_path: Path, content: Any) -> Path:
    path = tmp_path / "joints.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


@pytest.mark.parametrize("kind", WRITERS)
@given(data=st.data())
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_round_trip(kind: str, data: st.DataObject, tmp_path: Path) -> None:
    coordinates = st.integers(0, 900000).map(lambda hundredths: hundredths / 100)
    values = data.draw(st.lists(coordinates, min_size=42, max_size=42))
    joints = np.array(values, np.float32).reshape(21, 2)
    visible = np.array(data.draw(st.lists(st.booleans(), min_size=21, max_size=21)))
    path = saved(tmp_path, WRITERS[kind](joints, visible, (9000, 9000), "figure.png"))
    again = read_keypoints(path, "figure.png")
    assert np.abs(again.points_px - joints).max() <= 0.006  # hundredths, and float32 at 9000
    assert np.array_equal(again.visible, visible)
    assert again.size == (9000, 9000)


def test_every_bone_joins_two_joints_and_all_are_joined() -> None:
    assert len(BONES) == len(JOINT_NAMES) - 1
    reached = {"head"}
    for _ in BONES:
        reached |= {name for bone in BONES if reached & set(bone) for name in bone}
    assert reached == set(JOINT_NAMES)


@pytest.mark.parametrize(
    ("written", "ours"),
    [
        ("Left Shoulder", "l_shoulder"),
        ("leftShoulder", "l_shoulder"),
        ("shoulder_r", "r_shoulder"),
        ("RIGHT-KNEE", "r_knee"),
        ("L Toe", "l_foot"),
        ("hip", "pelvis"),
        ("left hip", "l_hip"),
        ("chest", "thorax"),
        ("left_foot_index", "l_foot"),
        ("eyes", "eyes"),
        ("left_eye", "l_eye"),
        ("Head", "head"),
        ("hat", "hat"),
    ],
)
def test_names(written: str, ours: str) -> None:
    assert canonical(written) == ours


@pytest.mark.parametrize("name", [*JOINT_NAMES, *LONG_NAMES])
def test_our_own_names_are_known_both_ways(name: str) -> None:
    assert canonical(name) in JOINT_NAMES


def coco_17(tmp_path: Path, figures: int = 1, **annotation: Any) -> Path:
    points = {canonical(name): (10.0 * i, 300.0) for i, name in enumerate(COCO_17)}
    points |= {name: xy for name, xy in JOINTS.items() if name in points}
    points |= {"nose": (100, 38), "l_eye": (104, 36), "r_eye": (96, 36), "l_ear": (110, 40), "r_ear": (90, 40)}
    flat = [value for name in COCO_17 for value in (*points[canonical(name)], 2)]
    shifted = [
        {"image_id": 7, "category_id": 1, "keypoints": [v + 300 * n * (i % 3 == 0) for i, v in enumerate(flat)]}
        for n in range(figures)
    ]
    content = {
        "images": [{"id": 7, "file_name": "x/figure.png", "width": 900, "height": 300}, {"id": 8, "file_name": "b"}],
        "categories": [{"id": 1, "name": "person", "keypoints": list(COCO_17)}],
        "annotations": [{**shifted[0], **annotation}, *shifted[1:], {"image_id": 8, "keypoints": [0, 0, 0] * 17}],
    }
    return saved(tmp_path, content)


def test_joints_that_coco_lacks_follow_from_those_it_has_and_count_as_hidden(tmp_path: Path) -> None:
    found = read_keypoints(coco_17(tmp_path), "figure.png")
    assert found.size == (900, 300)
    height = DRAWN[:, 1].max() - DRAWN[:, 1].min()
    assert np.linalg.norm(found.points_px - DRAWN, axis=1).max() < 0.06 * height
    assert not found.visible[[JOINT[name] for name in ("neck", "thorax", "pelvis", "l_hand", "r_foot")]].any()
    assert found.visible[[JOINT[name] for name in ("l_wrist", "r_ankle")]].all()


def test_the_box_chooses_among_figures(tmp_path: Path) -> None:
    path = coco_17(tmp_path, figures=3)
    with pytest.raises(FigureError, match="3 figures; pass --bbox"):
        read_keypoints(path, "figure.png")
    chosen = read_keypoints(path, "figure.png", (300, 0, 500, 300))
    assert 300 < chosen.points_px[JOINT["pelvis"], 0] < 500


def test_tools_that_have_points_by_identifier(tmp_path: Path) -> None:
    nodes = {f"b1f0-{i}": {"loc": list(xy), "label": name} for i, (name, xy) in enumerate(JOINTS.items())}
    content = {"size": {"width": 200, "height": 300}, "objects": [{"geometryType": "graph", "nodes": nodes}]}
    found = read_keypoints(saved(tmp_path, content))
    assert np.array_equal(found.points_px, DRAWN)
    assert found.visible.all()


def test_other_shapes_in_the_file_do_not_matter(tmp_path: Path) -> None:
    content = WRITERS["labelme"](DRAWN, SEEN, (200, 300), "a.png")
    content["shapes"] += [
        {"label": "river", "points": [[0, 0], [1, 1], [2, 0]], "shape_type": "polygon"},
        {"label": "church", "points": [[5, 5]], "shape_type": "point"},
    ]
    found = read_keypoints(saved(tmp_path, content))
    assert np.array_equal(found.points_px, DRAWN)
    assert np.array_equal(found.visible, SEEN)


@pytest.mark.parametrize(
    ("content", "finding"),
    [
        ({"shapes": []}, "no joints with known names"),
        ({"annotations": [{"keypoints": [1, 2]}], "categories": [{"keypoints": ["nose"]}]}, "2 numbers for 1"),
        ({"shapes": [{"label": "head", "points": [[1, float("nan")]]}]}, "NaN is not a number"),
        ({"shapes": [{"label": "head", "points": []}]}, "without coordinates"),
        ({"shapes": [{"label": "head", "points": [[1, 2]]}] * 2}, "head twice"),
        ({"shapes": [{"label": "head", "points": [[1, 2]]}]}, "joints missing: neck, thorax, pelvis"),
        ({"objects": [{"geometryType": "point", "classTitle": "head", "points": {"exterior": 3}}]}, "is damaged"),
        ({"objects": [{"geometryType": "graph", "nodes": {"head": {"loc": "here"}}}]}, "head is here"),
        ({"annotations": [{"keypoints": [1, 2, 3]}], "categories": [{"keypoints": 5}]}, "3 numbers for 0"),
        ({"annotations": [None, 3], "images": [None], "categories": [None]}, "no joints with known names"),
    ],
)
def test_damaged_files_are_one_line(tmp_path: Path, content: Any, finding: str) -> None:
    with pytest.raises(FigureError, match=finding) as caught:
        read_keypoints(saved(tmp_path, content))
    assert "\n" not in str(caught.value)


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: (
            st.lists(inner, max_size=4)
            | st.dictionaries(
                st.sampled_from(
                    [
                        "shapes",
                        "objects",
                        "annotations",
                        "keypoints",
                        "categories",
                        "images",
                        "points",
                        "label",
                        "geometryType",
                        "nodes",
                        "loc",
                        "size",
                        "flags",
                        "id",
                        "image_id",
                        "group_id",
                    ]
                ),
                inner,
                max_size=5,
            )
        ),
        max_leaves=20,
    )
)
@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_whatever_json_it_is_the_answer_is_a_line(tmp_path_factory: pytest.TempPathFactory, content: Any) -> None:
    path = tmp_path_factory.getbasetemp() / "any.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(FigureError):
        read_keypoints(path)
