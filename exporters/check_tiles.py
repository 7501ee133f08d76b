"""Checks of 3D Tiles: the rules of tileset.json, and that every vertex lies inside the volumes that promise it.

https://docs.ogc.org/cs/22-025r4/22-025r4.html
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from exporters.check_gltf import check_gltf
from exporters.errors import ExportError
from exporters.findings import Finding
from exporters.gltf_reader import read_gltf
from georef.geodesy import geodetic_from_ecef, tile_from_asset

RIGID_TOLERANCE = 1e-9
"""Largest deviation of a rotation from an orthonormal matrix; float64 rounding leaves some 1e-16."""

INSIDE_TOLERANCE_M = 1e-6
"""Vertices this far outside a volume pass: float64 ECEF coordinates are good to 1e-9 m, boxes may be shared."""

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class _Volume:
    """A bounding volume and the matrix that takes its frame to the frame of the whole tileset."""

    volume: dict[str, Any]
    matrix: Matrix
    where: str


def check_tileset(path: Path, external: bool = True) -> list[Finding]:
    """Findings about a tileset and all it refers to.

    path : the tileset.json or its folder; external : as for `check_gltf`
    """
    path = path / "tileset.json" if path.is_dir() else path
    return list(_check_file(path, external, np.eye(4), [], math.inf, frozenset()))


def read_tileset(path: Path) -> dict[str, Any]:
    """The document of a tileset. Raises ExportError for a file that is not there or no tileset."""
    try:
        document = json.loads(path.read_bytes())
        if not isinstance(document, dict) or not isinstance(document.get("root"), dict):
            raise ValueError("no root tile")
        return document
    except (OSError, ValueError) as error:
        raise ExportError(path, f"no readable tileset ({error})", "write it again") from error


def _check_file(
    path: Path, external: bool, above: Matrix, volumes: list[_Volume], error_above: float, chain: frozenset[Path]
) -> Iterator[Finding]:
    name = path.name
    if path.resolve() in chain:
        yield Finding("error", "CYCLE", "the tileset contains itself", name)
        return
    try:
        document = read_tileset(path)
    except ExportError as problem:
        yield Finding("error", "UNREADABLE", problem.finding, name)
        return
    version = document.get("asset", {}).get("version")
    if version not in ("1.0", "1.1"):
        yield Finding("error", "VERSION", f"asset.version is {version}, expected 1.1", f"{name}: asset")
    error = _geometric_error(document)
    if error is None:
        yield Finding("error", "GEOMETRIC_ERROR", "the tileset needs a geometricError of 0 or more", name)
        error = math.inf
    if document["root"].get("refine") not in ("ADD", "REPLACE"):
        yield Finding("error", "REFINE", "the root tile needs refine ADD or REPLACE", f"{name}: root")
    if metadata := document.get("metadata"):
        if metadata.get("class") not in document.get("schema", {}).get("classes", {}):
            yield Finding("error", "METADATA", f"class {metadata.get('class')} is not in the schema", name)
        if "id" not in document.get("schema", {}):
            yield Finding("error", "SCHEMA_ID", "the schema has no id", name)
    walk = _Walk(path, external, chain | {path.resolve()})
    yield from walk.tile(document["root"], above, volumes, min(error, error_above), f"{name}: root")


@dataclass(frozen=True)
class _Walk:
    path: Path
    external: bool
    chain: frozenset[Path]

    def tile(
        self, tile: dict[str, Any], above: Matrix, volumes: list[_Volume], error_above: float, where: str
    ) -> Iterator[Finding]:
        local, problem = _transform(tile.get("transform"))
        if problem:
            yield Finding("error", "TRANSFORM", problem, where)
            return
        matrix = above @ local
        error = _geometric_error(tile)
        if error is None:
            yield Finding("error", "GEOMETRIC_ERROR", "the tile needs a geometricError of 0 or more", where)
            error = error_above
        elif error > error_above:
            message = f"geometricError {error:g} is larger than {error_above:g} of what it refines"
            yield Finding("error", "GEOMETRIC_ERROR", message, where)
        elif tile.get("children") and error == 0:
            yield Finding("warning", "NEVER_REFINED", "geometricError 0: viewers never load the children", where)
        problem = _volume_problem(tile.get("boundingVolume"))
        if problem:
            yield Finding("error", "BOUNDING_VOLUME", problem, where)
        else:
            volumes = [*volumes, _Volume(tile["boundingVolume"], matrix, where)]
        contents = [tile["content"]] if "content" in tile else tile.get("contents", [])
        for content in contents:
            inner = list(volumes)
            if "boundingVolume" in content:
                inner.append(_Volume(content["boundingVolume"], matrix, where))
            yield from self.content(content.get("uri", ""), matrix, inner, error, where)
        for index, child in enumerate(tile.get("children", [])):
            yield from self.tile(child, matrix, volumes, error, f"{where}/children/{index}")

    def content(
        self, uri: str, matrix: Matrix, volumes: list[_Volume], error: float, where: str
    ) -> Iterator[Finding]:  # fmt: skip
        file = self.path.parent / unquote(uri)
        if not uri or not file.is_file():
            yield Finding("error", "CONTENT", f"content {uri!r} is not there", where)
            return
        if file.suffix.lower() == ".json":
            yield from _check_file(file, self.external, matrix, volumes, error, self.chain)
            return
        if file.suffix.lower() not in (".glb", ".gltf"):
            yield Finding("warning", "CONTENT", f"content {uri!r} is of a kind that is not checked here", where)
            return
        yield from check_gltf(file, self.external)
        try:
            vertices = read_gltf(file).scene_vertices()
        except (ExportError, ValueError, LookupError, TypeError):
            return  # check_gltf has said so
        points = tile_from_asset().apply(vertices)
        for volume in volumes:
            # Into the volume's own frame before anything is compared: ECEF coordinates would cost eight digits.
            inner_from_outer = np.linalg.inv(volume.matrix) @ matrix
            if "region" in volume.volume:
                outside = _outside(volume.volume, points @ matrix[:3, :3].T + matrix[:3, 3])
            else:
                outside = _outside(volume.volume, points @ inner_from_outer[:3, :3].T + inner_from_outer[:3, 3])
            if outside > INSIDE_TOLERANCE_M:
                message = f"{uri}: vertices up to {outside:.3g} m outside the bounding volume"
                yield Finding("error", "OUTSIDE_VOLUME", message, volume.where)


def _geometric_error(item: dict[str, Any]) -> float | None:
    value = item.get("geometricError")
    usable = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and value >= 0
    return float(value) if usable and value is not None else None


def _numbers(values: Any, count: int) -> bool:
    return (
        isinstance(values, list)
        and len(values) == count
        and all(isinstance(value, int | float) and math.isfinite(value) for value in values)
    )


def _transform(values: Any) -> tuple[Matrix, str]:
    if values is None:
        return np.eye(4), ""
    if not _numbers(values, 16):
        return np.eye(4), "the transform is not 16 finite numbers"
    matrix = np.asarray(values, dtype=np.float64).reshape(4, 4).T
    if matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        return matrix, "the transform is not affine; is it written row by row?"
    rotation = matrix[:3, :3]
    off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if off > RIGID_TOLERANCE or np.linalg.det(rotation) < 0:
        return matrix, f"the transform is not rigid: off by {off:.2g}"
    return matrix, ""


def _volume_problem(volume: Any) -> str:
    if not isinstance(volume, dict):
        return "no bounding volume"
    if "box" in volume:
        if not _numbers(volume["box"], 12):
            return "box is not 12 finite numbers"
        axes = np.array(volume["box"][3:]).reshape(3, 3)
        return "" if abs(np.linalg.det(axes)) > 0 else "box is flat"
    if "sphere" in volume:
        return "" if _numbers(volume["sphere"], 4) and volume["sphere"][3] > 0 else "sphere is not 4 numbers"
    if "region" in volume:
        region = volume["region"]
        if not _numbers(region, 6):
            return "region is not 6 finite numbers"
        west, south, east, north, low, high = region
        angles = max(abs(west), abs(east)) <= math.pi and max(abs(south), abs(north)) <= math.pi / 2
        ordered = south <= north and low <= high
        return "" if angles and ordered else "region is not in radians, or not west, south, east, north, low, high"
    return "bounding volume is neither box nor sphere nor region"


def _outside(volume: dict[str, Any], points: NDArray[np.float64]) -> float:
    """How far, in metres, the farthest point lies outside: points in the volume's frame, ECEF for a region."""
    if not len(points):
        return 0.0
    if "box" in volume:
        box = np.asarray(volume["box"], dtype=np.float64)
        axes = box[3:].reshape(3, 3)
        length = np.linalg.norm(axes, axis=1)
        along = (points - box[:3]) @ np.linalg.inv(axes)
        return float(((np.abs(along) - 1) * length).max())
    if "sphere" in volume:
        sphere = np.asarray(volume["sphere"], dtype=np.float64)
        return float((np.linalg.norm(points - sphere[:3], axis=1) - sphere[3]).max())
    west, south, east, north, low, high = volume["region"]
    lon, lat, height = geodetic_from_ecef(points).T
    lon, lat = np.radians(lon), np.radians(lat)
    # Regions may cross the antimeridian, with west greater than east.
    past = np.mod(lon - west, 2 * math.pi)
    width = np.mod(east - west, 2 * math.pi) if east - west < 2 * math.pi else 2 * math.pi
    sideways = np.where(past <= width, 0.0, np.minimum(past - width, 2 * math.pi - past)) * np.cos(lat)
    radius = 6378137.0
    return float(
        max(sideways.max() * radius, (south - lat).max() * radius, (lat - north).max() * radius,
            (low - height).max(), (height - high).max())
    )  # fmt: skip
