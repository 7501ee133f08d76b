"""Pictures of sheets, read without decoding: size, and the GeoTIFF tags of a TIFF.

https://docs.ogc.org/is/19-008r4/19-008r4.html
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from georef.errors import PlacementError
from georef.sheets.controls import MAX_POINTS, Affine, Controls, make_controls
from georef.untrusted.damage import DamagedFile, decoding
from georef.untrusted.image_file import NotAPicture
from georef.untrusted.picture_header import read_header

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".avif", ".jp2", ".gif", ".bmp")

PIXEL_SCALE, TIEPOINTS, TRANSFORMATION = 33550, 33922, 34264
GEO_KEYS, GEO_DOUBLES, GEO_ASCII = 34735, 34736, 34737
MODEL_TYPE, RASTER_TYPE, GEODETIC_CRS, PROJECTED_CRS = 1024, 1025, 2048, 3072
CITATIONS = (3073, 2049, 1026)
POINT, GEOGRAPHIC, USER_DEFINED = 2, 2, 32767
ESRI = "ESRI PE String ="


@dataclass(frozen=True)
class SheetPicture:
    """Header of a sheet's picture.

    size : width and height, px; georeference : from its tags, None without them
    crs : as in `Controls`, also where the tags give only the reference system
    original : width and height that EXIF states, px; None without
    notes : remarks about the file, one line each
    """

    size: tuple[int, int]
    georeference: Affine | Controls | None = None
    crs: str | None = None
    original: tuple[int, int] | None = None
    notes: tuple[str, ...] = ()


def read_picture(path: Path) -> SheetPicture:
    """Read size and tags of a picture of any size without decoding it.

    Raises PlacementError for files that are not pictures, have broken tags, or are rotated by their orientation,
    since georeferences refer to pixels as stored.
    """
    try:
        header = read_header(path)
    except NotAPicture:
        raise PlacementError(path, "not a readable picture", "give a PNG, JPEG, TIFF or WebP as the sheet") from None
    except FileNotFoundError:
        raise PlacementError(path, "no such file", "check the path of the sheet") from None
    except (DamagedFile, OSError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise PlacementError(path, f"cannot be read ({reason})", "give an intact picture") from None
    if header.orientation != 1:
        raise PlacementError(
            path, "rotated by its EXIF orientation", "save it upright; georeferences refer to stored pixels"
        )
    size, tags = header.size, header.tags
    if not any(tag in tags for tag in (PIXEL_SCALE, TIEPOINTS, TRANSFORMATION, GEO_KEYS)):
        return SheetPicture(size, None, None, header.original, header.notes)
    try:
        found = _georeferenced(path, size, tags)
    except DamagedFile:
        raise PlacementError(path, "its GeoTIFF tags are damaged", "give an intact GeoTIFF, or a world file") from None
    return replace(found, original=header.original, notes=header.notes)


def _georeferenced(path: Path, size: tuple[int, int], tags: dict[int, Any]) -> SheetPicture:
    keys = _geo_keys(tags)
    crs = _crs(keys)
    # Where the raster type is "point", raster coordinates count from the centre of the first pixel.
    shift = 0.5 if keys.get(RASTER_TYPE) == POINT else 0.0
    tiepoints = np.array(_numbers(tags, TIEPOINTS, 6), np.float64).reshape(-1, 6)
    if len(tiepoints) > MAX_POINTS:
        raise PlacementError(path, f"{len(tiepoints)} control points", f"give at most {MAX_POINTS}")
    if TRANSFORMATION in tags:
        numbers = _numbers(tags, TRANSFORMATION, 16)
        if len(numbers) != 16:
            raise DamagedFile(f"a transformation of {len(numbers)} numbers")
        matrix = np.array(numbers, np.float64).reshape(4, 4)[:2][:, [0, 1, 3]]
    elif PIXEL_SCALE in tags and len(tiepoints) == 1:
        scales = _numbers(tags, PIXEL_SCALE)
        if len(scales) < 2:
            raise DamagedFile(f"a pixel scale of {len(scales)} numbers")
        scale_x, scale_y = scales[:2]
        column, row, _, x, y, _ = tiepoints[0]
        matrix = np.array([[scale_x, 0.0, x - scale_x * column], [0.0, -scale_y, y + scale_y * row]])
    elif len(tiepoints) > 1:
        rows = np.concatenate([tiepoints[:, :2] + shift, tiepoints[:, 3:5]], axis=1)
        return SheetPicture(size, make_controls(path, rows, crs=crs), crs)
    else:
        return SheetPicture(size, None, crs)
    if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix[:, :2])) <= 1e-300:
        raise PlacementError(path, "the map in its tags is singular", "give an intact GeoTIFF, or a world file")
    matrix[:, 2] -= matrix[:, :2] @ (shift, shift)
    return SheetPicture(size, Affine(matrix, crs), crs)


def _numbers(tags: dict[int, Any], tag: int, group: int = 1) -> list[float]:
    """Numbers of a tag, none if it is missing. Raises DamagedFile for anything but complete groups of numbers."""
    values = tags.get(tag, ())
    if not isinstance(values, tuple) or not all(isinstance(value, Real) for value in values) or len(values) % group:
        raise DamagedFile(f"tag {tag} does not consist of numbers")
    return [float(value) for value in values]


def _geo_keys(tags: dict[int, Any]) -> dict[int, Any]:
    with decoding("bad key directory", ValueError, OverflowError):  # not a number, or infinite
        directory = [int(value) for value in _numbers(tags, GEO_KEYS)]
    keys: dict[int, Any] = {}
    for start in range(4, min(len(directory), 4 + 4 * (directory[3] if len(directory) > 3 else 0)), 4):
        if start + 4 > len(directory):
            raise DamagedFile("truncated key directory")
        key, location, count, value = directory[start : start + 4]
        if location == 0:
            keys[key] = value
        elif location == GEO_ASCII:
            keys[key] = str(tags.get(GEO_ASCII, ""))[value : value + count].rstrip("|\0 ")
    return keys


def _crs(keys: dict[int, Any]) -> str | None:
    """Reference system named in the keys by code, or as Esri's WKT in a citation."""
    for key in (PROJECTED_CRS, *((GEODETIC_CRS,) if keys.get(MODEL_TYPE) == GEOGRAPHIC else ())):
        if keys.get(key) not in (None, 0, USER_DEFINED):
            return f"EPSG:{keys[key]}"
    for key in CITATIONS:
        text = keys.get(key)
        if isinstance(text, str) and ESRI in text:
            return text.split(ESRI, 1)[1].strip()
    return None
