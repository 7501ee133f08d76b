"""Joints in the files of pose estimators: OpenPose, MediaPipe, AlphaPose, MMPose, PoseNet; and tables of names.

https://github.com/CMU-Perceptual-Computing-Lab/openpose/blob/master/doc/02_output.md
https://ai.google.dev/edge/mediapipe/solutions/vision/pose_landmarker
https://github.com/MVIG-SJTU/AlphaPose/blob/master/docs/output.md
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from fig2mesh.errors import FigureError
from fig2mesh.parse.joint_names import KNOWN, canonical
from fig2mesh.parse.labelled_points import (
    MIN_VISIBLE,
    FormatReader,
    LabelledPoints,
    NotThisFormat,
    objects,
    picture_size,
    text,
    triples,
)
from fig2mesh.parse.skeletons import BODY_25, MEDIAPIPE_33, OPENPOSE_18, OTHER_POINTS, names_by_count
from fig2mesh.skeleton import JOINT_NAMES

LANDMARKS: Final = ("landmarks", "pose_landmarks", "poseLandmarks", "landmark", "keypoints")
"""Members that hold MediaPipe's landmarks, or those of TensorFlow.js."""

SCORES: Final = ("visibility", "score", "confidence", "presence", "v", "visible")
"""Members that hold the score of a point, the first that is there."""


def openpose(content: Any, path: Path) -> list[LabelledPoints]:
    """OpenPose: people with `pose_keypoints_2d`, of BODY_25 or of COCO's 18 points."""
    people = content.get("people") if isinstance(content, dict) else None
    if not isinstance(people, list):
        raise NotThisFormat
    size = picture_size(content.get("canvas_width"), content.get("canvas_height"))
    figures = []
    for person in objects(people):
        values = person.get("pose_keypoints_2d", person.get("pose_keypoints"))
        if not isinstance(values, list) or not values:
            continue
        names = {75: BODY_25, 54: OPENPOSE_18}.get(len(values))
        if names is None:
            found = f"pose_keypoints_2d of {len(values)} numbers"
            raise FigureError(path, found, "write it with the model BODY_25 (75) or COCO (54)")
        figures.append(LabelledPoints(triples(names, values, scored=True), size, ignored=OTHER_POINTS))
    return figures


def results(content: Any, path: Path) -> list[LabelledPoints]:
    """Result lists of AlphaPose, MMPose, Detectron2 and pycocotools: a flat list of numbers for each figure."""
    found = [each for each in objects(content) if isinstance(each.get("keypoints"), list)]
    if not isinstance(content, list) or not found or objects(found[0]["keypoints"]):
        raise NotThisFormat
    figures = []
    for each in found:
        values = each["keypoints"]
        names = names_by_count(len(values) // 3) if len(values) % 3 == 0 else None
        if names is None:
            remedy = "give x, y, score of 17, 23, 26, 133 or 136 points, or write names in COCO's categories"
            raise FigureError(path, f"{len(values)} numbers without names", remedy)
        picture = each.get("file_name", each.get("image_id"))
        named = picture if isinstance(picture, str) and "." in picture else None
        figures.append(LabelledPoints(triples(names, values, scored=True), picture=text(named), ignored=OTHER_POINTS))
    return figures


def landmarks(content: Any, path: Path) -> list[LabelledPoints]:
    """MediaPipe and TensorFlow.js: lists of objects with x, y and a score, by name or in MediaPipe's order."""
    inner, normalised, size, picture = content, True, None, None
    if isinstance(content, dict):
        if "pose_world_landmarks" in content and not any(name in content for name in LANDMARKS):
            raise FigureError(path, "landmarks in metres", "write pose_landmarks, which are of the picture")
        inner = next((content[name] for name in LANDMARKS if isinstance(content.get(name), list)), None)
        size = picture_size(
            content.get("width", content.get("image_width")), content.get("height", content.get("image_height"))
        )
        picture = text(content.get("file_name", content.get("image")))
    if not isinstance(inner, list) or not inner:
        raise NotThisFormat
    groups = inner if isinstance(inner[0], list) else [inner]
    if isinstance(inner[0], dict) and isinstance(inner[0].get("keypoints"), list):
        groups = [person["keypoints"] for person in objects(inner) if isinstance(person.get("keypoints"), list)]
    figures = []
    for group in groups:
        points = objects(group)
        if not points or len(points) != len(group) or not all(_placed(point) for point in points):
            raise NotThisFormat
        names = [text(point.get("name", point.get("part"))) for point in points]
        if all(names):
            labels = tuple(str(name) for name in names)
        elif len(points) == len(MEDIAPIPE_33):
            labels = MEDIAPIPE_33
        else:
            found = f"{len(points)} points without names"
            raise FigureError(path, found, 'give each a "name", or all 33 landmarks of MediaPipe')
        named = tuple((label, *_point(point)) for label, point in zip(labels, points, strict=True))
        figures.append(LabelledPoints(named, size, picture, normalised, OTHER_POINTS))
    return figures


def table(content: Any, path: Path) -> list[LabelledPoints]:
    """Objects of names and positions: `{"left_shoulder": [x, y, score]}` or `{"LeftArm": {"x": …, "y": …}}`.

    With our own names alone it is our own format, which `fig2mesh.parse.keypoints` reads.
    """
    if not isinstance(content, dict):
        raise NotThisFormat
    inner = next((content[k] for k in ("keypoints", "joints", "landmarks") if isinstance(content.get(k), dict)), None)
    named = content if inner is None else inner
    known = [name for name in named if canonical(str(name)) in KNOWN]
    ours = [name for name in named if name in JOINT_NAMES]
    if not known or ("keypoints" in content and inner is content["keypoints"] and 2 * len(ours) >= len(known)):
        raise NotThisFormat
    if inner is None and len(known) < 5:
        raise NotThisFormat
    points = []
    for name, value in named.items():
        if isinstance(value, dict):
            place, visible = _point(value)
        elif isinstance(value, list) and len(value) in (2, 3):
            place, visible = _point(dict(zip(("x", "y", "v"), value, strict=False)))
        elif name in known and value is not None:
            raise FigureError(path, f"{name} is {str(value)[:40]}", "give [x, y, visible] with finite numbers")
        elif value is None:
            place, visible = None, False
        else:
            continue
        points.append((str(name), place, visible))
    size = picture_size(content.get("width"), content.get("height"))
    return [LabelledPoints(tuple(points), size, text(content.get("file_name")), ignored=OTHER_POINTS)]


def _placed(point: dict[str, Any]) -> bool:
    return ("x" in point and "y" in point) or isinstance(point.get("position"), dict)


def _point(point: dict[str, Any]) -> tuple[Any, bool]:
    """Position of a point, None where it has not been annotated, and whether it is visible."""
    inner = point.get("position")
    place = inner if isinstance(inner, dict) else point
    score = next((point[name] for name in SCORES if name in point), None)
    if isinstance(score, bool) or not isinstance(score, int | float):
        visible = score is not False
    else:
        # A score of exactly 0 at the origin is a point that was not found.
        if score <= 0 and not any((place.get("x"), place.get("y"))):
            return None, False
        visible = score >= MIN_VISIBLE
    if place.get("x") is None and place.get("y") is None:
        return None, False
    return [place.get("x"), place.get("y")], visible


POSE_FORMATS: Final[tuple[FormatReader, ...]] = (openpose, results, landmarks, table)
