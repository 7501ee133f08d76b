"""Reading 21 joints: `{"width", "height", "keypoints": {name: [x, y, visible]}}`, or an annotation tool's file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import get_args

import numpy as np

from fig2mesh.errors import FigureError
from fig2mesh.parse.joint_formats import Box, NamedPoints, named_points
from fig2mesh.parse.joint_names import completed
from fig2mesh.records import BoolArray, DepthOrder, FloatArray
from fig2mesh.skeleton import JOINT_NAMES, LIMBS
from georef.untrusted.json_file import read_json

MAX_BYTES = 4 << 20
"""Size limit of joint files; reading larger ones would only cost memory."""


@dataclass(frozen=True)
class Joints:
    """Content of a joints file.

    points_px : (21, 2) float32, IMAGE, in the order of `JOINT_NAMES`
    visible : (21,) bool
    size : (width, height) of the picture they were drawn on, None where the file does not state it
    depth_order : as in `fig2mesh.records.Figure`
    """

    points_px: FloatArray
    visible: BoolArray
    size: tuple[int, int] | None = None
    depth_order: Mapping[str, DepthOrder] = field(default_factory=dict)


def read_keypoints(path: Path, picture: str = "", bbox: Box | None = None) -> Joints:
    """Read joints: our own JSON, COCO, LabelMe or Supervisely, distinguished by content.

    Parameters
    ----------
    picture : file name of the drawing, for files about several pictures
    bbox : x0, y0, x1, y1, IMAGE, round the figure, for files about several figures

    Raises
    ------
    FigureError : the file cannot be read, or a joint is missing, misnamed or not a pair of finite numbers
    """
    content = read_json(path, "give a JSON file with the 21 joints as --keypoints", FigureError, MAX_BYTES)
    named = named_points(content, path, picture, bbox)
    if named is not None:
        return _from_names(named, path)
    joints = content.get("keypoints") if isinstance(content, dict) else None
    if not isinstance(joints, dict):
        raise FigureError(path, 'no "keypoints" object', 'expected {"keypoints": {"head": [x, y, visible], ...}}')
    missing = [name for name in JOINT_NAMES if name not in joints]
    unknown = [str(name) for name in joints if name not in JOINT_NAMES]
    if missing:
        found = f"joints missing: {_listed(missing)}"
        if unknown:
            found += f" (unknown names: {_listed(unknown)})"
        raise FigureError(path, found, f"name all 21 joints: {', '.join(JOINT_NAMES)}")
    if unknown:
        raise FigureError(path, f"unknown joints: {_listed(unknown)}", f"use only: {', '.join(JOINT_NAMES)}")
    points = np.empty((len(JOINT_NAMES), 2), np.float32)
    visible = np.empty(len(JOINT_NAMES), np.bool_)
    for index, name in enumerate(JOINT_NAMES):
        value = joints[name]
        if not isinstance(value, list) or len(value) not in (2, 3) or not all(_is_number(v) for v in value):
            raise FigureError(path, f"{name} is {json.dumps(value)[:60]}", "give [x, y, visible] with finite numbers")
        points[index] = value[:2]
        visible[index] = len(value) == 2 or value[2] > 0
    width, height = content.get("width"), content.get("height")
    sized = isinstance(width, int) and isinstance(height, int) and width > 0 and height > 0
    order = content.get("depth_order", {})
    if not isinstance(order, dict) or any(k not in LIMBS or v not in get_args(DepthOrder) for k, v in order.items()):
        found = f"depth_order is {json.dumps(order)[:60]}"
        raise FigureError(path, found, f'give {{"l_arm": "front"}} or "behind", for {", ".join(LIMBS)}')
    return Joints(points, visible, (width, height) if sized else None, order)


def _from_names(named: NamedPoints, path: Path) -> Joints:
    guessed = completed(named.points)
    points = named.points | guessed
    missing = [name for name in JOINT_NAMES if name not in points]
    if missing:
        found = f"joints missing: {_listed(missing)}"
        raise FigureError(path, found, f"add them; all 21 are: {', '.join(JOINT_NAMES)}")
    joints = np.array([points[name] for name in JOINT_NAMES], np.float32)
    visible = np.array([named.visible.get(name, False) for name in JOINT_NAMES], np.bool_)
    return Joints(joints, visible, named.size)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and abs(value) < 1e9 and math.isfinite(value)


def _listed(names: list[str], limit: int = 6) -> str:
    shown = ", ".join(name[:30] for name in names[:limit])
    return shown if len(names) <= limit else f"{shown} and {len(names) - limit} more"
