"""Small georeferenced sheets for the tests, in every form that is read."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyproj
from PIL import Image

from georef.sheets.controls import FloatArray

SIZE = (400, 300)
"""Pixels."""

SWISS = "EPSG:2056"

TURN_DEG = 20.0
METRES_PX = 5.0
MIDDLE = (2_683_000.0, 1_247_000.0)
"""The sheet of most tests: Zurich in the Swiss grid, its "up" turned 20 degrees east of grid north, 5 m a pixel."""


def swiss(pixels: FloatArray) -> FloatArray:
    """(N, 2) eastings and northings of (N, 2) pixels of that sheet."""
    turn = np.radians(TURN_DEG)
    right, down = (np.cos(turn), -np.sin(turn)), (-np.sin(turn), -np.cos(turn))
    offset = np.atleast_2d(pixels) - np.array(SIZE) / 2
    return np.array(MIDDLE) + METRES_PX * offset @ np.array([right, down])


def matrix() -> FloatArray:
    """(2, 3) the same as an affine map of IMAGE."""
    origin, right, down = swiss(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    return np.stack([right - origin, down - origin, origin], axis=1)


def lonlat(points: FloatArray, crs: str = SWISS) -> FloatArray:
    """(N, 2) WGS 84 of coordinates in a reference system, by pyproj alone."""
    transformer = pyproj.Transformer.from_crs(crs, "EPSG:4326", always_xy=True, allow_ballpark=False)
    return np.stack(transformer.transform(*np.atleast_2d(points).T), axis=1)


def controls(count: int = 9, seed: int = 0) -> FloatArray:
    """(N, 2) pixels spread over the sheet."""
    rng = np.random.default_rng(seed)
    corners = np.array([[12.0, 9.5], [390, 20], [20, 280], [380.5, 290]])
    return np.concatenate([corners, rng.uniform((10, 10), (390, 290), (count - 4, 2))])


def picture(path: Path, size: tuple[int, int] = SIZE) -> Path:
    Image.new("L", size, 200).save(path)
    return path


def world_file(path: Path, affine: FloatArray | None = None, comma: bool = False) -> Path:
    """The six lines of an affine map of IMAGE, whose last two are the centre of the first pixel."""
    m = matrix() if affine is None else affine
    centre = m @ (0.5, 0.5, 1.0)
    numbers = [m[0, 0], m[1, 0], m[0, 1], m[1, 1], *centre]
    text = "\r\n".join(f"{number:.12f}" for number in numbers) + "\r\n"
    path.write_text(text.replace(".", ",") if comma else text, newline="")
    return path


def points_file(path: Path, pixels: FloatArray, coordinates: FloatArray, crs: str | None = SWISS) -> Path:
    """As QGIS 3.26 and later write it."""
    head = [] if crs is None else [f"#CRS: {pyproj.CRS(crs).to_wkt()}"]
    rows = [
        f"{e!r},{n!r},{x!r},{-y!r},1,0,0,0"
        for (x, y), (e, n) in zip(pixels.tolist(), coordinates.tolist(), strict=True)
    ]
    path.write_text("\n".join([*head, "mapX,mapY,sourceX,sourceY,enable,dX,dY,residual", *rows]) + "\n")
    return path


def annotation(
    pixels: FloatArray, places: FloatArray, size: tuple[int, int] = SIZE, **body: object
) -> dict[str, object]:
    """A georeference annotation; places : (N, 2) longitude and latitude."""
    features = [
        {
            "type": "Feature",
            "properties": {"resourceCoords": list(p)},
            "geometry": {"type": "Point", "coordinates": list(q)},
        }
        for p, q in zip(pixels.tolist(), places.tolist(), strict=True)
    ]
    return {
        "type": "Annotation",
        "motivation": "georeferencing",
        "target": {
            "type": "SpecificResource",
            "source": {"type": "ImageService2", "width": size[0], "height": size[1]},
        },
        "body": {"type": "FeatureCollection", "features": features, **body},
    }


def annotation_file(path: Path, *arguments: object, **more: object) -> Path:
    path.write_text(json.dumps(annotation(*arguments, **more)))  # type: ignore[arg-type]
    return path
