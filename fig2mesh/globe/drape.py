"""A georeferenced map sheet as a picture in degrees, to be draped over the globe."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fig2mesh.errors import InputError
from fig2mesh.globe.page import Overlay
from fig2mesh.parse.picture import read_rgba
from fig2mesh.parse.window import MAX_PIXELS
from fig2mesh.records import ByteArray
from georef.mapsheet import MapSheet, read_sheet

FloatArray = NDArray[np.float64]

MAX_PX = 3072
"""Longer side of a draped sheet; browsers reach 4096 without exception, but memory grows with the square."""

KNOTS = 129
"""Points along each side at which the map between pixels and degrees is computed; linear in between."""

MARGIN = 0.06
"""Part of the sheet by which these points reach beyond its edges, so that cells at the edges have all corners."""


def drape(path: Path, map_crs: str | None, folder: Path, name: str) -> Overlay:
    """Warp a sheet to longitude and latitude.

    path : of its picture or of its georeference, as for `read_sheet`; map_crs : as there
    folder, name : of the PNG file that is written

    Raises InputError or PlacementError for sheets that have no picture or no georeference, or that reach round a pole
    or across the antimeridian.
    """
    sheet = read_sheet(path, map_crs=map_crs)
    if sheet.picture is None or not sheet.picture.is_file():
        raise InputError(f"--map {path}", "the picture of the sheet is not here", "give the picture itself")
    if sheet.size is not None and (pixels := sheet.size[0] * sheet.size[1]) > MAX_PIXELS:
        finding = f"{pixels / 1e6:.0f} Mpx, more than {MAX_PIXELS / 1e6:.0f} Mpx"
        raise InputError(f"--map {path}", finding, "give a smaller version with a georeference of its own")
    rgba = read_rgba(sheet.picture)
    rectangle = edges(sheet, rgba.shape[1], rgba.shape[0], path)
    file = folder / f"{name}.png"
    Image.fromarray(warped(sheet, rgba, rectangle)).save(file, compress_level=1)
    return Overlay(file, *rectangle)


def edges(sheet: MapSheet, width: int, height: int, path: Path) -> tuple[float, float, float, float]:
    """West, south, east and north of a sheet of a number of pixels, degrees."""
    along = np.linspace(0.0, 1.0, KNOTS)
    zero, one = np.zeros(KNOTS), np.ones(KNOTS)
    rim = [np.stack(pair, axis=1) for pair in ((along, zero), (one, along), (1 - along, one), (zero, 1 - along))]
    lon, lat = sheet.lonlat(np.concatenate(rim) * [width, height]).T
    steps = np.abs(np.diff(lon, append=lon[0]))
    if not np.isfinite(lon).all() or steps.max() > 180:
        finding = "the sheet reaches round a pole or across the antimeridian"
        raise InputError(f"--map {path}", finding, "cut the sheet there, or leave out --map")
    return float(lon.min()), float(lat.min()), float(lon.max()), float(lat.max())


def warped(sheet: MapSheet, rgba: ByteArray, rectangle: tuple[float, float, float, float]) -> ByteArray:
    """(H, W, 4) sheet with straight alpha, north up, its rows and columns evenly spaced in degrees.

    rectangle : west, south, east, north, degrees
    """
    from scipy.ndimage import map_coordinates

    height, width = rgba.shape[:2]
    columns, rows = _size(rectangle, max(width, height))
    knots = _pixels_of_degrees(sheet, width, height, rectangle)
    row = np.linspace(0.5 / rows, 1 - 0.5 / rows, rows)[:, None] * (KNOTS - 1)
    column = np.linspace(0.5 / columns, 1 - 0.5 / columns, columns)[None] * (KNOTS - 1)
    at = np.stack(np.broadcast_arrays(row, column))
    x, y = (map_coordinates(knots[..., axis], at, order=1, mode="nearest") for axis in (0, 1))
    inside = (x >= 0) & (x <= width) & (y >= 0) & (y <= height)
    # Centres of pixels are at 0.5.
    found = [
        map_coordinates(rgba[..., channel], [y - 0.5, x - 0.5], order=1, mode="nearest", output=np.uint8)
        for channel in range(4)
    ]
    return np.stack([*found[:3], np.where(inside, found[3], 0).astype(np.uint8)], axis=2)


def _size(rectangle: tuple[float, float, float, float], longest: int) -> tuple[int, int]:
    """Columns and rows of a picture of a rectangle whose pixels are about square on the ground."""
    west, south, east, north = rectangle
    across = (east - west) * max(np.cos(np.radians((south + north) / 2)), 0.05)
    scale = min(longest, MAX_PX) / max(across, north - south)
    return max(2, round(across * scale)), max(2, round((north - south) * scale))


def _pixels_of_degrees(
    sheet: MapSheet, width: int, height: int, rectangle: tuple[float, float, float, float]
) -> FloatArray:
    """(KNOTS, KNOTS, 2) pixels of the sheet on an even grid of degrees, north first; NaN off the sheet.

    No transformation of a sheet has an inverse in general: a grid of its pixels is mapped, and interpolated.
    """
    from scipy.interpolate import LinearNDInterpolator

    west, south, east, north = rectangle
    side = np.linspace(-MARGIN, 1 + MARGIN, KNOTS)
    pixels = np.stack(np.meshgrid(side * width, side * height), axis=2).reshape(-1, 2)
    lonlat = sheet.lonlat(pixels)
    finite = np.isfinite(lonlat).all(axis=1)
    unit = (lonlat[finite] - [west, south]) / [east - west, north - south]
    of_unit = LinearNDInterpolator(unit, pixels[finite])
    u, v = np.meshgrid(np.linspace(0, 1, KNOTS), np.linspace(1, 0, KNOTS))
    return np.asarray(of_unit(u, v))
