"""Files of a parsed picture: one figure's three files, or a folder for each figure of a sheet."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from skimage.measure import find_contours

from exporters.atomic_file import write_whole
from fig2mesh.parse.annotation import Annotation, on_whole_picture, save_annotation
from fig2mesh.parse.joint_writers import as_coco
from fig2mesh.parse.read import Reading
from fig2mesh.parse.sheet_table import OVERVIEW, Point, link_sheet, overview, write_table
from fig2mesh.records import ByteArray

if TYPE_CHECKING:
    from fig2mesh.parse.sheet import SheetFigure

FIGURES = "figures.json"
"""Name of the COCO file beside the folders of a sheet's figures."""


def write_sheet(
    folder: Path,
    figures: Sequence[SheetFigure],
    sheet: Path,
    rgb: ByteArray,
    kind: str,
    overwrite: bool,
    feet: Sequence[Point] | None = None,
    beside: Sequence[Path] = (),
) -> list[str]:
    """Write figures.json, which is COCO, a folder of annotations for each figure, the table and the overview; all or
    none.

    In such a folder mask and part labels are as large as the figure's box, joints are in pixels of the sheet. Without
    figures there is only figures.json.

    rgb : (H, W, 3) the sheet; kind : of the joints files
    feet : pixel of the sheet where each figure stands; None if the sheet is no map
    beside : files of the sheet that may hold its georeference
    returns : names of the folders
    """
    size = (rgb.shape[1], rgb.shape[0])
    digits = max(2, len(str(len(figures))))
    names = [f"figure_{number:0{digits}d}" for number in range(1, len(figures) + 1)]

    def fill(stage: Path) -> None:
        for name, figure in zip(names, figures, strict=True):
            found = figure.found
            inside = Annotation(
                found.mask, found.joints_px, found.visible, found.part_labels, confidence=found.confidence
            )
            (stage / name).mkdir()
            save_annotation(stage / name, inside, sheet.name, kind, size, figure.bbox[:2])
        if figures:
            linked = link_sheet(folder, stage, sheet, beside)
            write_table(stage, names, figures, linked, feet)
            overview(rgb, figures).save(stage / OVERVIEW, quality=85)
        text = json.dumps(coco_of(figures, names, size, sheet.name), indent=1, ensure_ascii=False)
        (stage / FIGURES).write_text(text + "\n", encoding="utf-8")

    write_whole(folder, folder / FIGURES, fill, overwrite)
    return names


def coco_of(
    figures: Sequence[SheetFigure], names: Sequence[str], size: tuple[int, int], picture: str
) -> dict[str, Any]:
    """The figures as a COCO keypoint file, with the `score`, the parser's `doubts` and the `folder` of each.

    https://cocodataset.org/#format-data
    """
    document: dict[str, Any] = as_coco(np.zeros((21, 2), np.float32), np.zeros(21, np.bool_), size, picture)
    document["annotations"] = []
    for number, (name, figure) in enumerate(zip(names, figures, strict=True), start=1):
        found = figure.found
        x0, y0, x1, y1 = figure.bbox
        points = found.joints_px + np.array([x0, y0], np.float32)
        (annotation,) = as_coco(points, found.visible, size, picture)["annotations"]
        outlines = [
            (contour[:, ::-1] + [x0 - 0.5, y0 - 0.5]).round(1)
            for contour in find_contours(np.pad(found.mask, 1).astype(np.float32), 0.5)
        ]
        document["annotations"].append(
            annotation
            | {
                "id": number,
                "bbox": [x0, y0, x1 - x0, y1 - y0],
                "area": int(found.mask.sum()),
                "segmentation": [outline.reshape(-1).tolist() for outline in outlines if len(outline) > 3],
                "score": round(figure.confidence, 3),
                "doubts": list(found.doubts),
                "folder": name,
            }
        )
    return document


def annotation_of(found: Reading) -> Annotation:
    """Annotation of what was read and inferred, in pixels of the whole picture."""
    figure = found.figure
    window = Annotation(
        figure.mask, figure.joints_px, figure.visible, found.part_labels, figure.depth_order, found.confidence
    )
    return on_whole_picture(window, found.view.corner, found.view.size)
