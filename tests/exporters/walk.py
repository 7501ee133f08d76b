"""An independent walk over tilesets, in memory or on disk: each content with the matrices and volumes above it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from exporters.gltf.reader import read_gltf
from exporters.texture_files import texture_size


@dataclass(frozen=True)
class VisitedContent:
    """A content: its uri, the tile, ECEF from TILE, boxes above it in ECEF (centre, axes), errors above, depth."""

    uri: str
    tile: dict[str, Any]
    matrix: np.ndarray
    boxes: tuple[tuple[np.ndarray, np.ndarray], ...]
    errors: tuple[float, ...]
    depth: int


def contents(documents: dict[str, Any] | Path, name: str = "tileset.json") -> Iterator[VisitedContent]:
    """Contents that are no tilesets; documents : file name → document, or the folder they are in."""
    if isinstance(documents, Path):
        folder = documents

        def read(file: str) -> dict[str, Any]:
            return json.loads((folder / file).read_text())
    else:
        read = documents.__getitem__
    document = read(name)
    yield from _walk(document["root"], read, np.eye(4), (), (document["geometricError"],), 1)


def _walk(
    tile: dict[str, Any], read: Callable[[str], Any], above: np.ndarray, boxes: Any, errors: Any, depth: int
) -> Iterator[VisitedContent]:
    matrix = above @ np.array(tile.get("transform", np.eye(4).T.ravel())).reshape(4, 4).T
    box = np.array(tile["boundingVolume"]["box"])
    centre = matrix[:3, :3] @ box[:3] + matrix[:3, 3]
    boxes = (*boxes, (centre, box[3:].reshape(3, 3) @ matrix[:3, :3].T))
    errors = (*errors, tile["geometricError"])
    if "content" in tile:
        uri = unquote(tile["content"]["uri"])
        if uri.endswith(".json"):
            document = read(uri)
            yield from _walk(document["root"], read, matrix, boxes, (*errors, document["geometricError"]), depth)
        else:
            yield VisitedContent(uri, tile, matrix, boxes, errors, depth)
    for child in tile.get("children", []):
        yield from _walk(child, read, matrix, boxes, errors, depth + 1)


def outside(points: np.ndarray, centre: np.ndarray, axes: np.ndarray) -> float:
    """Largest distance, metres, of ECEF points outside a box of three orthogonal half axes (rows)."""
    length = np.linalg.norm(axes, axis=1)
    along = (points - centre) @ (axes / length[:, None]).T
    return float((np.abs(along) - length).max())


def property_texels(path: Path) -> int:
    """Number of texels in the property textures of a glTF file."""
    gltf = read_gltf(path)
    textures = [
        gltf.item("textures", each["index"])
        for holder in gltf.extension("EXT_structural_metadata").get("propertyTextures", [])
        for each in holder["properties"].values()
    ]
    return sum(math.prod(texture_size(gltf.image(texture["source"]))) for texture in textures)
