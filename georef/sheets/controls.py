"""What the files of a sheet say of its place: control points, or the map itself."""

from __future__ import annotations

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
"""More control points than anybody has set by hand; what has more is no list of control points."""

MAX_BYTES = 8 << 20
"""Largest text file that is read: 10,000 lines with all that programs write into them."""


@dataclass(frozen=True)
class Controls:
    """Points whose place is known both on the picture and on the map.

    pixels : (N, 2) float64, IMAGE
    coordinates : (N, 2) float64, of `crs`, first coordinate the easterly one
    crs : reference system of the coordinates, as any text that pyproj understands; None: the file does not say
    method : transformation that the file asks for; None: it does not say
    plane : reference system in which the file wants the transformation fitted; None: it does not say
    size : width and height of the picture that the pixels were counted on; None: the file does not say
    left_out : control points that the file has switched off
    """

    pixels: FloatArray
    coordinates: FloatArray
    crs: str | None = None
    method: str | None = None
    plane: str | None = None
    size: tuple[float, float] | None = None
    left_out: int = 0


@dataclass(frozen=True)
class Affine:
    """A map given outright.

    matrix : (2, 3) float64; coordinates are matrix @ (x, y, 1) of IMAGE
    crs : as in `Controls`
    """

    matrix: FloatArray
    crs: str | None = None


def make_controls(source: Path, rows: Any, **more: Any) -> Controls:
    """Control points from (N, 4) numbers: pixel x, y (IMAGE) and coordinates; identical rows count once.

    Raises PlacementError for numbers that are not finite, too many points or none.
    """
    table = np.asarray(rows, np.float64).reshape(-1, 4)
    if len(table) > MAX_POINTS:
        raise PlacementError(source, f"{len(table)} control points", f"give at most {MAX_POINTS}")
    if not len(table):
        raise PlacementError(source, "no control points", "give a file with at least two that are switched on")
    bad = ~np.isfinite(table).all(axis=1) | (np.abs(table) > 1e12).any(axis=1)
    if bad.any():
        finding = f"control point {int(np.argmax(bad)) + 1} is {table[bad][0].tolist()}"
        raise PlacementError(source, finding, "give finite numbers")
    table = np.array(list(dict.fromkeys(map(tuple, table.tolist()))))
    return Controls(table[:, :2].copy(), table[:, 2:].copy(), **more)


def on_picture(controls: Controls, size: tuple[int, int], source: Path) -> Controls:
    """The control points on the picture at hand, which may be a smaller version of the one they were set on.

    Raises PlacementError where the picture has other proportions, or most of the points lie nowhere near it.
    """
    if controls.size is not None and controls.size != size:
        # A derivative's sides are rounded to whole pixels, so they may differ from its proportions by one.
        factor = np.array(size) / np.array(controls.size)
        if abs(factor[0] / factor[1] - 1) > 1.0 / min(size) + 1.0 / min(controls.size):
            finding = f"made for a picture of {_text(controls.size)} px, but the sheet has {_text(size)}"
            raise PlacementError(source, finding, "give the picture it was made for, whole, at any resolution")
        controls = replace(controls, pixels=controls.pixels * factor, size=(float(size[0]), float(size[1])))
    away = (controls.pixels < -np.array(size)) | (controls.pixels > 2 * np.array(size))
    if away.any(axis=1).mean() > 0.5:
        finding = f"most control points lie nowhere near the sheet's {_text(size)} px"
        raise PlacementError(source, finding, "give points counted in pixels of this picture")
    return controls


def _text(size: tuple[float, float]) -> str:
    return f"{size[0]:g}×{size[1]:g}"


def read_text(path: Path) -> str:
    """The text of a small file in UTF-8 or UTF-16 with a byte order mark, in UTF-8, or else in Latin-1.

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
        raise PlacementError(path, "it is empty", "give a file that is not")
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = content.decode("utf-16", errors="replace")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
    if "\0" in text:
        raise PlacementError(path, "it is no text", "give a text file")
    return text
