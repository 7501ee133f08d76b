"""What `fig2mesh parse` does: read, infer, write. All its side effects are here."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from skimage.measure import find_contours

from exporters.atomic_file import write_whole
from fig2mesh.convert.job import configure_logging, progress
from fig2mesh.errors import InputError, OutputError
from fig2mesh.parse.annotation import (
    KEYPOINTS,
    MASK,
    PART_LABELS,
    Annotation,
    on_whole_picture,
    save_annotation,
    write_annotation,
)
from fig2mesh.parse.joint_writers import as_coco
from fig2mesh.parse.picture import on_white, read_view
from fig2mesh.parse.read import Reading, read_parsed

if TYPE_CHECKING:
    from fig2mesh.parse.sheet import SheetFigure

log = logging.getLogger("fig2mesh")


FIGURES = "figures.json"


def run(
    *,
    figure: Path,
    output: Path,
    kind: str,
    mask: Path | None,
    keypoints: Path | None,
    part_labels: Path | None,
    bbox: tuple[int, int, int, int] | None,
    whole_sheet: bool,
    smallest: float | None,
    overwrite: bool,
    quiet: bool,
    verbose: int,
) -> None:
    """What `fig2mesh parse IMAGE -o DIR …` does; the parameters are the options of the command line."""
    configure_logging(quiet, verbose)
    if output.exists() and not output.is_dir():
        raise OutputError(output, "is no folder", "give -o a folder")
    if whole_sheet:
        if mask is not None or keypoints is not None or part_labels is not None or bbox is not None:
            raise InputError("--all", "beside --mask, --keypoints, --part-labels or --bbox", "these are of one figure")
        parse_sheet(figure, output, kind, smallest, overwrite, quiet)
        return
    if smallest is not None:
        raise InputError("--smallest", "given without --all", "pass --all as well")
    there = [name for name in (KEYPOINTS, MASK, PART_LABELS) if (output / name).exists()]
    if there and not overwrite:
        raise OutputError(output / there[0], "exists", "pass --overwrite or another folder")
    found = read_parsed(figure, mask=mask, keypoints=keypoints, part_labels=part_labels, bbox=bbox, labels=True)
    for path in write_annotation(output, annotation_of(found), figure.name, kind, overwrite):
        log.info("%s", path)


def parse_sheet(sheet: Path, folder: Path, kind: str, smallest: float | None, overwrite: bool, quiet: bool) -> None:
    """Find all figures of a sheet; write figures.json, which is COCO, and a folder of annotations for each.

    In such a folder mask and part labels are as large as the figure's box, joints are in pixels of the sheet.
    """
    if (folder / FIGURES).exists() and not overwrite:
        raise OutputError(folder / FIGURES, "exists", "pass --overwrite or another folder")
    view = read_view(sheet, None)
    # torch takes seconds to load: what can be refused has been.
    from fig2mesh.parse.sheet import find_figures

    with progress(quiet) as advance:
        figures = find_figures(on_white(view.rgba), smallest, advance)
    names = [f"figure_{number:0{max(2, len(str(len(figures))))}d}" for number in range(1, len(figures) + 1)]

    def fill(stage: Path) -> None:
        for name, figure in zip(names, figures, strict=True):
            found = figure.found
            inside = Annotation(
                found.mask, found.joints_px, found.visible, found.part_labels, confidence=found.confidence
            )
            (stage / name).mkdir()
            save_annotation(stage / name, inside, sheet.name, kind, view.size, figure.bbox[:2])
        text = json.dumps(coco_of(figures, names, view.size, sheet.name), indent=1, ensure_ascii=False)
        (stage / FIGURES).write_text(text + "\n", encoding="utf-8")

    write_whole(folder, folder / FIGURES, fill, overwrite)
    for name, figure in zip(names, figures, strict=True):
        box = " ".join(map(str, figure.bbox))
        doubts = f"; {'; '.join(figure.found.doubts)}" if figure.found.doubts else ""
        log.info("%s: --bbox %s, confidence %.2f%s", folder / name, box, figure.confidence, doubts)
    if not figures:
        log.warning("%s: no figure is found; smaller ones are looked for with --smallest PX", sheet)


def coco_of(figures: list[SheetFigure], names: list[str], size: tuple[int, int], picture: str) -> dict[str, Any]:
    """The figures as a COCO keypoint file, with `score`, the parser's `doubts` and the `folder` of each beside.

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
    """What was read and inferred, in pixels of the whole picture."""
    figure = found.figure
    window = Annotation(
        figure.mask, figure.joints_px, figure.visible, found.part_labels, figure.depth_order, found.confidence
    )
    return on_whole_picture(window, found.view.corner, found.view.size)
