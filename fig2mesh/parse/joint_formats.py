"""Joints in the files of annotation tools, distinguished by content: COCO, LabelMe, Supervisely.

https://cocodataset.org/#format-data
https://github.com/wkentaro/labelme
https://developer.supervisely.com/getting-started/supervisely-annotation-format
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fig2mesh.errors import FigureError
from fig2mesh.parse.joint_names import KNOWN, Point, canonical

Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class NamedPoints:
    """Points of one figure, as read from a file.

    points : canonical name → (2,) float64, IMAGE; visible : the same names → whether it is visible
    size : (width, height) of the picture, None where the file does not state it
    """

    points: dict[str, Point]
    visible: dict[str, bool]
    size: tuple[int, int] | None


def named_points(content: Any, path: Path, picture: str, bbox: Box | None) -> NamedPoints | None:
    """Points of the one figure in a file; None for a file of none of these formats.

    content : the parsed JSON
    picture : file name of the drawing, by which one of several pictures in a COCO file is chosen
    bbox : x0, y0, x1, y1, IMAGE, by which one of several figures is chosen: the one with most points inside

    Raises FigureError for a damaged file, or one in which the figure is ambiguous.
    """
    if not isinstance(content, dict):
        return None
    if isinstance(content.get("annotations"), list):
        figures = _coco(content, path, picture)
    elif isinstance(content.get("shapes"), list):
        figures = _labelme(content, path)
    elif isinstance(content.get("objects"), list):
        figures = _supervisely(content, path)
    else:
        return None
    figures = [figure for figure in figures if figure.points]
    if not figures:
        raise FigureError(path, "no joints with known names", "name them head, neck, left_shoulder, … as in the README")
    if len(figures) > 1 and bbox is not None:
        inside = [sum(_inside(point, bbox) for point in figure.points.values()) for figure in figures]
        figures = [figure for figure, count in zip(figures, inside, strict=True) if count == max(inside)]
    if len(figures) > 1:
        raise FigureError(path, f"{len(figures)} figures", "pass --bbox X0 Y0 X1 Y1 round the one that is meant")
    return figures[0]


def _inside(point: Point, bbox: Box) -> bool:
    x0, y0, x1, y1 = bbox
    return bool(x0 <= point[0] <= x1 and y0 <= point[1] <= y1)


def _coco(content: dict[str, Any], path: Path, picture: str) -> list[NamedPoints]:
    images = {_key(item.get("id")): item for item in _objects(content.get("images"))}
    names = {
        _key(item.get("id")): [canonical(str(name)) for name in item["keypoints"]]
        for item in _objects(content.get("categories"))
        if isinstance(item.get("keypoints"), list)
    }
    wanted = {key for key, item in images.items() if Path(str(item.get("file_name", ""))).name == picture}
    figures = []
    for annotation in _objects(content["annotations"]):
        image_key = _key(annotation.get("image_id"))
        if not isinstance(annotation.get("keypoints"), list) or (wanted and image_key not in wanted):
            continue
        labels = names.get(_key(annotation.get("category_id"))) or next(iter(names.values()), [])
        values = annotation["keypoints"]
        if len(values) != 3 * len(labels):
            found = f"{len(values)} numbers for {len(labels)} keypoint names"
            raise FigureError(path, found, "give x, y, v for each name in categories[].keypoints")
        image = images.get(image_key, {})
        # v: 0 not labelled, 1 labelled but hidden, 2 visible.
        triples = [(label, values[3 * i : 3 * i + 2], values[3 * i + 2]) for i, label in enumerate(labels)]
        shown = [(label, point, flag == 2) for label, point, flag in triples if flag]
        figures.append(_figure(shown, _size(image.get("width"), image.get("height")), path))
    return figures


def _labelme(content: dict[str, Any], path: Path) -> list[NamedPoints]:
    groups: dict[str, list[tuple[str, Any, bool]]] = {}
    for shape in _objects(content["shapes"]):
        if shape.get("shape_type", "point") != "point":
            continue
        points = shape.get("points")
        if not isinstance(points, list) or len(points) != 1:
            raise FigureError(path, f"point {str(shape.get('label'))[:30]!r} without coordinates", "draw it again")
        flags = shape.get("flags")
        hidden = isinstance(flags, dict) and any(flags.get(word) for word in ("hidden", "occluded", "invisible"))
        group = groups.setdefault(_key(shape.get("group_id")), [])
        group.append((canonical(str(shape.get("label"))), points[0], not hidden))
    size = _size(content.get("imageWidth"), content.get("imageHeight"))
    return [_figure(group, size, path) for group in groups.values()]


def _supervisely(content: dict[str, Any], path: Path) -> list[NamedPoints]:
    size = content.get("size")
    shape = _size(size.get("width"), size.get("height")) if isinstance(size, dict) else None
    loose, figures = [], []
    for item in _objects(content["objects"]):
        if item.get("geometryType") == "point":
            exterior = item.get("points", {}).get("exterior") if isinstance(item.get("points"), dict) else None
            if not isinstance(exterior, list) or len(exterior) != 1:
                raise FigureError(path, f"point {str(item.get('classTitle'))[:30]!r} is damaged", "export it again")
            loose.append((canonical(str(item.get("classTitle"))), exterior[0], not _tagged_hidden(item)))
        elif item.get("geometryType") == "graph" and isinstance(item.get("nodes"), dict):
            # Nodes are keyed by their label, or by an identifier whose label stands in the node.
            nodes = [
                (canonical(str(node.get("label") or key)), node.get("loc"), not node.get("disabled", False))
                for key, node in item["nodes"].items()
                if isinstance(node, dict)
            ]
            figures.append(_figure(nodes, shape, path))
    return figures + ([_figure(loose, shape, path)] if loose else [])


def _tagged_hidden(item: dict[str, Any]) -> bool:
    return any(str(tag.get("name")).lower() in ("hidden", "occluded") for tag in _objects(item.get("tags")))


def _objects(values: Any) -> list[dict[str, Any]]:
    return [value for value in values if isinstance(value, dict)] if isinstance(values, list) else []


def _key(identifier: Any) -> str:
    """Identifier as text: usually a number or a string, but whatever a damaged file has must not break the lookup."""
    return repr(identifier)


def _figure(named: list[tuple[str, Any, bool]], size: tuple[int, int] | None, path: Path) -> NamedPoints:
    points: dict[str, Point] = {}
    visible: dict[str, bool] = {}
    for name, value, shown in named:
        if name not in KNOWN:
            continue  # annotation files hold other things too
        if name in points:
            raise FigureError(path, f"{name} twice", "keep one of each, or give each figure a group")
        try:
            point = np.asarray(value, np.float64)
        except (TypeError, ValueError):
            point = np.full(2, np.nan)
        if point.shape != (2,) or not (np.abs(point) < 1e9).all():
            raise FigureError(path, f"{name} is {str(value)[:60]}", "give x and y as finite numbers")
        points[name], visible[name] = point, shown
    return NamedPoints(points, visible, size)


def _size(width: Any, height: Any) -> tuple[int, int] | None:
    usable = isinstance(width, int) and isinstance(height, int) and width > 0 and height > 0
    return (width, height) if usable else None
