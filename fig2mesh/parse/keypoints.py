"""Reading 21 joints: `{"width", "height", "keypoints": {name: [x, y, visible]}}`, or another program's file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, get_args
from xml.etree import ElementTree

import numpy as np

from fig2mesh.errors import FigureError
from fig2mesh.parse.joint_formats import Box, NamedPoints, named_points
from fig2mesh.parse.joint_names import completed
from fig2mesh.parse.labelled_points import MIN_VISIBLE, listed
from fig2mesh.parse.standing import fitted
from fig2mesh.records import BoolArray, DepthOrder, FloatArray
from fig2mesh.skeleton import JOINT_NAMES, LIMBS
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import parse_json, read_bytes

MAX_BYTES = 4 << 20
"""Size limit of joint files; reading larger ones would only cost memory."""

MIN_ANNOTATED: Final = 6
"""Least number of joints in a file from which the others are inferred."""

REMEDY: Final = "give a JSON file with the 21 joints as --keypoints"


@dataclass(frozen=True)
class Joints:
    """Content of a joints file.

    points_px : (21, 2) float32, IMAGE, in the order of `JOINT_NAMES`
    visible : (21,) bool
    size : (width, height) of the picture they were drawn on, None where the file does not state it
    depth_order : as in `fig2mesh.records.Figure`
    derived : joints that follow from others, or from points beside them
    missing : joints that the file has not, nor points that they follow from; their positions are those of a standing
        person with the other joints
    unknown : names in the file that stand for no joint
    picture : file name of another picture that the file says it is about, else None
    """

    points_px: FloatArray
    visible: BoolArray
    size: tuple[int, int] | None = None
    depth_order: Mapping[str, DepthOrder] = field(default_factory=dict)
    derived: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    picture: str | None = None

    @property
    def annotated(self) -> BoolArray:
        """(21,) bool: joints that the file has, or that follow from its points."""
        return ~np.isin(JOINT_NAMES, self.missing)

    @property
    def drawn(self) -> BoolArray:
        """(21,) bool: joints that the file itself has."""
        return ~np.isin(JOINT_NAMES, (*self.missing, *self.derived))


def read_keypoints(
    path: Path, picture: str = "", bbox: Box | None = None, size: tuple[int, int] | None = None
) -> Joints:
    """Read joints: our own JSON, or a format of `fig2mesh.parse.joint_formats`, distinguished by content.

    Parameters
    ----------
    picture : file name of the drawing, for files about several pictures
    bbox : x0, y0, x1, y1, IMAGE, round the figure, for files about several figures
    size : (width, height) of the drawing, for formats with coordinates from 0 to 1

    Raises
    ------
    FigureError : the file cannot be read, or a joint is missing, misnamed or not a pair of finite numbers
    """
    content = _content(path)
    named = named_points(content, path, picture, bbox, size)
    if named is not None:
        return _from_names(named, path)
    joints = content.get("keypoints") if isinstance(content, dict) else None
    if not isinstance(joints, dict):
        raise FigureError(path, 'no "keypoints" object', 'expected {"keypoints": {"head": [x, y, visible], ...}}')
    missing = [name for name in JOINT_NAMES if name not in joints]
    unknown = [str(name) for name in joints if name not in JOINT_NAMES]
    if missing:
        found = f"joints missing: {listed(missing)}"
        if unknown:
            found += f" (unknown names: {listed(unknown)})"
        raise FigureError(path, found, f"name all 21 joints, null to have one inferred: {', '.join(JOINT_NAMES)}")
    if unknown:
        raise FigureError(path, f"unknown joints: {listed(unknown)}", f"use only: {', '.join(JOINT_NAMES)}")
    points = np.zeros((len(JOINT_NAMES), 2), np.float32)
    visible = np.zeros(len(JOINT_NAMES), np.bool_)
    empty = tuple(name for name in JOINT_NAMES if _not_annotated(joints[name]))
    for index, name in enumerate(JOINT_NAMES):
        value = joints[name]
        if name in empty:
            continue
        if not isinstance(value, list) or len(value) not in (2, 3) or not all(_is_number(v) for v in value):
            raise FigureError(path, f"{name} is {json.dumps(value)[:60]}", "give [x, y, visible] with finite numbers")
        points[index] = value[:2]
        visible[index] = len(value) == 2 or _visible(value[2])
    width, height = content.get("width"), content.get("height")
    sized = isinstance(width, int) and isinstance(height, int) and width > 0 and height > 0
    order = content.get("depth_order", {})
    if not isinstance(order, dict) or any(k not in LIMBS or v not in get_args(DepthOrder) for k, v in order.items()):
        found = f"depth_order is {json.dumps(order)[:60]}"
        raise FigureError(path, found, f'give {{"l_arm": "front"}} or "behind", for {", ".join(LIMBS)}')
    stated = (width, height) if sized else None
    if empty:
        there = {name: points[i].astype(np.float64) for i, name in enumerate(JOINT_NAMES) if name not in empty}
        named = NamedPoints(there, dict(zip(JOINT_NAMES, visible.tolist(), strict=True)), stated)
        joined = _from_names(named, path)
        return replace(joined, depth_order=order)
    return Joints(points, visible, stated, order)


def _content(path: Path) -> Any:
    """The document in a JSON file, or the root element of an XML file. Raises FigureError."""
    try:
        data = read_bytes(path, MAX_BYTES)
        if data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] != b"<":
            return parse_json(data)
        if b"<!DOCTYPE" in data or b"<!ENTITY" in data:  # entities can grow without limit
            raise DamagedFile("an XML file that defines entities")
        return ElementTree.fromstring(data)
    except (ElementTree.ParseError, LookupError, ValueError) as problem:  # the latter two of an unknown encoding
        raise FigureError(path, f"not XML: {problem}", REMEDY) from None
    except OSError as problem:
        raise FigureError(path, problem.strerror or "cannot be read", REMEDY) from None
    except DamagedFile as problem:
        raise FigureError(path, str(problem), REMEDY) from None


def _from_names(named: NamedPoints, path: Path) -> Joints:
    points = named.points | completed(named.points)
    missing = tuple(name for name in JOINT_NAMES if name not in points)
    there = {str(name): points[name] for name in JOINT_NAMES if name in points}
    if missing and len(there) < MIN_ANNOTATED:
        found = f"joints missing: {listed(missing)}"
        if named.unknown:
            found += f" (unknown names: {listed(named.unknown)})"
        remedy = f"add them, or leave out --keypoints; all 21 are: {', '.join(JOINT_NAMES)}"
        raise FigureError(path, found, remedy)
    joints = fitted(there)
    visible = np.array([named.visible.get(name, False) for name in JOINT_NAMES], np.bool_)
    derived = tuple(name for name in there if name not in named.points)
    return Joints(joints, visible, named.size, {}, derived, missing, named.unknown, named.picture)


def _not_annotated(value: object) -> bool:
    """Whether our own format marks a joint as not annotated: null, or zeros as in COCO."""
    return value is None or (isinstance(value, list) and len(value) == 3 and all(v == 0 for v in value))


def _visible(mark: float) -> bool:
    """Whether a flag (0 or 1), or a score, marks a joint as visible."""
    return mark > 0 if mark == int(mark) else mark >= MIN_VISIBLE


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and abs(value) < 1e9 and math.isfinite(value)
