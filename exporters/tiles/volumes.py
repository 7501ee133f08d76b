"""Transforms and bounding volumes of 3D Tiles: validation, and distances of points outside them.

https://docs.ogc.org/cs/22-025r4/22-025r4.html#core-bounding-volumes
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from georef.geodesy import WGS84_A_M, ecef_from_geodetic, geodetic_from_ecef

RIGID_TOLERANCE = 1e-9
"""Largest deviation of a rotation from an orthonormal matrix; float64 rounding leaves some 1e-16."""

Matrix = NDArray[np.float64]
Points = NDArray[np.float64]


@dataclass(frozen=True)
class Volume:
    """A bounding volume.

    volume : as in a tileset, valid
    matrix : (4, 4), from its frame to the frame of the whole tileset, which is ECEF for regions
    where : its tile, for messages
    """

    volume: dict[str, Any]
    matrix: Matrix
    where: str

    def outside(self, points: Points, matrix: Matrix) -> float:
        """Return the largest distance, metres, of (N, 3) points outside, negative inside; matrix : of the points."""
        if "region" in self.volume:
            return _outside_region(self.volume["region"], points @ matrix[:3, :3].T + matrix[:3, 3])
        # Computed in the volume's own frame: ECEF coordinates would lose eight digits.
        inner = np.linalg.inv(self.matrix) @ matrix
        local = points @ inner[:3, :3].T + inner[:3, 3]
        distance = _outside_box if "box" in self.volume else _outside_sphere
        return distance(self.volume, local) * scale_of(self.matrix)

    def excess_of(self, inner: Volume) -> float:
        """Return the distance, metres, by which another volume reaches out of this one, negative if it does not."""
        if "sphere" in inner.volume and "region" not in self.volume:
            sphere = np.asarray(inner.volume["sphere"], dtype=np.float64)
            return self.outside(sphere[None, :3], inner.matrix) + float(sphere[3]) * scale_of(inner.matrix)
        if "region" in inner.volume:
            return self.outside(_region_points(inner.volume["region"]), np.eye(4))
        return self.outside(_surface_points(inner.volume), inner.matrix)


def scale_of(matrix: Matrix) -> float:
    """Return the largest scale factor of a matrix along an axis."""
    return float(np.linalg.norm(matrix[:3, :3], axis=0).max())


def read_transform(values: Any) -> tuple[Matrix, str, str]:
    """Read a tile's transform: the matrix, a problem that makes it unusable or "", and an unusual property or ""."""
    if values is None:
        return np.eye(4), "", ""
    if not is_number_list(values, 16):
        return np.eye(4), "the transform is not 16 finite numbers", ""
    matrix = np.asarray(values, dtype=np.float64).reshape(4, 4).T
    if matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        return matrix, "the transform is not affine; is it in row-major order?", ""
    rotation = matrix[:3, :3]
    if not abs(np.linalg.det(rotation)) > 0:
        return matrix, "the transform is singular", ""
    off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if off > RIGID_TOLERANCE or np.linalg.det(rotation) < 0:
        return matrix, "", f"the transform is not rigid: off by {off:.2g}"
    return matrix, "", ""


def is_number_list(values: Any, count: int) -> bool:
    """Whether values are a list of `count` finite numbers."""
    return (
        isinstance(values, list)
        and len(values) == count
        and all(isinstance(each, int | float) and not isinstance(each, bool) and math.isfinite(each) for each in values)
    )


def volume_problem(volume: Any) -> str:
    """Return the problem of a bounding volume, "" if it is valid."""
    if not isinstance(volume, dict):
        return "no bounding volume"
    if "box" in volume:
        if not is_number_list(volume["box"], 12):
            return "box is not 12 finite numbers"
        axes = np.array(volume["box"][3:], np.float64).reshape(3, 3)
        return "" if abs(np.linalg.det(axes)) > 0 else "box is flat"
    if "sphere" in volume:
        return "" if is_number_list(volume["sphere"], 4) and volume["sphere"][3] > 0 else "sphere is not 4 numbers"
    if "region" in volume:
        region = volume["region"]
        if not is_number_list(region, 6):
            return "region is not 6 finite numbers"
        west, south, east, north, low, high = region
        angles = max(abs(west), abs(east)) <= math.pi and max(abs(south), abs(north)) <= math.pi / 2
        ordered = south <= north and low <= high
        return "" if angles and ordered else "region is not in radians, or not west, south, east, north, low, high"
    return "bounding volume is neither box nor sphere nor region"


def _outside_box(volume: dict[str, Any], points: Points) -> float:
    box = np.asarray(volume["box"], dtype=np.float64)
    axes = box[3:].reshape(3, 3)
    length = np.linalg.norm(axes, axis=1)
    along = (points - box[:3]) @ np.linalg.inv(axes)
    return float(((np.abs(along) - 1) * length).max())


def _outside_sphere(volume: dict[str, Any], points: Points) -> float:
    sphere = np.asarray(volume["sphere"], dtype=np.float64)
    return float((np.linalg.norm(points - sphere[:3], axis=1) - sphere[3]).max())


def _outside_region(region: list[float], points: Points) -> float:
    west, south, east, north, low, high = region
    lon, lat, height = geodetic_from_ecef(points).T
    lon, lat = np.radians(lon), np.radians(lat)
    # Regions may cross the antimeridian, with west greater than east.
    past = np.mod(lon - west, 2 * math.pi)
    width = np.mod(east - west, 2 * math.pi) if east - west < 2 * math.pi else 2 * math.pi
    sideways = np.where(past <= width, 0.0, np.minimum(past - width, 2 * math.pi - past)) * np.cos(lat)
    return float(
        max(
            sideways.max() * WGS84_A_M,
            (south - lat).max() * WGS84_A_M,
            (lat - north).max() * WGS84_A_M,
            (low - height).max(),
            (height - high).max(),
        )
    )


def _surface_points(volume: dict[str, Any]) -> Points:
    """Return the corners of a box, or points on a sphere, including those along the axes."""
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    if "box" in volume:
        box = np.asarray(volume["box"], dtype=np.float64)
        return np.asarray(box[:3] + signs @ box[3:].reshape(3, 3))
    sphere = np.asarray(volume["sphere"], dtype=np.float64)
    directions = np.concatenate([np.eye(3), -np.eye(3), signs / math.sqrt(3)])
    return np.asarray(sphere[:3] + sphere[3] * directions)


def _region_points(region: list[float]) -> Points:
    """Return 9 x 9 x 2 points of a region, ECEF: between them the earth bulges by less than 1/500 of its size."""
    west, south, east, north, low, high = region
    width = east - west if east >= west else east - west + 2 * math.pi
    lon = np.mod(np.degrees(west + width * np.linspace(0, 1, 9)) + 180.0, 360.0) - 180.0
    lat = np.degrees(np.linspace(south, north, 9))
    grid = np.stack(np.meshgrid(lon, lat, [low, high], indexing="ij"), axis=-1).reshape(-1, 3)
    return ecef_from_geodetic(grid)
