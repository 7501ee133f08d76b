"""Checks of 3D Tiles: the rules of tileset.json, that all vertices lie inside their bounding volumes, and that every
figure is at the place recorded in its file.

https://docs.ogc.org/cs/22-025r4/22-025r4.html
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from exporters.errors import ExportError
from exporters.findings import Finding, Severity
from exporters.georeference import placement_of_record
from exporters.tiles.check_content import Content, read_content
from exporters.tiles.check_metadata import check_entity, read_schema
from exporters.tiles.volumes import Matrix, Volume, read_transform, volume_problem
from georef.errors import PlacementError
from georef.geodesy import ecef_from_tile
from georef.untrusted.damage import DamagedFile, decoding
from georef.untrusted.json_file import is_plain_file, read_json
from georef.untrusted.json_shape import Required, check_shape

INSIDE_TOLERANCE_M = 1e-6
"""Tolerance of vertices outside a volume; float64 ECEF coordinates are accurate to 1e-9 m."""

CHILD_TOLERANCE_M = 1e-3
"""Tolerance of volumes of children outside those of their parents, harmless for viewers."""

PLACE_TOLERANCE_M, TURN_TOLERANCE_DEG = 1e-3, 0.01
"""Guaranteed accuracy of the position and heading of figures."""

MAX_VISITS_PER_FILE = 20
"""Limit of checks of one file: tilesets may refer to it a million times, or to each other exponentially often."""

SINCE_1_1 = ("schema", "schemaUri", "metadata", "groups", "contents", "implicitTiling")

_CONTENT = {"uri": str, "url": str}
_TILE: dict[str, Any] = {"content": _CONTENT, "contents": [_CONTENT]}
_TILE["children"] = [_TILE]

TILESET = {"asset": dict, "root": Required(_TILE), "groups": list, "extensionsRequired": [str]}
"""Shape of the used members of a tileset; numbers are checked individually, as each problem is a finding of its own."""


def check_tileset(path: Path, external: bool = True) -> list[Finding]:
    """Check a tileset and everything it refers to.

    path : the tileset.json or its folder; external : as for `check_gltf`
    """
    path = path / "tileset.json" if path.is_dir() else path
    return list(_check_file(path, external, _Inherited(np.eye(4), (), math.inf, False), frozenset(), Counter()))


def read_tileset(path: Path) -> dict[str, Any]:
    """Read the document of a tileset. Raises ExportError for a file that is missing or not a tileset."""
    remedy = "give a tileset.json of 3D Tiles"
    document: dict[str, Any] = read_json(path, remedy, ExportError)
    if not isinstance(document, dict) or not isinstance(document.get("root"), dict):
        raise ExportError(path, "no root tile", remedy)
    try:
        check_shape(document, TILESET)
    except DamagedFile as error:
        raise ExportError(path, str(error), remedy) from error
    return document


@dataclass(frozen=True)
class _Inherited:
    """State inherited by a tile: transform, volumes, error of the parent, and whether any ancestor has a transform."""

    matrix: Matrix
    volumes: tuple[Volume, ...]
    error: float
    placed: bool


def _check_file(
    path: Path, external: bool, above: _Inherited, chain: frozenset[Path], visits: Counter[Path]
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
    asset = document.get("asset", {})
    version = asset.get("version")
    if version not in ("1.0", "1.1"):
        yield Finding("error", "VERSION", f"asset.version is {version}, expected 1.0 or 1.1", f"{name}: asset")
    error = _geometric_error(document)
    if error is None:
        yield Finding("error", "GEOMETRIC_ERROR", "the tileset needs a geometricError of 0 or more", name)
        error = math.inf
    if document["root"].get("refine") not in ("ADD", "REPLACE"):
        yield Finding("error", "REFINE", "the root tile needs refine ADD or REPLACE", f"{name}: root")
    for extension in document.get("extensionsRequired", []):
        yield Finding("info", "NOT_CHECKED", f"extension {extension} is not checked", name)
    schema, findings = read_schema(document, path)
    yield from findings
    if "metadata" in document:
        yield from check_entity(document["metadata"], schema, name)
    for index, group in enumerate(document.get("groups", [])):
        yield from check_entity(group, schema, f"{name}: groups/{index}")
    own = asset.get("generator") == "fig2mesh"
    up_axis = str(asset.get("gltfUpAxis", "Y")).upper()
    walk = _Walk(path, external, chain | {path.resolve()}, visits, schema, version == "1.0", own, up_axis)
    yield from walk.too_new(document, name)
    yield from walk.tile(document["root"], replace(above, error=min(error, above.error)), f"{name}: root")


@dataclass(frozen=True)
class _Walk:
    """Traversal of one tileset file: its path, visits of each file, and options of the checks of its tiles."""

    path: Path
    external: bool
    chain: frozenset[Path]
    visits: Counter[Path]
    schema: dict[str, Any] | None
    old: bool
    own: bool
    up_axis: str

    def too_new(self, item: dict[str, Any], where: str) -> Iterator[Finding]:
        if self.old:
            for key in SINCE_1_1:
                if key in item:
                    yield Finding("warning", "VERSION_1_1", f"{key} does not exist in version 1.0", where)

    def tile(self, tile: dict[str, Any], above: _Inherited, where: str) -> Iterator[Finding]:
        local, problem, unusual = read_transform(tile.get("transform"))
        if problem:
            yield Finding("error", "TRANSFORM", problem, where)
            return
        if unusual:
            yield Finding("error" if self.own else "warning", "TRANSFORM", unusual, where)
        matrix = above.matrix @ local
        error = _geometric_error(tile)
        if error is None:
            yield Finding("error", "GEOMETRIC_ERROR", "the tile needs a geometricError of 0 or more", where)
            error = above.error
        elif error > above.error:
            message = f"geometricError {error:g} is larger than {above.error:g} of its parent"
            yield Finding("error", "GEOMETRIC_ERROR", message, where)
        elif tile.get("children") and error == 0:
            yield Finding("warning", "NEVER_REFINED", "geometricError 0: viewers never load the children", where)
        yield from self.too_new(tile, where)
        if "metadata" in tile:
            yield from check_entity(tile["metadata"], self.schema, where)
        volumes = above.volumes
        problem = volume_problem(tile.get("boundingVolume"))
        if problem:
            yield Finding("error", "BOUNDING_VOLUME", problem, where)
        else:
            volume = Volume(tile["boundingVolume"], matrix, where)
            with _measuring():
                excess = volumes[-1].excess_of(volume) if volumes else 0.0
            if excess > CHILD_TOLERANCE_M:
                # Legal, as only content has to be inside; fig2mesh guarantees more.
                severity: Severity = "warning" if self.own else "info"
                yield Finding(severity, "CHILD_VOLUME", f"reaches {excess:.3g} m out of its parent's volume", where)
            volumes = (*volumes, volume)
        here = _Inherited(matrix, volumes, error, above.placed or "transform" in tile)
        yield from self.contents(tile, here, where)
        for index, child in enumerate(tile.get("children", [])):
            yield from self.tile(child, here, f"{where}/children/{index}")

    def contents(self, tile: dict[str, Any], here: _Inherited, where: str) -> Iterator[Finding]:
        if "implicitTiling" in tile:
            yield Finding("info", "NOT_CHECKED", "implicit tiling: its subtrees are not checked", where)
            return
        for content in [tile["content"]] if "content" in tile else tile.get("contents", []):
            inner = here
            if "boundingVolume" in content:
                if problem := volume_problem(content["boundingVolume"]):
                    yield Finding("error", "BOUNDING_VOLUME", problem, f"{where}: content")
                else:
                    volume = Volume(content["boundingVolume"], here.matrix, f"{where}: content")
                    inner = replace(here, volumes=(*here.volumes, volume))
            if "metadata" in content:
                yield from check_entity(content["metadata"], self.schema, f"{where}: content")
            # Drafts of 1.0 and some old exporters use url.
            yield from self.content(str(content.get("uri", content.get("url", ""))), inner, where)

    def content(self, uri: str, here: _Inherited, where: str) -> Iterator[Finding]:
        if uri.startswith(("http:", "https:", "data:", "//")):
            yield Finding("info", "NOT_CHECKED", f"content {uri[:60]} is remote and not checked", where)
            return
        file = self.path.parent / unquote(uri)
        if not is_plain_file(file):
            file = self.path.parent / unquote(uri.partition("?")[0].partition("#")[0])
        if not uri or not is_plain_file(file):
            yield Finding("error", "CONTENT", f"content {uri!r} not found", where)
            return
        self.visits[file.resolve()] += 1
        if (count := self.visits[file.resolve()]) > MAX_VISITS_PER_FILE:
            if count == MAX_VISITS_PER_FILE + 1:
                message = f"{uri}: referred to more than {MAX_VISITS_PER_FILE} times, the others are not checked"
                yield Finding("info", "NOT_CHECKED", message, where)
            return
        content = read_content(file, self.external, self.up_axis)
        if content.kind == "tileset":
            yield from _check_file(file, self.external, here, self.chain, self.visits)
            return
        yield from content.findings
        if self.old and file.suffix.lower() in (".glb", ".gltf"):
            yield Finding("warning", "VERSION_1_1", "glTF is not a content type of version 1.0", where)
        if content.points is not None and len(content.points):
            for volume in here.volumes:
                with _measuring():
                    outside = volume.outside(content.points, here.matrix)
                if outside > INSIDE_TOLERANCE_M:
                    message = f"{uri}: vertices up to {outside:.3g} m outside the bounding volume"
                    yield Finding("error", "OUTSIDE_VOLUME", message, volume.where)
        yield from _check_place(content, here, f"{where}: {uri}")


def _check_place(content: Content, here: _Inherited, where: str) -> Iterator[Finding]:
    """Compare the place of a figure by the transforms above it with the one recorded in its file."""
    if content.georeference is None:
        return
    try:
        expected = ecef_from_tile(placement_of_record(content.georeference)).matrix
    except (DamagedFile, PlacementError) as error:
        yield Finding("warning", "PLACE", str(error), where)
        return
    away = float(np.linalg.norm(here.matrix[:3, 3] - expected[:3, 3]))
    # From the whole rotation, as bearings are undefined at the poles: sin(angle / 2) from the largest difference.
    gap = float(np.linalg.norm(here.matrix[:3, :3] - expected[:3, :3])) / math.sqrt(8)
    turn = math.degrees(2 * math.asin(min(gap, 1.0)))
    if not here.placed:
        yield Finding("error", "PLACE", "no transform to the place recorded in its file", where)
    elif away > PLACE_TOLERANCE_M or turn > TURN_TOLERANCE_DEG:
        message = f"{away:.3g} m and {turn:.3g} degrees from the place recorded in its file"
        yield Finding("error", "PLACE", message, where)


def _measuring() -> AbstractContextManager[None]:
    return decoding("a volume with too large numbers", PlacementError, np.linalg.LinAlgError)


def _geometric_error(item: dict[str, Any]) -> float | None:
    value = item.get("geometricError")
    usable = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and value >= 0
    return float(value) if usable and value is not None else None
