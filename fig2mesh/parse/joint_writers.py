"""Joints as JSON: our own format, and those of annotation tools, for correction there; read by `joint_formats`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fig2mesh.records import BoolArray, FloatArray
from fig2mesh.skeleton import BONES, JOINT_NAMES

Document = dict[str, Any]
Writer = Callable[[FloatArray, BoolArray, tuple[int, int], str], Document]

CORNER_PX = 0.001
"""x that is written for a hidden joint in the very corner of the picture."""

# fmt: off
LONG_NAMES = tuple(
    {"l_": "left_", "r_": "right_"}.get(name[:2], name[:2]) + name[2:] for name in JOINT_NAMES
)
# fmt: on
"""left_shoulder instead of l_shoulder, as in data sets."""


def as_ours(joints: FloatArray, visible: BoolArray, size: tuple[int, int], picture: str) -> Document:
    """`{"width", "height", "keypoints": {name: [x, y, visible]}}`.

    joints : (21, 2), IMAGE; visible : (21,); size : (width, height) of the picture; picture : its file name
    """
    rows = zip(JOINT_NAMES, _rounded(joints), visible.tolist(), strict=True)
    # Three zeros mark a joint that has not been annotated.
    points = {name: [x if x or y or v else CORNER_PX, y, int(v)] for name, (x, y), v in rows}
    return {"width": size[0], "height": size[1], "keypoints": points}


def as_coco(joints: FloatArray, visible: BoolArray, size: tuple[int, int], picture: str) -> Document:
    """A COCO keypoint file of one picture and one figure; arguments as for `as_ours`."""
    points = _rounded(joints)
    low, high = joints.min(axis=0).tolist(), joints.max(axis=0).tolist()
    place = {name: index + 1 for index, name in enumerate(JOINT_NAMES)}
    flat = [value for (x, y), v in zip(points, visible.tolist(), strict=True) for value in (x, y, 2 if v else 1)]
    box = [round(value, 2) for value in (low[0], low[1], high[0] - low[0], high[1] - low[1])]
    return {
        "images": [{"id": 1, "file_name": picture, "width": size[0], "height": size[1]}],
        "categories": [
            {
                "id": 1,
                "name": "person",
                "supercategory": "person",
                "keypoints": list(LONG_NAMES),
                "skeleton": [[place[start], place[end]] for start, end in BONES],
            },
        ],
        "annotations": [
            {
                "id": 1,
                "image_id": 1,
                "category_id": 1,
                "keypoints": flat,
                "num_keypoints": len(points),
                "bbox": box,
                "area": round(box[2] * box[3], 2),
                "iscrowd": 0,
            },
        ],
    }


def as_labelme(joints: FloatArray, visible: BoolArray, size: tuple[int, int], picture: str) -> Document:
    """A LabelMe file with a point for each joint; hidden ones have the flag `hidden`."""
    shapes = [
        {
            "label": name,
            "points": [[x, y]],
            "group_id": None,
            "description": "",
            "shape_type": "point",
            "flags": {} if v else {"hidden": True},
            "mask": None,
        }
        for name, (x, y), v in zip(JOINT_NAMES, _rounded(joints), visible.tolist(), strict=True)
    ]
    return {
        "version": "5.5.0",
        "flags": {},
        "shapes": shapes,
        "imagePath": picture,
        "imageData": None,
        "imageWidth": size[0],
        "imageHeight": size[1],
    }


def as_supervisely(joints: FloatArray, visible: BoolArray, size: tuple[int, int], picture: str) -> Document:
    """A Supervisely annotation with one graph whose nodes are the joints; hidden ones are disabled."""
    nodes = {
        name: {"loc": [x, y], **({} if v else {"disabled": True})}
        for name, (x, y), v in zip(JOINT_NAMES, _rounded(joints), visible.tolist(), strict=True)
    }
    figure = {"geometryType": "graph", "classTitle": "person", "description": "", "tags": [], "nodes": nodes}
    return {
        "description": "",
        "name": picture,
        "tags": [],
        "size": {"width": size[0], "height": size[1]},
        "objects": [figure],
    }


# fmt: off
WRITERS: dict[str, Writer] = {
    "fig2mesh": as_ours, "coco": as_coco, "labelme": as_labelme, "supervisely": as_supervisely,
}
# fmt: on


def _rounded(joints: FloatArray) -> list[tuple[float, float]]:
    # Hundredths of a pixel are finer than anybody can point at, and keep the files readable.
    return [(round(x, 2), round(y, 2)) for x, y in joints.astype(float).tolist()]
