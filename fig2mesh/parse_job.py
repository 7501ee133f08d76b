"""What `fig2mesh parse` does: read, infer, write. All its side effects are here."""

from __future__ import annotations

import logging
from pathlib import Path

from fig2mesh.errors import OutputError
from fig2mesh.job import configure_logging
from fig2mesh.parse.annotation import KEYPOINTS, MASK, PART_LABELS, Annotation, on_whole_picture, write_annotation
from fig2mesh.parse.read import Reading, read_parsed

log = logging.getLogger("fig2mesh")


def run(
    *,
    figure: Path,
    output: Path,
    kind: str,
    mask: Path | None,
    keypoints: Path | None,
    part_labels: Path | None,
    bbox: tuple[int, int, int, int] | None,
    overwrite: bool,
    quiet: bool,
    verbose: int,
) -> None:
    """What `fig2mesh parse IMAGE -o DIR …` does; the parameters are the options of the command line."""
    configure_logging(quiet, verbose)
    if output.exists() and not output.is_dir():
        raise OutputError(output, "is no folder", "give -o a folder")
    there = [name for name in (KEYPOINTS, MASK, PART_LABELS) if (output / name).exists()]
    if there and not overwrite:
        raise OutputError(output / there[0], "exists", "pass --overwrite or another folder")
    found = read_parsed(figure, mask=mask, keypoints=keypoints, part_labels=part_labels, bbox=bbox, labels=True)
    for path in write_annotation(output, annotation_of(found), figure.name, kind, overwrite):
        log.info("%s", path)


def annotation_of(found: Reading) -> Annotation:
    """What was read and inferred, in pixels of the whole picture."""
    figure = found.figure
    window = Annotation(
        figure.mask, figure.joints_px, figure.visible, found.part_labels, figure.depth_order, found.confidence
    )  # fmt: skip
    return on_whole_picture(window, found.view.corner, found.view.size)
