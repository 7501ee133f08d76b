"""Table of the figures of a sheet, which `fig2mesh batch` converts, and the picture that shows which is which."""

from __future__ import annotations

import csv
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from PIL import Image, ImageDraw, ImageFont

from fig2mesh.parse.annotation import KEYPOINTS, MASK, PART_LABELS
from fig2mesh.records import ByteArray

if TYPE_CHECKING:
    from fig2mesh.parse.sheet import SheetFigure

Point = tuple[float, float]

TABLE, OVERVIEW = "figures.csv", "overview.jpg"

MAX_OVERVIEW_PX: Final = 2000
"""Longer side of the overview: enough to recognise every figure that is found, small enough to open at once."""

MAX_BESIDE_BYTES: Final = 8 << 20
"""Size of files beside a sheet that may hold its georeference."""

BOX, LABEL = (220, 20, 60), (255, 255, 255)


def write_table(
    folder: Path, names: Sequence[str], figures: Sequence[SheetFigure], sheet: str, feet: Sequence[Point] | None
) -> None:
    """Write figures.csv: a row for each figure: its files, its box on the sheet, its score and the doubts.

    folder : of the table and of a folder with the annotation of each figure; sheet : path from there
    feet : pixel of the sheet where each stands, if the sheet is a map, for `x` and `y`; else None, and `lon` and `lat`
        are columns to fill in
    """
    place = ("map", "x", "y") if feet is not None else ("lon", "lat")
    columns = ("name", "figure", "bbox", "keypoints", "mask", "part_labels", *place, "found_score", "found_doubts")
    with (folder / TABLE).open("w", encoding="utf-8", newline="") as stream:
        table = csv.DictWriter(stream, columns, lineterminator="\n")
        table.writeheader()
        for index, (name, figure) in enumerate(zip(names, figures, strict=True)):
            row = {
                "name": name,
                "figure": sheet,
                "bbox": " ".join(map(str, figure.bbox)),
                "keypoints": f"{name}/{KEYPOINTS}",
                "mask": f"{name}/{MASK}",
                "part_labels": f"{name}/{PART_LABELS}",
                "found_score": round(figure.confidence, 3),
                "found_doubts": "; ".join(figure.found.doubts),
            }
            if feet is not None:
                x, y = feet[index]
                row |= {"map": sheet, "x": round(x, 2), "y": round(y, 2)}
            table.writerow(row)


def overview(rgb: ByteArray, figures: Sequence[SheetFigure]) -> Image.Image:
    """Picture of the sheet with the box and the number of each figure; rgb : (H, W, 3)."""
    picture = Image.fromarray(rgb)
    picture.thumbnail((MAX_OVERVIEW_PX, MAX_OVERVIEW_PX))
    scale = picture.width / rgb.shape[1]
    side = max(picture.size)
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(max(14, side // 45))
    for number, figure in enumerate(figures, start=1):
        x0, y0, x1, y1 = (scale * edge for edge in figure.bbox)
        pen.rectangle((x0, y0, max(x1 - 1, x0), max(y1 - 1, y0)), outline=BOX, width=max(2, side // 500))
        pen.rectangle(pen.textbbox((x0 + 4, y0 + 2), str(number), font), fill=BOX, outline=BOX, width=3)
        pen.text((x0 + 4, y0 + 2), str(number), fill=LABEL, font=font)
    return picture


def link_sheet(folder: Path, stage: Path, sheet: Path, beside: Sequence[Path]) -> str:
    """Path of the sheet from `folder`, from where a table may name files only below; returned with slashes.

    A sheet elsewhere is linked into `stage`, which becomes the content of the folder, or copied where the file system
    has no hard links, and so are the files beside it that may hold its georeference.
    """
    real, home = sheet.resolve(), folder.resolve()
    if real.is_relative_to(home):
        return real.relative_to(home).as_posix()
    for file in {sheet, *(each for each in beside if each.stat().st_size <= MAX_BESIDE_BYTES)}:
        target = stage / file.name
        try:
            os.link(file.resolve(), target)
        except OSError:
            shutil.copyfile(file, target)
    return sheet.name
