"""Comparison of what a client holds and shows with what was asked for."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from georef.geodesy import ecef_from_asset, geodetic_from_ecef
from georef.placement import GeoPlacement
from tests.clients.outputs import FIGURE
from tests.node import ROOT

RECORDS = ROOT / "build" / "clients"
"""For the table of docs/clients.md, one file for each test: docs/make_clients_table.py reads them."""

FOV_DEG = 20.0
SIZE = (240, 320)
MARGIN = 1.15

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Record:
    """What one client makes of one output; None where the client or the output has nothing of the kind.

    result : "opened", or "refused" where the client says that it cannot read it
    place_m : greatest distance of the feet of a figure from where they belong
    bearing_deg : greatest angle of the nose (and of the upright) to where it belongs
    height_percent : greatest error of the height, as the client holds it
    picture_px : greatest distance of the edges of the picture, of 320 rows, from where they belong
    overlap : intersection over union of the figure's front in the picture with the drawing
    colours : greatest difference, of 255, between the six commonest colours of the drawing and the picture
    seconds : to load and to draw it; no test compares them
    figures : how many were there
    texels : read back from canvases while it was loaded and drawn
    """

    client: str
    version: str
    output: str
    result: str = "opened"
    place_m: float | None = None
    bearing_deg: float | None = None
    height_percent: float | None = None
    picture_px: float | None = None
    overlap: float | None = None
    colours: float | None = None
    seconds: float | None = None
    figures: int | None = None
    texels: int | None = None
    note: str = ""


def keep(name: str, records: list[Record], pictures: dict[str, bytes] | None = None) -> None:
    """Write records and pictures for the table into build/clients."""
    RECORDS.mkdir(parents=True, exist_ok=True)
    text = json.dumps([asdict(each) for each in records], indent=1, ensure_ascii=False)
    (RECORDS / f"{name}.json").write_text(text, encoding="utf-8")
    for title, png in (pictures or {}).items():
        (RECORDS / f"{name} {title}.png".replace("/", "_")).write_bytes(png)


def stage_from_asset(placement: GeoPlacement) -> Array:
    """(4, 4) from ASSET to a stage with x east, y up, z south."""
    angle = np.radians(180.0 - placement.heading_deg)
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, 0, sin, 0], [0, 1, 0, 0], [-sin, 0, cos, 0], [0, 0, 0, 1.0]])


def matrix_of(frame: str, placement: GeoPlacement) -> Array:
    """(4, 4) from ASSET to the frame of an `Output`."""
    if frame == "earth":
        return np.asarray(ecef_from_asset(placement).matrix, np.float64)
    return stage_from_asset(placement) if frame == "stage" else np.eye(4)


def camera_of(matrix: Array, low: Array, high: Array, distance_m: float | None = None) -> dict[str, Any]:
    """A camera in front of a figure, level with its middle, see tests/clients/pages/page.js."""
    height = high[1] - low[1]
    away = distance_m or MARGIN * height / 2 / np.tan(np.radians(FOV_DEG / 2)) + high[2]
    middle = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, 0.0])
    eye, target, above = (
        (matrix @ np.append(point, 1.0))[:3] for point in (middle + [0, 0, away], middle, middle + [0, 1, 0])
    )
    camera = {"eye": list(eye), "target": list(target), "up": list(above - target), "fov_deg": FOV_DEG}
    camera["rows_per_m"] = SIZE[1] / 2 / np.tan(np.radians(FOV_DEG / 2)) / away
    if np.linalg.norm(eye) > 6e6:
        lon, lat, up = (float(value) for value in geodetic_from_ecef(target))
        camera["seen"] = {"lon_deg": lon, "lat_deg": lat, "height_m": up}
    return camera


def view_of(camera: dict[str, Any], points: Array) -> Array:
    """(N, 2) pixels (x, y) of points in the camera's world."""
    eye, target, up = (np.array(camera[key]) for key in ("eye", "target", "up"))
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, up) / np.linalg.norm(np.cross(ahead, up))
    above = np.cross(right, ahead)
    seen = points - eye
    scale = SIZE[1] / 2 / np.tan(np.radians(camera["fov_deg"] / 2)) / (seen @ ahead)
    return np.stack([SIZE[0] / 2 + (seen @ right) * scale, SIZE[1] / 2 - (seen @ above) * scale], axis=-1)


def transform_of(found: dict[str, Any], low: Array, high: Array) -> Array:
    """(4, 4) from ASSET to the world of a client, from the corners of a box in both."""

    def corners(a: Any, b: Any) -> Array:
        return np.array([*product(*zip(a, b, strict=True))], float)

    held = np.c_[corners(found["low"], found["high"]), np.ones(8)]
    there = held @ np.array(found["matrix"], float).reshape(4, 4)  # column-major, so transposed already
    known = np.c_[corners(low, high), np.ones(8)]
    middle = there[:, :3].mean(axis=0)  # or the solution has the rounding of numbers of the earth's size
    solved = np.linalg.lstsq(known, there[:, :3] - middle, rcond=None)[0]
    result = np.eye(4)
    result[:3] = solved.T
    result[:3, 3] += middle
    return result


def errors_of(actual: Array, asked: Array) -> tuple[float, float, float]:
    """Metres of the feet, degrees of nose or upright, percent of the height between two transforms of ASSET."""
    feet = float(np.linalg.norm(actual[:3, 3] - asked[:3, 3]))
    angles = []
    for axis in (1, 2):
        a, b = (matrix[:3, axis] / np.linalg.norm(matrix[:3, axis]) for matrix in (actual, asked))
        angles.append(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))
    height = np.linalg.norm(actual[:3, 1]) / np.linalg.norm(asked[:3, 1])
    return feet, float(max(angles)), float(100 * abs(height - 1))


def shown(picture: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """(H, W) where a picture has something else than its white background, the commonest colour of its edge."""
    edge = picture[0, 0, :3].astype(int)
    return np.abs(picture[..., :3].astype(int) - edge).max(axis=-1) > 12


def box_of(mask: NDArray[np.bool_]) -> Array:
    """Left, top, right and bottom edges of what is set, pixels."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not rows.size:
        return np.full(4, np.inf)
    return np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1], float)


@cache
def drawing() -> tuple[NDArray[np.bool_], tuple[tuple[int, int, int], ...]]:
    """The drawing's silhouette, cropped, and its six commonest colours."""
    with Image.open(FIGURE / "image.png") as image, Image.open(FIGURE / "mask.png") as mask:
        pixels, inside = np.asarray(image.convert("RGB")), np.asarray(mask.convert("L")) > 127
    colours, counts = np.unique(pixels[inside], axis=0, return_counts=True)
    common: list[tuple[int, int, int]] = []
    for colour in colours[np.argsort(-counts)]:
        if all(np.abs(colour.astype(int) - other).max() > 24 for other in common):
            common.append(tuple(int(value) for value in colour))
    left, top, right, bottom = box_of(inside).astype(int)
    return inside[top:bottom, left:right], tuple(common[:6])


def _scaled(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return np.asarray(Image.fromarray(mask.astype(np.uint8) * 255).resize((120, 240), Image.Resampling.BILINEAR)) > 127


def overlap_of(picture: NDArray[np.uint8], mirrored: bool = False) -> float:
    """Intersection over union of the silhouettes of a picture from the front and of the drawing, both cropped."""
    mask = shown(picture)
    if not mask.any():
        return 0.0
    left, top, right, bottom = box_of(mask).astype(int)
    mine, drawn = _scaled(mask[top:bottom, left:right]), _scaled(drawing()[0])
    drawn = drawn[:, ::-1] if mirrored else drawn
    return float((mine & drawn).sum() / (mine | drawn).sum())


def colours_off(picture: NDArray[np.uint8], pixels: int = 12) -> float:
    """Greatest difference between a common colour of the drawing and the nearest colour that some pixels have."""
    found, counts = np.unique(picture[shown(picture)][:, :3], axis=0, return_counts=True)
    if not len(found):
        return 255.0
    worst = 0.0
    for colour in drawing()[1]:
        differences = np.abs(found.astype(int) - colour).max(axis=1)
        order = np.argsort(differences, kind="stable")
        enough = np.flatnonzero(np.cumsum(counts[order]) >= pixels)
        worst = max(worst, float(differences[order][enough[0]]) if enough.size else 255.0)
    return worst


def matched(found: list[Array], asked: dict[str, Array]) -> dict[str, Array]:
    """The transform nearest each of those asked for."""
    return {
        name: min(found, key=lambda each: float(np.linalg.norm(each[:3, 3] - matrix[:3, 3])))
        for name, matrix in asked.items()
    }
