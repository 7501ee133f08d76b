"""Orthographic and perspective cameras (paper §4.3, §4.5), their rays, and images of ray hits.

Yaw turns the camera about the figure: 0 shows the front (camera at +z), 90 the figure's left side (camera at +x),
180 the back, 270 the right side. Pitch lifts it: 90 is straight down. Pixel centres lie at +0.5, row 0 on top.
"""

from __future__ import annotations

from dataclasses import dataclass
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


@dataclass(frozen=True)
class Camera:
    """Camera parameters; its rays are those of `orthographic` or `perspective`.

    size : (width, height) in pixels; pixels are square
    height : extent of the picture from top to bottom in the plane through `centre`, FIGURE units
    centre : (3,) FIGURE, shown in the middle of the picture
    distance : from `centre` back to the plane where rays start (orthographic), or to the eye (perspective)
    perspective : True if rays start at one point
    """

    yaw_deg: float
    pitch_deg: float = 0.0
    size: tuple[int, int] = (512, 512)
    height: float = 2.0
    centre: Any = (0.0, 0.0, 0.0)
    distance: float = 10.0
    perspective: bool = False

    def __post_init__(self) -> None:
        centre = tuple(float(c) for c in self.centre)
        object.__setattr__(self, "centre", centre)
        if min(self.size) < 1 or not self.height > 0:
            raise ValueError(f"camera: size {self.size} and height {self.height}, expected positive numbers")
        if len(centre) != 3 or not np.isfinite((*centre, self.distance)).all():
            raise ValueError(f"camera: centre {centre} and distance {self.distance}, expected finite numbers")
        if self.perspective and not self.distance > 0:
            raise ValueError(f"camera: distance {self.distance}, expected a positive one in perspective")

    @property
    def pixel(self) -> float:
        """Edge of a pixel in the plane through `centre`, FIGURE units."""
        return self.height / self.size[1]

    @property
    def axes(self) -> NDArray[np.float64]:
        """(3, 3) right, up and back, see `axes`."""
        return axes(self.yaw_deg, self.pitch_deg)

    @property
    def start(self) -> NDArray[np.float64]:
        """(3,) origin of depths: the eye, or the middle of the plane where rays start."""
        start: NDArray[np.float64] = np.asarray(self.centre, np.float64) + self.distance * self.axes[2]
        return start

    def rays(self, rows: tuple[int, int] | None = None) -> Rays:
        """Rays of all pixels or of the rows from the first to before the last, row by row."""
        make = perspective if self.perspective else orthographic
        return make(
            self.yaw_deg,
            self.pitch_deg,
            size=self.size,
            height=self.height,
            centre=self.centre,
            distance=self.distance,
            rows=rows,
        )

    def steps(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Origin and direction of rays, (3, 3) each: at pixel (0, 0), and what each column and each row adds.

        Directions have length 1 along the camera's axis.
        """
        right, up, back = self.axes
        width, height = self.size
        left, top = (0.5 - width / 2) * self.pixel, (height / 2 - 0.5) * self.pixel
        corner, per_column, per_row = left * right + top * up, self.pixel * right, -self.pixel * up
        nothing = np.zeros(3)
        if self.perspective:
            direction = np.stack([corner / self.distance - back, per_column / self.distance, per_row / self.distance])
            return np.stack([self.start, nothing, nothing]), direction
        return np.stack([self.start + corner, per_column, per_row]), np.stack([-back, nothing, nothing])

    def lines(self, pixels: NDArray[np.intp], first_row: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Origins and unit directions (N, 3) of the rays of pixels (N,), counted row by row from `first_row`."""
        rows, columns = np.divmod(pixels, self.size[0])
        rows += first_row
        origin, direction = self.steps()
        varying = direction if self.perspective else origin
        # Element by element, not as a product of matrices: a ray must not depend on the others in the batch.
        along = varying[0] + columns[:, None] * varying[1] + rows[:, None] * varying[2]
        if not self.perspective:
            return along, np.broadcast_to(direction[0], along.shape)
        directions = along / np.sqrt(np.einsum("nd,nd->n", along, along))[:, None]
        return np.broadcast_to(origin[0], along.shape), directions


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
    height : extent of the picture from top to bottom, FIGURE units
    centre : (3,) FIGURE, shown in the middle of the picture
    distance : from `centre` back to the plane where rays start, and depths are measured from
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

    `height` is the extent of the picture in the plane through `centre`, so the vertical field of view is
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
