"""Control points in a IIIF Georeference annotation.

https://iiif.io/api/extension/georef/: `resourceCoords` count pixels of the full resource from its upper left corner,
as IMAGE does; places are GeoJSON points, WGS 84, longitude first. Older annotations use `pixelCoords`. `resourceCrs`,
the projection of the sheet, is an extension by Allmaps.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from georef.errors import PlacementError
from georef.sheets.controls import MAX_POINTS, Controls, make_controls, read_text
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import parse_json

GEOREFERENCING = "georeferencing"

MAX_SELECTOR_CHARACTERS = 2000
"""Leading characters of an SVG selector that are searched for the size of the resource."""

METHODS = {
    "helmert": "helmert",
    "projective": "projective",
    "thinplatespline": "tps",
    "polynomial1": "poly1",
    "polynomial2": "poly2",
    "polynomial3": "poly3",
}


def is_annotation(path: Path) -> bool:
    """Whether a JSON file is a georeference annotation, or a page of annotations that holds one."""
    try:
        return any(True for _ in _annotations(_parsed(path)))
    except PlacementError:
        return False


def read_annotation(path: Path) -> Controls:
    """Control points of the one georeference annotation in a file.

    Raises PlacementError where there is none or more than one, and for features that are not control points.
    """
    found = list(_annotations(_parsed(path)))
    if len(found) != 1:
        finding = f"{len(found) or 'no'} georeference annotations"
        remedy = "save the one of this map in a separate file" if found else "give a IIIF Georeference annotation"
        raise PlacementError(path, finding, remedy)
    annotation = found[0]
    body = _body(annotation)
    assert body is not None  # checked by _annotations
    features = body.get("features")
    if not isinstance(features, list):
        raise PlacementError(path, "no features in the body", "give a IIIF Georeference annotation")
    if len(features) > MAX_POINTS:
        raise PlacementError(path, f"{len(features)} control points", f"give at most {MAX_POINTS}")
    rows = [_row(feature, number, path) for number, feature in enumerate(features, start=1)]
    plane = None
    if isinstance(crs := body.get("resourceCrs"), dict) and isinstance(crs.get("definition"), str):
        plane = crs["definition"]
    return make_controls(
        path, rows, crs="EPSG:4326", method=_method(body), plane=plane, size=_size(annotation.get("target"))
    )


def _parsed(path: Path) -> Any:
    try:
        return parse_json(read_text(path))
    except DamagedFile as error:
        raise PlacementError(path, str(error), "give a IIIF Georeference annotation") from None


def _annotations(document: Any) -> Iterator[dict[str, Any]]:
    """Georeference annotations of a document: itself, or the items of a page or list."""
    if isinstance(document, list):
        for item in document:
            if isinstance(item, dict):
                yield from _annotations(item)
    elif isinstance(document, dict):
        if isinstance(document.get("items"), list):
            yield from _annotations([item for item in document["items"] if isinstance(item, dict)])
        elif document.get("motivation", GEOREFERENCING) == GEOREFERENCING and _body(document) is not None:
            yield document


def _body(annotation: dict[str, Any]) -> dict[str, Any] | None:
    body = annotation.get("body")
    if isinstance(body, list) and len(body) == 1:
        body = body[0]
    return body if isinstance(body, dict) and body.get("type") == "FeatureCollection" else None


def _row(feature: Any, number: int, path: Path) -> tuple[float, ...]:
    where = feature if isinstance(feature, dict) else {}
    properties, geometry = where.get("properties"), where.get("geometry")
    pixel = None
    if isinstance(properties, dict):
        pixel = properties.get("resourceCoords", properties.get("pixelCoords"))
    place = geometry.get("coordinates") if isinstance(geometry, dict) and geometry.get("type") == "Point" else None
    for value, name in ((pixel, "resourceCoords"), (place, "Point")):
        numbers = isinstance(value, list) and len(value) >= 2 and all(type(v) in (int, float) for v in value[:2])
        if not numbers:
            raise PlacementError(path, f"feature {number} has no {name} of two numbers", "give a pixel and a place")
    assert pixel is not None  # checked
    assert place is not None
    if not (abs(place[1]) <= 90 and abs(place[0]) <= 540):
        raise PlacementError(
            path,
            f"feature {number} is at {place[:2]}, which is not a longitude and latitude",
            "give longitude first, then latitude",
        )
    return (pixel[0], pixel[1], place[0], place[1])


def _method(body: dict[str, Any]) -> str | None:
    transformation = body.get("transformation")
    if not isinstance(transformation, dict):
        return None
    name = str(transformation.get("type", ""))
    options = transformation.get("options")
    order = options.get("order", 1) if isinstance(options, dict) else 1
    if name.lower() == "polynomial" and order in (1, 2, 3):
        return f"poly{int(order)}"
    if name.lower() in METHODS:
        return METHODS[name.lower()]
    # Clients may choose another method than the preferred one; the caller warns that this one is unknown.
    return f"{name[:40]} of order {order!r}" if name.lower() == "polynomial" else name[:40] or None


def _size(target: Any) -> tuple[float, float] | None:
    """Width and height of the resource in whose pixels points are given, from the target."""
    if not isinstance(target, dict):
        return None
    for holder in (target.get("source"), target):
        if isinstance(holder, dict):
            sides = [holder[name] for name in ("width", "height") if _positive(holder.get(name))]
            if len(sides) == 2:
                return float(sides[0]), float(sides[1])
    selector = target.get("selector")
    # Only the beginning of a drawing is searched: XML is not parsed, and a search through all of it could be slow.
    drawing = str(selector.get("value"))[:MAX_SELECTOR_CHARACTERS] if isinstance(selector, dict) else ""
    found = [re.search(rf'<svg[^>]*\b{name}="(\d+(?:\.\d+)?)"', drawing) for name in ("width", "height")]
    numbers = [float(match[1]) for match in found if match is not None]
    return (numbers[0], numbers[1]) if len(numbers) == 2 and min(numbers) > 0 else None


def _positive(value: Any) -> bool:
    return type(value) in (int, float) and value > 0
