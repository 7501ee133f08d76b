"""World files: an affine map of pixel centres in six lines.

https://gdal.org/en/stable/drivers/raster/wld.html
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from georef.errors import PlacementError
from georef.sheets.controls import Affine, read_text


def read_world_file(path: Path) -> Affine:
    """Read the affine map of a world file, shifted from pixel centres to IMAGE.

    Lines are A, D, B, E, C, F of x = A column + B row + C, y = D column + E row + F, where column 0, row 0 is the
    centre of the first pixel, in IMAGE (0.5, 0.5). Numbers may have decimal commas.
    Raises PlacementError for anything but six finite numbers of an invertible map.
    """
    words = read_text(path).split()
    try:
        numbers = [float(word.replace(",", ".")) for word in words]
    except ValueError as error:
        word = str(error).split(":")[-1].strip()[:40]
        raise PlacementError(path, f"{word} is not a number", "give a world file: six numbers, one per line") from None
    if len(numbers) != 6 or not all(math.isfinite(number) for number in numbers):
        finding = f"{len(numbers)} numbers" if len(numbers) != 6 else "a number that is not finite"
        raise PlacementError(path, finding, "give a world file of six finite numbers, one per line")
    a, d, b, e, c, f = numbers
    if abs(a * e - b * d) <= 1e-12 * (abs(a) + abs(b)) * (abs(d) + abs(e)):
        raise PlacementError(path, "its map is singular", "give a world file that spans the sheet")
    return Affine(np.array([[a, b, c - (a + b) / 2], [d, e, f - (d + e) / 2]]))


def read_prj(path: Path) -> str:
    """Read the reference system in a .prj file, as text."""
    return read_text(path).strip()
