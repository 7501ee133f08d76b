"""Checks of GeoJSON and CZML: structure, valid coordinates, existing models at the same place.

https://www.rfc-editor.org/rfc/rfc7946
https://github.com/AnalyticalGraphicsInc/czml-writer/wiki/CZML-Structure
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from exporters.errors import ExportError
from exporters.findings import Finding
from exporters.georeference import placement_of_record
from exporters.gis.czml import entity_quaternion, height_reference
from exporters.gltf.reader import open_glb
from exporters.tiles.check import PLACE_TOLERANCE_M, TURN_TOLERANCE_DEG
from exporters.tiles.volumes import is_number_list
from georef.geodesy import ecef_from_geodetic
from georef.placement import GeoPlacement
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import is_plain_file, read_json
from georef.untrusted.json_shape import check_shape

# fmt: off
GEOMETRIES = {
    "Point": 0, "MultiPoint": 1, "LineString": 1, "MultiLineString": 2, "Polygon": 2, "MultiPolygon": 3,
}
# fmt: on
"""Geometry types, and the nesting depth of their positions."""

# fmt: off
HEIGHT_REFERENCES = {
    "NONE", "CLAMP_TO_GROUND", "RELATIVE_TO_GROUND", "CLAMP_TO_TERRAIN", "RELATIVE_TO_TERRAIN",
    "CLAMP_TO_3D_TILE", "RELATIVE_TO_3D_TILE",
}
# fmt: on


def _document(path: Path) -> Any:
    return read_json(path, "write it again", ExportError)


def check_geojson(path: Path) -> list[Finding]:
    """Check a GeoJSON file."""
    try:
        document = _document(path)
    except ExportError as error:
        return [Finding("error", "UNREADABLE", error.finding, path.name)]
    return list(_geojson(document, path, path.name))


def _geojson(item: Any, path: Path, where: str) -> Iterator[Finding]:
    kind = str(item.get("type")) if isinstance(item, dict) else None
    if kind == "FeatureCollection":
        if not isinstance(item.get("features"), list):
            yield Finding("error", "FEATURES", "a FeatureCollection needs features", where)
            return
        for index, each in enumerate(item["features"]):
            if isinstance(each, dict) and each.get("type") == "Feature":
                yield from _geojson(each, path, f"{where}: features/{index}")
            else:
                yield Finding("error", "FEATURES", "not a Feature", f"{where}: features/{index}")
    elif kind == "Feature":
        if "geometry" not in item or not isinstance(item.get("properties", 0), dict | None):
            yield Finding("error", "FEATURE", "a Feature needs geometry and properties, or null for them", where)
            return
        found = [] if item["geometry"] is None else list(_geojson(item["geometry"], path, where))
        yield from found or _model_of_feature(item, path, where)
    elif kind == "GeometryCollection":
        if not isinstance(item.get("geometries"), list):
            yield Finding("error", "GEOMETRIES", "a GeometryCollection needs geometries", where)
            return
        for each in item["geometries"]:
            yield from _geojson(each, path, where)
    elif kind in GEOMETRIES:
        yield from _positions(item.get("coordinates"), GEOMETRIES[kind], where)
    else:
        yield Finding("error", "TYPE", f"type {kind!r} is not a GeoJSON type", where)
    if isinstance(item, dict) and "crs" in item:
        yield Finding("warning", "CRS", "crs is not part of RFC 7946: coordinates are WGS 84", where)


def _positions(values: Any, depth: int, where: str) -> Iterator[Finding]:
    if depth and isinstance(values, list):
        for each in values:
            yield from _positions(each, depth - 1, where)
    elif depth or not isinstance(values, list) or not is_number_list(values, len(values)) or len(values) < 2:
        yield Finding("error", "COORDINATES", "coordinates are not lists of numbers of the depth of its type", where)
    else:
        yield from _range(values, where)


def _range(values: list[Any], where: str) -> Iterator[Finding]:
    if abs(values[0]) > 180 or abs(values[1]) > 90:
        swapped = "; latitude first?" if abs(values[0]) <= 90 and abs(values[1]) <= 180 else ""
        yield Finding("error", "LONLAT", f"{values[:2]} is not a longitude and latitude in degrees{swapped}", where)


def _model_of_feature(item: dict[str, Any], path: Path, where: str) -> Iterator[Finding]:
    uri = (item.get("properties") or {}).get("model")
    point = item["geometry"]
    if not isinstance(uri, str) or not isinstance(point, dict) or point.get("type") != "Point":
        return
    place, findings = _placement(uri, path, where)
    yield from findings
    if place is None:
        return
    if place.altitude_mode == "clamp":
        yield from _same_place([*point["coordinates"][:2], place.height_m], place, where)
    else:
        yield from _same_place([*point["coordinates"], 0.0][:3], place, where)
    heading = item["properties"].get("heading_deg")
    if isinstance(heading, int | float):
        turn = abs((heading - place.heading_deg + 180) % 360 - 180)
        if turn > TURN_TOLERANCE_DEG:
            yield Finding("error", "PLACE", f"heading is {turn:.3g} degrees from that of {uri}", where)


def _placement(uri: str, path: Path, where: str) -> tuple[GeoPlacement | None, list[Finding]]:
    """Placement recorded in a model, None if there is none or the model is remote, and findings about the reference."""
    if uri.startswith(("http:", "https:", "data:", "//")):
        return None, [Finding("info", "NOT_CHECKED", f"model {uri[:60]} is remote and not checked", where)]
    file = path.parent / unquote(uri)
    if not is_plain_file(file):
        return None, [Finding("error", "REFERENCE", f"model {uri!r} not found", where)]
    if file.suffix.lower() != ".glb":
        return None, []
    try:
        record = open_glb(file).extras.get("georeference")
        return (placement_of_record(record) if record is not None else None), []
    except (ExportError, DamagedFile) as error:
        return None, [Finding("error", "REFERENCE", f"model {uri!r}: {error}", where)]


def _same_place(lon_lat_height: list[float], place: GeoPlacement, where: str) -> Iterator[Finding]:
    expected = ecef_from_geodetic([place.lon_deg, place.lat_deg, place.height_m])
    away = float(np.linalg.norm(ecef_from_geodetic(lon_lat_height) - expected))
    if away > PLACE_TOLERANCE_M:
        yield Finding("error", "PLACE", f"{away:.3g} m from the place recorded in its model", where)


def check_czml(path: Path) -> list[Finding]:
    """Check a CZML document."""
    try:
        packets = _document(path)
    except ExportError as error:
        return [Finding("error", "UNREADABLE", error.finding, path.name)]
    return list(_packets(packets, path))


def _packets(packets: Any, path: Path) -> Iterator[Finding]:
    name = path.name
    if not isinstance(packets, list) or not packets or not all(isinstance(each, dict) for each in packets):
        yield Finding("error", "PACKETS", "a CZML document is a list of packets", name)
        return
    if packets[0].get("id") != "document" or packets[0].get("version") != "1.0":
        yield Finding("error", "DOCUMENT", 'the first packet needs id "document" and version "1.0"', name)
    known: set[str] = set()
    for index, packet in enumerate(packets[1:], 1):
        where = f"{name}: {packet.get('id', index)}"
        if str(packet.get("id")) in known:
            # Legal: later packets add to earlier ones. Here it would merge two figures.
            yield Finding("warning", "SAME_ID", "an earlier packet has the same id", where)
        known.add(str(packet.get("id")))
        yield from _packet(packet, path, where)


def _packet(packet: dict[str, Any], path: Path, where: str) -> Iterator[Finding]:
    check_shape(packet, {"position": dict, "orientation": dict}, where)
    position = packet.get("position", {}).get("cartographicDegrees")
    if position is not None and not (isinstance(position, list) and is_number_list(position, len(position))):
        yield Finding("error", "COORDINATES", "cartographicDegrees are not numbers", where)
        return
    fixed: list[float] = position if position is not None and len(position) == 3 else []
    if problems := list(_range(fixed, where)) if fixed else []:
        yield from problems
        return
    orientation = packet.get("orientation", {}).get("unitQuaternion")
    if orientation is not None and not isinstance(orientation, list):
        yield Finding("error", "ORIENTATION", "unitQuaternion is not a list", where)
        return
    elif (
        orientation is not None
        and len(orientation) == 4
        and not (is_number_list(orientation, 4) and _is_unit(orientation))
    ):
        yield Finding("error", "ORIENTATION", "unitQuaternion is not of length 1", where)
        return
    model = packet.get("model")
    if not isinstance(model, dict):
        return
    reference = model.get("heightReference", "NONE")
    if isinstance(reference, str) and reference not in HEIGHT_REFERENCES:
        yield Finding("error", "HEIGHT_REFERENCE", f"{reference} is unknown to CesiumJS", where)
    uri = model.get("gltf")
    uri = uri.get("uri") if isinstance(uri, dict) else uri
    if not isinstance(uri, str):
        yield Finding("warning", "NO_MODEL", "the model names no glTF", where)
        return
    place, findings = _placement(uri, path, where)
    yield from findings
    if place is None:
        return
    if not fixed or orientation is None or len(orientation) != 4:
        yield Finding("warning", "PLACE", "no fixed position and orientation, unlike its model", where)
        return
    yield from _same_place(fixed, place, where)
    # Both signs of a quaternion are the same rotation.
    cosine = abs(float(np.dot(orientation, entity_quaternion(place))))
    if 2 * math.degrees(math.acos(min(cosine, 1.0))) > TURN_TOLERANCE_DEG:
        yield Finding("error", "PLACE", "its orientation differs from that recorded in its model", where)
    if reference != height_reference(place):
        expected = height_reference(place)
        yield Finding("error", "HEIGHT_REFERENCE", f"{reference}, expected {expected} as for its model", where)


def _is_unit(values: list[float]) -> bool:
    return abs(math.hypot(*values) - 1) <= 1e-6
