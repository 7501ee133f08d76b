"""Joints in the files of annotation tools: COCO, LabelMe, Supervisely, Label Studio, CVAT.

https://cocodataset.org/#format-data
https://github.com/wkentaro/labelme
https://developer.supervisely.com/getting-started/supervisely-annotation-format
https://labelstud.io/guide/export
https://docs.cvat.ai/docs/manual/advanced/formats/format-cvat/
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final
from xml.etree.ElementTree import Element

from fig2mesh.errors import FigureError
from fig2mesh.parse.labelled_points import (
    FormatReader,
    LabelledPoints,
    NotThisFormat,
    key,
    objects,
    picture_size,
    text,
    triples,
)
from fig2mesh.parse.skeletons import names_by_count

HIDDEN: Final = ("hidden", "occluded", "invisible")
"""Flags, tags and attributes of hidden points."""


def coco(content: Any, path: Path) -> list[LabelledPoints]:
    """COCO's keypoints, with one category or several."""
    if not isinstance(content, dict) or not isinstance(content.get("annotations"), list):
        raise NotThisFormat
    if any("result" in each for each in objects(content["annotations"])):
        raise NotThisFormat  # Label Studio
    images = {key(item.get("id")): item for item in objects(content.get("images"))}
    names = {
        key(item.get("id")): tuple(map(str, item["keypoints"]))
        for item in objects(content.get("categories"))
        if isinstance(item.get("keypoints"), list)
    }
    figures = []
    for annotation in objects(content["annotations"]):
        values = annotation.get("keypoints")
        if not isinstance(values, list):
            continue
        labels = names.get(key(annotation.get("category_id"))) or next(iter(names.values()), ())
        if not names and len(values) % 3 == 0:
            labels = names_by_count(len(values) // 3) or ()
        image = images.get(key(annotation.get("image_id")), {})
        if len(values) != 3 * len(labels):
            found = f"{len(values)} numbers for {len(labels)} keypoint names"
            raise FigureError(path, found, "give x, y, v for each name in categories[].keypoints")
        size = picture_size(image.get("width"), image.get("height"))
        figures.append(LabelledPoints(triples(labels, values), size, text(image.get("file_name"))))
    return figures


def labelme(content: Any, path: Path) -> list[LabelledPoints]:
    """LabelMe's points, grouped by `group_id`."""
    if not isinstance(content, dict) or not isinstance(content.get("shapes"), list):
        raise NotThisFormat
    groups: dict[str, list[tuple[str, Any, bool]]] = {}
    for shape in objects(content["shapes"]):
        if shape.get("shape_type", "point") != "point":
            continue
        points = shape.get("points")
        if not isinstance(points, list) or len(points) != 1:
            raise FigureError(path, f"point {str(shape.get('label'))[:30]!r} without coordinates", "draw it again")
        flags = shape.get("flags")
        hidden = isinstance(flags, dict) and any(flags.get(word) for word in HIDDEN)
        group = groups.setdefault(key(shape.get("group_id")), [])
        group.append((str(shape.get("label")), points[0], not hidden))
    size = picture_size(content.get("imageWidth"), content.get("imageHeight"))
    picture = text(content.get("imagePath"))
    return [LabelledPoints(tuple(group), size, picture) for group in groups.values()]


def supervisely(content: Any, path: Path) -> list[LabelledPoints]:
    """Supervisely's graphs, and points outside of graphs, which make one figure."""
    if not isinstance(content, dict) or not isinstance(content.get("objects"), list):
        raise NotThisFormat
    stated = content.get("size")
    size = picture_size(stated.get("width"), stated.get("height")) if isinstance(stated, dict) else None
    picture = text(content.get("name"))
    loose, figures = [], []
    for item in objects(content["objects"]):
        if item.get("geometryType") == "point":
            exterior = item.get("points", {}).get("exterior") if isinstance(item.get("points"), dict) else None
            if not isinstance(exterior, list) or len(exterior) != 1:
                raise FigureError(path, f"point {str(item.get('classTitle'))[:30]!r} is damaged", "export it again")
            tagged = any(str(tag.get("name")).lower() in HIDDEN for tag in objects(item.get("tags")))
            loose.append((str(item.get("classTitle")), exterior[0], not tagged))
        elif item.get("geometryType") == "graph" and isinstance(item.get("nodes"), dict):
            # Nodes are keyed by their label, or by an identifier whose label stands in the node.
            nodes = [
                (str(node.get("label") or name), node.get("loc"), not node.get("disabled", False))
                for name, node in item["nodes"].items()
                if isinstance(node, dict)
            ]
            figures.append(LabelledPoints(tuple(nodes), size, picture))
    return figures + ([LabelledPoints(tuple(loose), size, picture)] if loose else [])


def label_studio(content: Any, path: Path) -> list[LabelledPoints]:
    """Label Studio's JSON export, of one task or a list: key points in per cent of the picture.

    Points within one region, or of one parent, are one figure.
    """
    tasks = objects(content) if isinstance(content, list) else objects([content])
    found = [task for task in tasks if _results(task) is not None]
    if not found:
        raise NotThisFormat
    figures = []
    for task in found:
        data = task.get("data")
        values = [text(value) for value in (data.values() if isinstance(data, dict) else ())]
        picture = next((value for value in values if value), None)
        groups: dict[str, list[tuple[str, Any, bool]]] = {}
        size = None
        for result in _results(task) or ():
            value = result.get("value")
            labels = value.get("keypointlabels") if isinstance(value, dict) else None
            if not isinstance(labels, list) or not labels or not isinstance(value, dict):
                continue
            size = picture_size(result.get("original_width"), result.get("original_height"))
            if size is None:
                name = str(labels[0])[:30]
                raise FigureError(path, f"{name} without original_width and original_height", "export it again")
            try:
                point = [float(value[axis]) / 100 * length for axis, length in zip("xy", size, strict=True)]
            except (KeyError, TypeError, ValueError, OverflowError):
                raise FigureError(path, f"{str(labels[0])[:30]} without x and y", "export it again") from None
            meta = result.get("meta")
            hidden = isinstance(meta, dict) and any(word in str(meta).lower() for word in HIDDEN)
            groups.setdefault(key(result.get("parentID")), []).append((str(labels[0]), point, not hidden))
        figures += [LabelledPoints(tuple(group), size, picture) for group in groups.values()]
    return figures


def _results(task: dict[str, Any]) -> list[dict[str, Any]] | None:
    """Regions of a task: of its first annotation that was not cancelled, else of its first prediction."""
    if isinstance(task.get("result"), list):
        return objects(task["result"])
    annotations = [each for each in objects(task.get("annotations")) if not each.get("was_cancelled")]
    for each in (*annotations, *objects(task.get("predictions"))):
        if isinstance(each.get("result"), list):
            return objects(each["result"])
    return None


def cvat(content: Any, path: Path) -> list[LabelledPoints]:
    """CVAT for images 1.1 (XML): skeletons, and points outside of skeletons, which make one figure of a picture."""
    if not isinstance(content, Element) or content.tag != "annotations":
        raise NotThisFormat
    figures = []
    for image in content.iter("image"):
        width, height = (image.get(name, "") for name in ("width", "height"))
        size = picture_size(*(int(v) if v.isdecimal() and len(v) < 9 else None for v in (width, height)))
        loose: dict[str, list[tuple[str, Any, bool]]] = {}
        for item in image:
            if item.tag == "skeleton":
                points = tuple(_cvat_point(each, path) for each in item.iter("points") if each.get("outside") != "1")
                figures.append(LabelledPoints(points, size, image.get("name")))
            elif item.tag == "points" and item.get("outside") != "1":
                loose.setdefault(item.get("group_id") or "", []).append(_cvat_point(item, path))
        figures += [LabelledPoints(tuple(points), size, image.get("name")) for points in loose.values()]
    return figures


def _cvat_point(item: Element, path: Path) -> tuple[str, Any, bool]:
    label = str(item.get("label"))
    try:
        place = [float(value) for value in str(item.get("points")).split(",")]
    except ValueError:
        place = []
    if len(place) != 2:
        raise FigureError(path, f"point {label[:30]!r} is {str(item.get('points'))[:40]}", "give one point per label")
    return label, place, item.get("occluded") != "1"


TOOL_FORMATS: Final[tuple[FormatReader, ...]] = (coco, labelme, supervisely, label_studio, cvat)
