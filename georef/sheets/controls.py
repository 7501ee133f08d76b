"""Georeferences of sheets: control points, or an affine map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from georef.errors import PlacementError
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import read_bytes

FloatArray = NDArray[np.float64]

MAX_POINTS = 10_000
"""Limit of control points: more than anybody sets by hand, so a longer file is not a list of control points."""

MAX_BYTES = 8 << 20
"""Largest text file that is read: 10,000 lines with everything that programs write into them."""


@dataclass(frozen=True)
class Controls:
    """Control points: points with known coordinates both on the picture and on the map.

    pixels : (N, 2) float64, IMAGE
    coordinates : (N, 2) float64, of `crs`, first coordinate the easterly one
    crs : reference system of the coordinates, as any text that pyproj understands; None: not given
    method : transformation that the file requests; None: not given
    plane : reference system in which the transformation is to be fitted; None: not given
    size : width and height of the picture on which the points were set; None: not given
    disabled : number of control points disabled in the file
    """

    pixels: FloatArray
    coordinates: FloatArray
    crs: str | None = None
    method: str | None = None
    plane: str | None = None
    size: tuple[float, float] | None = None
    disabled: int = 0


@dataclass(frozen=True)
class Affine:
    """Affine map from pixels to coordinates.

    matrix : (2, 3) float64; coordinates are matrix @ (x, y, 1) of IMAGE
    crs : as in `Controls`
    """

    matrix: FloatArray
    crs: str | None = None


def make_controls(source: Path, rows: Any, **more: Any) -> Controls:
    """Control points from (N, 4) numbers: pixel x, y (IMAGE) and coordinates; duplicate rows are removed.

    Raises PlacementError for numbers that are not finite, too many points or none.
    """
    table = np.asarray(rows, np.float64).reshape(-1, 4)
    if len(table) > MAX_POINTS:
        raise PlacementError(source, f"{len(table)} control points", f"give at most {MAX_POINTS}")
    if not len(table):
        raise PlacementError(source, "no control points", "give a file with at least two enabled control points")
    bad = ~np.isfinite(table).all(axis=1) | (np.abs(table) > 1e12).any(axis=1)
    if bad.any():
        finding = f"control point {int(np.argmax(bad)) + 1} is {table[bad][0].tolist()}"
        raise PlacementError(source, finding, "give finite numbers")
    table = np.array(list(dict.fromkeys(map(tuple, table.tolist()))))
    return Controls(table[:, :2].copy(), table[:, 2:].copy(), **more)


def on_picture(controls: Controls, size: tuple[int, int], source: Path) -> Controls:
    """Scale control points to the given picture, which may be a smaller version of the one they were set on.

    Raises PlacementError where the picture has another aspect ratio, or most of the points lie far outside it.
    """
    if controls.size is not None and controls.size != size:
        # The sides of a scaled picture are rounded to whole pixels, so its aspect ratio may be off by one pixel.
        factor = np.array(size) / np.array(controls.size)
        if abs(factor[0] / factor[1] - 1) > 1.0 / min(size) + 1.0 / min(controls.size):
            finding = f"made for a picture of {size_text(controls.size)} px, but the sheet has {size_text(size)} px"
            raise PlacementError(source, finding, "give the whole picture it was made for, at any resolution")
        controls = replace(controls, pixels=controls.pixels * factor, size=(float(size[0]), float(size[1])))
    away = (controls.pixels < -np.array(size)) | (controls.pixels > 2 * np.array(size))
    if away.any(axis=1).mean() > 0.5:
        finding = f"most control points lie far outside the sheet of {size_text(size)} px"
        finding += seeming_size(controls.pixels, np.array(size, np.float64))
        raise PlacementError(source, finding, "give points in pixels of this picture")
    return controls


def seeming_size(pixels: FloatArray, sides: FloatArray) -> str:
    """Remark about the picture that points seem to be made for: the sheet times the least whole number that holds them.

    pixels : (N, 2); sides : (2,) of the sheet, px
    """
    factor = float(np.ceil((pixels / sides).max() - 0.02))
    if (pixels < -0.5 * sides).any() or not 2 <= factor <= 20:
        return ""
    return f", as if made for a picture of about {size_text(sides * factor)} px"


def size_text(size: Sequence[float] | FloatArray) -> str:
    """Width and height for messages."""
    return f"{size[0]:g}×{size[1]:g}"


def read_text(path: Path) -> str:
    """Read a small text file: UTF-8 or UTF-16 with a byte order mark, plain UTF-8, or else Latin-1.

    Raises PlacementError for files that are missing, empty, too large or binary.
    """
    try:
        content = read_bytes(path, MAX_BYTES)
    except FileNotFoundError:
        raise PlacementError(path, "no such file", "check the path") from None
    except DamagedFile as error:
        raise PlacementError(path, str(error), f"give a list of at most {MAX_POINTS} control points") from None
    except OSError as error:
        raise PlacementError(path, error.strerror or "cannot be read", "check the path") from None
    if not content.strip():
        raise PlacementError(path, "the file is empty", "give a georeference file")
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = content.decode("utf-16", errors="replace")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
    if "\0" in text:
        raise PlacementError(path, "not a text file", "give a text file")
    return text
