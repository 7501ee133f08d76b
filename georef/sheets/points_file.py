"""Control points of QGIS's georeferencer: .points files.

A table with a header line: mapX, mapY, then pixelX, pixelY (before QGIS 3.26) or sourceX, sourceY (since), enable,
and residuals, which are not read. Before it, since QGIS 3.14 or so, a line `#CRS: ` with the reference system of the
map coordinates as WKT or a code. Pixels count from the outer corner of the first pixel, as IMAGE does, but y upwards,
so that it is negative on the sheet.
https://docs.qgis.org/latest/en/docs/user_manual/working_with_raster/georeferencer.html
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from georef.errors import PlacementError
from georef.sheets.controls import MAX_POINTS, Controls, make_controls, read_text

X_NAMES, Y_NAMES = ("sourcex", "pixelx"), ("sourcey", "pixely")

DISABLED = ("0", "false", "no", "")


def read_points_file(path: Path) -> Controls:
    """Read the control points of a .points file, without the disabled ones.

    If no point has a negative y and some have a positive one, the file is not from QGIS and its y runs downwards.
    Raises PlacementError for other files, naming the line.
    """
    crs, table = None, []
    lines = read_text(path).splitlines()
    for number, line in enumerate(lines, start=1):
        if line.startswith("#"):
            key, _, value = line[1:].partition(":")
            if key.strip().upper() == "CRS" and value.strip():
                crs = value.strip()
        elif line.strip():
            table.append((number, line))
    if not table:
        raise PlacementError(path, "no header line", "give a .points file as QGIS writes it")
    separator = max(",;\t", key=table[0][1].count)
    header = [name.strip().strip('"').lower() for name in table[0][1].split(separator)]
    columns = [header.index(name) if name in header else -1 for name in ("mapx", "mapy")]
    columns += [next((header.index(name) for name in names if name in header), -1) for names in (X_NAMES, Y_NAMES)]
    if min(columns) < 0:
        finding = f"unexpected header {table[0][1].strip()[:60]!r}"
        raise PlacementError(path, finding, "give columns mapX, mapY, sourceX, sourceY as QGIS writes them")
    if len(table) - 1 > MAX_POINTS:
        raise PlacementError(path, f"{len(table) - 1} control points", f"give at most {MAX_POINTS}")
    enable = header.index("enable") if "enable" in header else None
    rows, disabled = [], 0
    for number, line in table[1:]:
        try:
            words = [word.strip() for word in next(csv.reader([line], delimiter=separator))]
        except csv.Error as error:
            raise PlacementError(path, f"line {number}: {error}", "give four numbers") from None
        if len(words) > len(header):
            finding = f"line {number} has {len(words)} values for {len(header)} columns"
            raise PlacementError(path, finding, "write numbers with a decimal point")
        try:
            values = [float(words[column]) for column in columns]
        except (IndexError, ValueError):
            raise PlacementError(
                path, f"line {number} is {line.strip()[:60]!r}, not four numbers", "give four numbers"
            ) from None
        if enable is not None and enable < len(words) and words[enable].lower() in DISABLED:
            disabled += 1
        else:
            rows.append(values)
    found = np.array(rows, np.float64).reshape(-1, 4)
    upwards = not ((found[:, 3] >= 0).all() and (found[:, 3] > 0).any())
    found[:, 3] *= -1.0 if upwards else 1.0
    return make_controls(path, found[:, [2, 3, 0, 1]], crs=crs, disabled=disabled)
