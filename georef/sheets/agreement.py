"""Agreement of a georeference with the picture it is used for, and with the area of its reference system.

Control points name pixels of the picture that they were set on. On a smaller or larger version of it, or on another
picture, they still fit each other perfectly: only their place on the picture shows it.
"""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

import numpy as np

from georef.errors import PlacementError
from georef.sheets.controls import Affine, Controls, FloatArray, read_text, seeming_size, size_text
from georef.sheets.quality import distances_m
from georef.sheets.reference import Plane
from georef.untrusted.damage import DamagedFile
from georef.untrusted.picture_header import read_header

Size = tuple[float, float]

MARGIN_PX, MARGIN = 2.0, 0.01
"""Tolerance, pixels and share of the side: corners of a sheet are clicked a little outside of it."""

MIN_SPREAD = 0.02
"""Smallest extent of control points, share of both sides; nobody sets them all so close together."""

MAX_CORNER = 0.55
"""Share of both sides up to which points that cover only the upper left corner were set on a smaller version."""

MIN_RESIZED = 1.02
"""Ratio of sides above which a picture is not of the size that a file states."""

AREA_MARGIN, AREA_MARGIN_DEG = 0.25, 0.2
"""Tolerance of the area of a reference system, share of its extent and degrees: maps go beyond borders."""

AUXILIARY_TOLERANCE_PX = 0.6
"""Difference of the map in an `.aux.xml`, at the corners: conventions differ by half a pixel."""

MAX_STRETCH = 1.3
"""Ratio of the scales of a sheet along and across above which it is reported; paper shrinks by some per cent."""


def check_controls(controls: Controls, size: Size | None, source: Path) -> list[str]:
    """Remarks about control points on a picture of a size, one line each.

    Raises PlacementError where they are not pixels, or not of this picture.
    """
    pixels = controls.pixels
    spread = np.ptp(pixels, axis=0)
    units = "QGIS writes map units where the picture was georeferenced already; give pixels of the picture"
    if len(pixels) > 1 and spread.max() < 1:
        raise PlacementError(source, "all control points lie within one pixel", units)
    if size is None:
        return []
    sides = np.array(size, np.float64)
    if len(pixels) > 1 and (spread < MIN_SPREAD * sides).all() and len(np.unique(pixels, axis=0)) > 1:
        finding = f"all control points lie within {spread[0]:.3g}×{spread[1]:.3g} px of a sheet of {size_text(size)} px"
        raise PlacementError(source, finding, units)
    margin = np.maximum(MARGIN_PX, MARGIN * sides)
    outside = ((pixels < -margin) | (pixels > sides + margin)).any(axis=1)
    if outside.any():
        finding = f"{outside.sum()} of {len(pixels)} control points lie outside the sheet of {size_text(size)} px"
        finding += seeming_size(pixels, sides)
        if outside.mean() >= 0.5:
            raise PlacementError(source, finding, "give the picture they were set on, or points in pixels of this one")
        return [f"{source}: {finding}; check that the picture is the one they were set on"]
    if len(pixels) > 2 and (pixels.max(axis=0) < MAX_CORNER * sides).all():
        reach = size_text(tuple(np.ceil(pixels.max(axis=0)).tolist()))
        return [
            f"{source}: the control points cover only the upper left {reach} px of the sheet of {size_text(size)} px; "
            "check that they were not set on a smaller version of it"
        ]
    return []


def picture_notes(picture: Path | None, size: Size | None, original: Size | None, georeference: object) -> list[str]:
    """Remarks about what the picture and files beside it say about its size and place, one line each.

    size : of the picture, px; original : that its EXIF data state
    """
    if picture is None or size is None:
        return []
    notes = []
    if original is not None and not _same_size(original, size) and not _same_size(original[::-1], size):
        found = f"{picture}: its EXIF data are of a picture of {size_text(original)} px, it has {size_text(size)} px"
        notes.append(f"{found}; check that the georeference was made for this size")
    overviews = picture.with_name(picture.name + ".ovr")
    with suppress(DamagedFile, OSError):
        large = read_header(overviews).size
        if max(large[0] / size[0], large[1] / size[1]) > 0.75:
            found = f"{overviews}: {size_text(large)} px is no overview of a picture of {size_text(size)} px"
            notes.append(f"{found}; check that the georeference was made for this size")
    beside = picture.with_name(picture.name + ".aux.xml")
    if isinstance(georeference, Affine) and beside.is_file():
        other = _geo_transform(beside)
        if other is not None and not same_map(georeference.matrix, other, size, AUXILIARY_TOLERANCE_PX):
            notes.append(f"{beside}: its GeoTransform is another map than the one used")
    return notes


def _same_size(one: Size, other: Size) -> bool:
    ratios = np.array(one) / np.array(other)
    return bool((np.maximum(ratios, 1 / ratios) < MIN_RESIZED).all())


def _geo_transform(path: Path) -> FloatArray | None:
    """(2, 3) affine map of IMAGE in GDAL's auxiliary file; None without."""
    try:
        text = read_text(path)
    except PlacementError:
        return None
    found = re.search(r"<GeoTransform>([^<]{5,400})</GeoTransform>", text)
    numbers = re.findall(r"[-+.\deE]+", found[1]) if found is not None else []
    try:
        values = [float(number) for number in numbers]
    except ValueError:
        return None
    if len(values) != 6:
        return None
    c, a, b, f, d, e = values
    return np.array([[a, b, c], [d, e, f]])


def same_map(one: FloatArray, other: FloatArray, size: Size, tolerance_px: float) -> bool:
    """Whether two affine maps, (2, 3) of IMAGE, agree at the corners of a picture to a tolerance in pixels."""
    width, height = size
    corners = np.array([[0, 0, 1], [width, 0, 1], [0, height, 1], [width, height, 1]], np.float64)
    apart = corners @ (one - other).T
    return bool(np.abs(np.linalg.solve(one[:, :2], apart.T)).max() < tolerance_px)


def area_notes(file: Path, name: str, plane: Plane, lonlat: FloatArray) -> list[str]:
    """Remark about a sheet outside of the area of its reference system.

    lonlat : (1, 2) GEODETIC, its middle
    """
    if plane.area is None:
        return []
    west, south, east, north = plane.area
    width = (east - west) % 360 or 360.0
    half = np.array([width, north - south]) / 2
    centre = np.array([west + half[0], south + half[1]])
    away = lonlat[0] - centre
    away[0] = (away[0] + 180.0) % 360.0 - 180.0
    if (np.abs(away) <= half * (1 + 2 * AREA_MARGIN) + AREA_MARGIN_DEG).all():
        return []
    border = centre + np.clip(away, -half, half)
    distance = float(distances_m(border[None], lonlat)[0])
    return [
        f"{file}: the sheet is at {lonlat[0, 0]:.4f} {lonlat[0, 1]:.4f}, {distance / 1000:.3g} km outside the area of "
        f"{name}; check the reference system and the coordinates"
    ]
