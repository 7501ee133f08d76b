"""Joints as annotation tools, pose estimators and rigs write them: names, scores, zeros, pictures, people."""

from __future__ import annotations

import json
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fig2mesh.errors import FigureError
from fig2mesh.parse.joint_formats import file_name, same_picture
from fig2mesh.parse.joint_names import canonical, meanings
from fig2mesh.parse.keypoints import Joints, read_keypoints
from fig2mesh.parse.skeletons import BODY_25, COCO_17, HALPE_26, MEDIAPIPE_33
from fig2mesh.skeleton import JOINT, JOINT_NAMES
from tests.drawn import JOINTS, SIZE

SIDES = {"left": "l_", "right": "r_"}
LIMBS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
BODY = {f"{side}_{name}": f"{short}{name}" for side, short in SIDES.items() for name in LIMBS}
"""Names of the limbs' joints in most programs, and ours."""


def place(name: str, dx: float = 0) -> list[float]:
    x, y = JOINTS[name]
    return [x + dx, y]


def saved(tmp_path: Path, content: Any) -> Path:
    path = tmp_path / "joints.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def coco(points: dict[str, str | None], dx: float = 0, **image: Any) -> dict[str, Any]:
    """COCO with the names that are given, at our joints; None: not annotated."""
    flat = [[0, 0, 0] if ours is None else [*place(ours, dx), 2] for ours in points.values()]
    return {
        "images": [{"id": 1, "file_name": "figure.png", "width": SIZE[0], "height": SIZE[1], **image}],
        "categories": [{"id": 1, "keypoints": list(points)}],
        "annotations": [{"image_id": 1, "category_id": 1, "keypoints": list(chain(*flat))}],
    }


def at(joints: Joints, name: str) -> NDArray[np.float32]:
    return joints.points_px[JOINT[name]]


def assert_ours(joints: Joints, *names: str) -> None:
    for name in names:
        assert at(joints, name).tolist() == pytest.approx(list(JOINTS[name]), abs=0.01), name


LIMB_JOINTS = [f"{side}{name}" for side in SIDES.values() for name in LIMBS]

OPENPOSE = {
    **{f"{side[0].upper()}{name.title()}": f"{short}{name}" for side, short in SIDES.items() for name in LIMBS},
    "MidHip": "pelvis",
    "Neck": "neck",
    "Nose": "eyes",
    "LBigToe": "l_foot",
    "RBigToe": "r_foot",
}
HUMAN36M = {
    "root": "pelvis",
    "spine": "head",  # in the wrong place, so that it is seen which of the names counts
    "thorax": "thorax",
    "neck_base": "neck",
    "head": "head",
    **{f"{side}_{name}": f"{short}{name}" for side, short in SIDES.items() for name in LIMBS if name != "ankle"},
    "left_foot": "l_ankle",
    "right_foot": "r_ankle",
}
RIG = {"UpperArm": "shoulder", "LowerArm": "elbow", "Hand": "wrist", "UpperLeg": "hip", "LowerLeg": "knee"}
VRM = {
    "hips": "pelvis",
    "spine": "head",
    "chest": "thorax",
    "upperChest": "thorax",
    "neck": "neck",
    "head": "head",
    **{f"{side}{bone}": f"{short}{ours}" for side, short in SIDES.items() for bone, ours in RIG.items()},
    **{f"{side}Shoulder": "thorax" for side in SIDES},
    **{f"{side}Foot": f"{short}ankle" for side, short in SIDES.items()},
    **{f"{side}Toes": f"{short}foot" for side, short in SIDES.items()},
}
MIXAMO_RIG = {"Arm": "shoulder", "ForeArm": "elbow", "Hand": "wrist", "UpLeg": "hip", "Leg": "knee", "Foot": "ankle"}
MIXAMO = {
    "mixamorig:Hips": "pelvis",
    "mixamorig:Spine2": "thorax",
    "mixamorig:Neck": "neck",
    "mixamorig:Head": "head",
    **{
        f"mixamorig:{side.title()}{bone}": f"{short}{ours}"
        for side, short in SIDES.items()
        for bone, ours in MIXAMO_RIG.items()
    },
    **{f"mixamorig:{side.title()}Shoulder": "thorax" for side in SIDES},
    **{f"mixamorig:{side.title()}ToeBase": f"{short}foot" for side, short in SIDES.items()},
}
SMPL = {
    "pelvis": "pelvis",
    "spine1": "head",
    "spine2": "head",
    "spine3": "thorax",
    "neck": "neck",
    "head": "head",
    **{f"{side}_{name}": f"{short}{name}" for side, short in SIDES.items() for name in (*LIMBS, "foot", "hand")},
    **{f"{side}_collar": "head" for side in SIDES},
}
KINECT = {
    "SpineBase": "pelvis",
    "SpineShoulder": "thorax",
    "Neck": "neck",
    "Head": "head",
    **{f"{name.title()}{side.title()}": f"{short}{name}" for side, short in SIDES.items() for name in LIMBS},
}
UNREAL = {
    "pelvis": "pelvis", "spine_03": "thorax", "neck_01": "neck", "head": "head",
    **{
        f"{bone}_{short[0]}": f"{short}{ours}"
        for short in SIDES.values()
        for bone, ours in {"upperarm": "shoulder", "lowerarm": "elbow", "hand": "wrist", "thigh": "hip", "calf": "knee",
                           "foot": "ankle", "ball": "foot"}.items()
    },
}  # fmt: skip


@pytest.mark.parametrize("names", [OPENPOSE, HUMAN36M, VRM, MIXAMO, SMPL, KINECT, UNREAL])
def test_names_of_other_skeletons(tmp_path: Path, names: dict[str, str | None]) -> None:
    found = read_keypoints(saved(tmp_path, coco(names)), "figure.png")
    assert_ours(found, "neck", "pelvis", *LIMB_JOINTS)
    assert "thorax" in found.derived or at(found, "thorax").tolist() == list(JOINTS["thorax"])
    assert found.missing == ()


@pytest.mark.parametrize(
    ("written", "ours"),
    [
        ("LShoulder", "l_shoulder"),
        ("Rknee", "r_knee"),
        ("rhip", "r_hip"),
        ("LEFT_FOOT_INDEX", "l_foot"),
        ("Bip01 L UpperArm", "l_shoulder"),
        ("DEF-shin.R", "r_knee"),
        ("J_Bip_L_LowerLeg", "l_knee"),
        ("CC_Base_R_Forearm", "r_elbow"),
        ("kp_left_knee", "l_knee"),
    ],
)
def test_spellings(written: str, ours: str) -> None:
    assert canonical(written) == ours


def test_our_own_name_wins_and_then_the_first_synonym() -> None:
    assert meanings(["spine", "thorax", "chest"])[0] == {"thorax": 1}
    assert meanings(["spine", "upperChest", "chest"])[0] == {"thorax": 2}
    assert meanings(["left_index", "left_palm"])[0]["l_hand"] == 1


def test_a_whole_limb_is_no_joint() -> None:
    assert meanings(["left arm", "left leg"]) == ({}, ("left arm", "left leg"))


def body_25(score: float = 0.9) -> list[float]:
    names = BODY | {"mid_hip": "pelvis", "neck": "neck", "nose": "eyes"}
    return list(chain(*([*place(names[n]), score] if n in names else [0, 0, 0] for n in BODY_25)))


def landmarks(width: float = SIZE[0], height: float = SIZE[1]) -> list[dict[str, float]]:
    names = BODY | {"nose": "eyes"}
    placed = [place(names.get(name, "head")) for name in MEDIAPIPE_33]
    points = zip(MEDIAPIPE_33, placed, strict=True)
    return [
        {"x": x / width, "y": y / height, "z": 0.1, "visibility": 0.9 if name in names else 0.1}
        for name, (x, y) in points
    ]


def flat(names: tuple[str, ...], score: float = 0.8) -> list[float]:
    known = BODY | {"nose": "eyes", "neck": "neck", "hip": "pelvis"}
    return list(chain(*([*place(known[name]), score] if name in known else [0, 0, 0] for name in names)))


def label_studio(picture: str = "/data/upload/3/0a1b2c3d-figure.png", **task: Any) -> list[dict[str, Any]]:
    regions = [
        {
            "type": "keypointlabels",
            "original_width": SIZE[0],
            "original_height": SIZE[1],
            "value": {"x": x / SIZE[0] * 100, "y": y / SIZE[1] * 100, "width": 0.4, "keypointlabels": [name]},
        }
        for name, (x, y) in JOINTS.items()
    ]
    return [{"id": 1, "data": {"image": picture}, "annotations": [{"result": regions}], **task}]


def cvat(inner: str, name: str = "figure.png") -> str:
    size = f"width='{SIZE[0]}' height='{SIZE[1]}'"
    return f"<?xml version='1.0'?><annotations><image id='0' name='{name}' {size}>{inner}</image></annotations>"


def cvat_points(**extra: str) -> str:
    return "".join(
        f"<points label='{name}' outside='0' occluded='{extra.get(name, 0)}' points='{x:.2f},{y:.2f}'/>"
        for name, (x, y) in JOINTS.items()
    )


FILES = {
    "OpenPose": {"people": [{"pose_keypoints_2d": body_25()}]},
    "MediaPipe": landmarks(),
    "MediaPipe, a list for each person": {"pose_landmarks": [landmarks()]},
    "MediaPipe for JavaScript": {"poseLandmarks": landmarks(), "width": SIZE[0], "height": SIZE[1]},
    "MediaPipe in pixels": landmarks(1, 1),
    "AlphaPose": [{"image_id": "figure.png", "keypoints": flat(COCO_17), "score": 2.9}],
    "AlphaPose, Halpe": [{"image_id": "figure.png", "keypoints": flat(HALPE_26), "score": 2.9}],
    "COCO without categories": {"annotations": [{"keypoints": flat(COCO_17)}]},
    "Label Studio": label_studio(),
    "Label Studio, one task": label_studio()[0],
    "CVAT": cvat(f"<skeleton label='person'>{cvat_points()}</skeleton>"),
    "CVAT, points": cvat(cvat_points()),
    "names and positions": {n: {"x": x, "y": y, "score": 0.9} for n, (x, y) in JOINTS.items()},
    "long names": {"keypoints": {name: [*place(ours), 0.9] for name, ours in BODY.items()} | {"neck": place("neck")}},
    "TensorFlow.js": {
        "keypoints": [{"name": n, "x": place(o)[0], "y": place(o)[1], "score": 0.9} for n, o in BODY.items()]
    },
    "PoseNet": [
        {"keypoints": [{"part": n, "position": dict(zip("xy", place(o), strict=True))} for n, o in BODY.items()]}
    ],
}


@pytest.mark.parametrize("name", FILES)
def test_formats(tmp_path: Path, name: str) -> None:
    found = read_keypoints(saved(tmp_path, FILES[name]), "figure.png", size=SIZE)
    assert_ours(found, *LIMB_JOINTS)
    assert found.visible[[JOINT[each] for each in LIMB_JOINTS]].all()


def test_scores_are_visibility(tmp_path: Path) -> None:
    values = flat(COCO_17)
    at_wrist = 3 * COCO_17.index("left_wrist") + 2
    values[at_wrist] = 0.12
    found = read_keypoints(saved(tmp_path, [{"keypoints": values}]), "figure.png")
    assert not found.visible[JOINT["l_wrist"]]
    assert found.visible[JOINT["r_wrist"]]
    assert_ours(found, "l_wrist")


def test_zeros_are_not_annotated(tmp_path: Path) -> None:
    names = {name: None if name in ("l_ankle", "r_ankle", "l_hip", "head") else name for name in JOINT_NAMES}
    found = read_keypoints(saved(tmp_path, coco(names)), "figure.png")
    assert found.missing == ("l_hip", "l_ankle", "r_ankle")
    assert found.derived == ("head",)
    given = [name for name, ours in names.items() if ours]
    assert_ours(found, *given)


@pytest.mark.parametrize("empty", [None, [0, 0, 0]])
def test_our_own_format_says_what_is_to_be_inferred(tmp_path: Path, empty: Any) -> None:
    content = {"keypoints": {n: [*p, 1] for n, p in JOINTS.items()} | {"l_hip": empty, "r_knee": empty}}
    found = read_keypoints(saved(tmp_path, content))
    assert found.missing == ("l_hip", "r_knee")
    # Until they are inferred they are where a standing person has them.
    assert np.linalg.norm(at(found, "r_knee") - JOINTS["r_knee"]) < 40


def test_what_is_not_understood_is_named(tmp_path: Path) -> None:
    names = {"Kopf": "head", "Schulter li": "l_shoulder", **{name: name for name in ("neck", "pelvis")}}
    with pytest.raises(FigureError, match=r"joints missing: .*unknown names: Kopf, Schulter li"):
        read_keypoints(saved(tmp_path, coco(names)), "figure.png")
    with pytest.raises(FigureError, match=r"no joints with known names \(Kopf\)"):
        read_keypoints(saved(tmp_path, coco({"Kopf": "head"})), "figure.png")


@pytest.mark.parametrize(
    "written",
    [
        "C:\\scans\\figure.png",
        "\\\\server\\maps\\figure.png",
        "https://example.org/maps/figure.png?token=3#x",
        "s3://bucket/a%20b/figure.png",
        "/data/local-files/?d=maps/figure.png",
        "FIGURE.PNG",
        "figure.jpg",
        "figure_png.rf.8f3c2b1a.jpg",
    ],
)
def test_file_names_of_other_programs(tmp_path: Path, written: str) -> None:
    assert same_picture(written, "figure.png")
    both = coco(dict(zip(JOINT_NAMES, JOINT_NAMES, strict=True)), file_name=written)
    both["images"].append({"id": 2, "file_name": "b.png", "width": 900, "height": 900})
    both["annotations"].append({"image_id": 2, "category_id": 1, "keypoints": [5, 5, 2] * 21})
    found = read_keypoints(saved(tmp_path, both), "figure.png")
    assert found.picture is None
    assert_ours(found, *JOINT_NAMES)


def test_names_with_spaces_marks_and_prefixes() -> None:
    assert file_name("https://example.org/M%C3%BCller%201.png") == "Müller 1.png"
    assert same_picture("Mu\u0308ller.png", "M\u00fcller.png")
    assert file_name("/data/upload/1/12ab34cd-a.png") == "a.png"
    assert not same_picture("a.png", "b.png")


@pytest.mark.parametrize(("image_id", "other"), [("1", 1), (1, "1"), (1.0, 1)])
def test_identifiers_are_numbers_or_texts(tmp_path: Path, image_id: Any, other: Any) -> None:
    content = coco(dict(zip(JOINT_NAMES, JOINT_NAMES, strict=True)), id=image_id)
    content["annotations"][0] |= {"image_id": other, "category_id": "1"}
    assert read_keypoints(saved(tmp_path, content), "figure.png").size == SIZE


def test_a_file_about_another_picture(tmp_path: Path) -> None:
    content = coco(dict(zip(JOINT_NAMES, JOINT_NAMES, strict=True)), file_name="other.png")
    assert read_keypoints(saved(tmp_path, content), "figure.png").picture == "other.png"
    content["images"].append({"id": 2, "file_name": "third.png"})
    content["annotations"].append({**content["annotations"][0], "image_id": 2})
    with pytest.raises(FigureError, match=r"about 2 pictures \(other.png, third.png\), none of them figure.png"):
        read_keypoints(saved(tmp_path, content), "figure.png")


def test_the_box_chooses_among_the_people_of_this_picture(tmp_path: Path) -> None:
    names = dict(zip(JOINT_NAMES, JOINT_NAMES, strict=True))
    one, right, elsewhere = (coco(names, dx)["annotations"][0] for dx in (0, 300, 310))
    content = coco(names)
    content["images"].append({"id": 2, "file_name": "b.png"})
    content["annotations"] = [one, right, elsewhere | {"image_id": 2}]
    found = read_keypoints(saved(tmp_path, content), "figure.png", (290, 0, 520, 300))
    assert at(found, "pelvis").tolist() == [400, 160]
    with pytest.raises(FigureError, match="none of its 2 figures is inside --bbox"):
        read_keypoints(saved(tmp_path, content), "figure.png", (2000, 0, 2100, 300))


@pytest.mark.parametrize(
    ("content", "finding"),
    [
        (cvat("<points label='head' points='1;2'/>"), "give one point per label"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><annotations/>", "defines entities"),
        ("<annotations>", "not XML"),
        ("<svg/>", "no .keypoints. object"),
        ({"people": [{"pose_keypoints_2d": [1, 2, 3]}]}, "of 3 numbers; write it with the model BODY_25"),
        ({"people": []}, "no joints with known names"),
        ([{"keypoints": [1, 2, 3, 4]}], "4 numbers without names"),
        ({"pose_world_landmarks": [[{"x": 0, "y": 0}]]}, "landmarks in metres; write pose_landmarks"),
        ([{"x": 0.5, "y": 0.5}] * 4, "4 points without names"),
        (
            label_studio()[0] | {"annotations": [{"result": [{"value": {"keypointlabels": ["head"]}}]}]},
            "original_width",
        ),
    ],
)
def test_damaged_files(tmp_path: Path, content: Any, finding: str) -> None:
    with pytest.raises(FigureError, match=finding) as caught:
        read_keypoints(saved(tmp_path, content), "figure.png", size=SIZE)
    assert "\n" not in str(caught.value)


def test_occluded_points_of_cvat_are_hidden(tmp_path: Path) -> None:
    text = cvat(f"<skeleton label='p'>{cvat_points(l_knee='1')}</skeleton>")
    found = read_keypoints(saved(tmp_path, text), "figure.png")
    assert not found.visible[JOINT["l_knee"]]
    assert found.visible[JOINT["r_knee"]]
