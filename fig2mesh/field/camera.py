"""Rays of orthographic and perspective cameras (paper §4.3, §4.5), and images of what they meet.

Yaw turns the camera about the figure: 0 sees the front (camera at +z), 90 the figure's left side (camera at +x),
180 the back, 270 the right side. Pitch lifts it: 90 looks straight down. Pixel centres lie at +0.5, row 0 on top.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fig2mesh.records import FloatArray, Hits, IntArray, Rays

VIEW_YAW_DEG: dict[str, float] = {"front": 0.0, "left": 90.0, "back": 180.0, "right": 270.0}
"""Yaw of the four views of paper §3."""


class Images(NamedTuple):
    """Hits as images.

    depth : (H, W) float32, distance along the ray, FIGURE units; infinite where nothing is hit
    part_index : (H, W) int32, index into `Body.parts`; -1 where nothing is hit
    normals : (H, W, 3) float32, FIGURE; zeros where nothing is hit
    """

    depth: FloatArray
    part_index: IntArray
    normals: FloatArray


def axes(yaw_deg: float, pitch_deg: float = 0.0) -> NDArray[np.float64]:
    """(3, 3) camera axes in FIGURE as rows: right, up, and back (from the scene to the camera)."""
    yaw, pitch = np.deg2rad(float(yaw_deg)), np.deg2rad(float(pitch_deg))
    sin, cos = _exact(np.sin(yaw)), _exact(np.cos(yaw))
    rise, run = _exact(np.sin(pitch)), _exact(np.cos(pitch))
    right, back = np.array([cos, 0.0, -sin]), np.array([sin * run, rise, cos * run])
    return np.stack([right, np.cross(back, right), back]) + 0.0  # no negative zeros


def framing(
    bounds: Any, size: tuple[int, int], yaw_deg: float = 0.0, pitch_deg: float = 0.0, *, margin: float = 0.05
) -> tuple[FloatArray, float]:
    """Centre (3,) and height of the picture that shows all of `bounds` (2, 3), FIGURE, with a margin on each side.

    size : (width, height) in pixels; margin : share of the picture
    """
    box = np.asarray(bounds, np.float64)
    half = np.abs(axes(yaw_deg, pitch_deg)) @ ((box[1] - box[0]) / 2)
    width, height = size
    extent = 2 * max(half[1], half[0] * height / width)
    return box.mean(axis=0).astype(np.float32), float(extent / (1 - 2 * margin))


def orthographic(
    yaw_deg: float,
    pitch_deg: float = 0.0,
    *,
    size: tuple[int, int],
    height: float,
    centre: Any = (0.0, 0.0, 0.0),
    distance: float = 10.0,
    rows: tuple[int, int] | None = None,
) -> Rays:
    """Parallel rays, row by row.

    size : (width, height) in pixels; pixels are square
    height : what the picture shows from top to bottom, FIGURE units
    centre : (3,) FIGURE, shown in the middle of the picture
    distance : from `centre` back to the plane where rays start, and depths count from
    rows : first and behind-last row of the picture; None: all
    """
    right, up, back = axes(yaw_deg, pitch_deg)
    across, upward = _picture(size, height, rows)
    start = np.asarray(centre, np.float64) + distance * back
    origins = start + across[..., None] * right + upward[..., None] * up
    return Rays(_rows(origins), _rows(np.broadcast_to(-back, origins.shape)))


def perspective(
    yaw_deg: float,
    pitch_deg: float = 0.0,
    *,
    size: tuple[int, int],
    height: float,
    centre: Any = (0.0, 0.0, 0.0),
    distance: float = 5.0,
    rows: tuple[int, int] | None = None,
) -> Rays:
    """Rays from one point at `distance` from `centre`, row by row; arguments as for `orthographic`.

    `height` is what the picture shows in the plane through `centre`, so the vertical field of view is
    2 atan(height / (2 distance)), and the picture tends to the orthographic one as the distance grows.
    """
    right, up, back = axes(yaw_deg, pitch_deg)
    across, upward = _picture(size, height, rows)
    directions = across[..., None] * right + upward[..., None] * up - distance * back
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    eye = np.asarray(centre, np.float64) + distance * back
    return Rays(_rows(np.broadcast_to(eye, directions.shape)), _rows(directions))


def images(hits: Hits, size: tuple[int, int]) -> Images:
    """Hits of a camera's rays as images; size : (width, height) in pixels."""
    width, height = size
    if len(hits.depth) != width * height:
        raise ValueError(f"hits: {len(hits.depth)} rays, expected {width} x {height} = {width * height}")
    return Images(
        hits.depth.reshape(height, width),
        hits.part_index.reshape(height, width),
        hits.normals.reshape(height, width, 3),
    )


def _picture(
    size: tuple[int, int], height: float, band: tuple[int, int] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(H, W) offsets of the pixel centres from the middle of the picture, to the right and upwards."""
    columns, rows = size
    if columns < 1 or rows < 1 or not height > 0:
        raise ValueError(f"camera: size {size} and height {height}, expected positive numbers")
    pixel = height / rows
    across = (np.arange(columns) + 0.5 - columns / 2) * pixel
    upward = (rows / 2 - np.arange(*(band or (0, rows))) - 0.5) * pixel
    shape = (len(upward), columns)
    return np.broadcast_to(across, shape), np.broadcast_to(upward[:, None], shape)


def _rows(array: NDArray[Any]) -> FloatArray:
    return np.ascontiguousarray(array, np.float32).reshape(-1, 3)


def _exact(value: float) -> float:
    """Sine and cosine of quarter turns, freed of rounding: rays of the four views run along the axes."""
    return float(np.round(value)) if abs(value - np.round(value)) < 1e-15 else float(value)
