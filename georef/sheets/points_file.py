"""Control points of QGIS's georeferencer: .points files.

A table with a header line: mapX, mapY, then pixelX, pixelY (before QGIS 3.26) or sourceX, sourceY (since), enable,
and residuals, which are not read. Before it, since QGIS 3.14 or so, a line `#CRS: ` with the reference system of the
map coordinates as WKT or a code. Pixels count from the outer corner of the first pixel, as IMAGE does, but y upwards,
so that it is negative on the sheet.
https://docs.qgis.org/latest/en/docs/user_manual/working_with_raster/georeferencer.html
"""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np

from georef.errors import PlacementError
from georef.sheets.controls import MAX_POINTS, Controls, FloatArray, make_controls, read_text

X_NAMES, Y_NAMES = ("sourcex", "pixelx"), ("sourcey", "pixely")

ENABLE_NAMES = ("enable", "enabled")

DISABLED = ("0", "0.0", "false", "f", "no", "n", "")

CRS_WKT = r"(?i)(PROJ|GEOG|GEOD|COMPD|COMPOUND|BOUND)\w*\s*[\[(]"
WKT = rf"{CRS_WKT}|(?i:[A-Z]+ ?[ZM]* ?[\[(])"
"""Beginnings of a reference system, and of this or a geometry, as some versions add to each row."""


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
    header = [re.sub(r"[^a-z0-9]", "", name.lower()) for name in _values(table[0][1], separator)]
    columns = [header.index(name) if name in header else -1 for name in ("mapx", "mapy")]
    columns += [next((header.index(name) for name in names if name in header), -1) for names in (X_NAMES, Y_NAMES)]
    if min(columns) < 0:
        finding = f"unexpected header {table[0][1].strip()[:60]!r}"
        raise PlacementError(path, finding, "give columns mapX, mapY, sourceX, sourceY as QGIS writes them")
    if len(table) - 1 > MAX_POINTS:
        raise PlacementError(path, f"{len(table) - 1} control points", f"give at most {MAX_POINTS}")
    enable = next((header.index(name) for name in ENABLE_NAMES if name in header), None)
    rows, disabled = [], 0
    for number, line in table[1:]:
        try:
            words = [word.strip() for word in next(csv.reader([line], delimiter=separator))]
        except csv.Error as error:
            raise PlacementError(path, f"line {number}: {error}", "give four numbers") from None
        words = words if len(words) <= len(header) else _values(line, separator)
        extra = [word for word in words[len(header) :] if word]
        if extra and not all(re.match(WKT, word) for word in extra):
            finding = f"line {number} has {len(words)} values for {len(header)} columns"
            raise PlacementError(path, finding, "write numbers with a decimal point")
        try:
            values = [_number(words[column]) for column in columns]
        except (IndexError, ValueError):
            raise PlacementError(
                path, f"line {number} is {line.strip()[:60]!r}, not four numbers", "give four numbers"
            ) from None
        if enable is not None and enable < len(words) and words[enable].lower() in DISABLED:
            disabled += 1
            continue
        rows.append(values)
        crs = crs or next((word for word in words if re.match(CRS_WKT, word)), None)
    found = np.array(rows, np.float64).reshape(-1, 4)
    _check_sources(found, path)
    upwards = not ((found[:, 3] >= 0).all() and (found[:, 3] > 0).any())
    found[:, 3] *= -1.0 if upwards else 1.0
    return make_controls(path, found[:, [2, 3, 0, 1]], crs=crs, disabled=disabled)


def _values(line: str, separator: str) -> list[str]:
    """Values of a line, stripped; separators inside of quotes or of the brackets of WKT separate nothing."""
    values, depth, quote = [""], 0, False
    for character in line:
        if character == separator and not quote and not depth:
            values.append("")
            continue
        # WKT has quotes of its own inside of its brackets.
        if character == '"' and not depth:
            quote = not quote
            continue
        if not quote or depth:
            depth += (character in "([") - (character in ")]")
        values[-1] += character
    return [value.strip() for value in values]


def _number(text: str) -> float:
    """Number with a decimal point or comma, and with spaces or apostrophes between thousands."""
    text = re.sub(r"(?<=\d)[\s'’_](?=\d)", "", text)
    if "," in text and "." in text:
        text = text.replace("," if text.rfind(".") > text.rfind(",") else ".", "")
    return float(text.replace(",", "."))


def _check_sources(rows: FloatArray, path: Path) -> None:
    """Raise PlacementError for source coordinates that are those of the map: not pixels, but a first georeference."""
    if len(rows) < 2:
        return
    on_map, source = rows[:, :2], rows[:, 2:]
    extent = np.ptp(on_map, axis=0).max()
    if not np.isfinite(rows).all() or extent == 0:
        return
    near = np.abs(on_map - source).max() <= 0.3 * extent and 0.5 <= np.ptp(source, axis=0).max() / extent <= 2
    # A sheet of one unit a pixel near the origin is not distinguishable, and its points are right.
    if near and not np.array_equal(np.abs(on_map), np.abs(source)):
        finding = "sourceX and sourceY are map coordinates, not pixels"
        remedy = "QGIS writes them for a picture that was georeferenced already; give pixels of the picture"
        raise PlacementError(path, finding, remedy)
