"""`fig2mesh parse`: silhouette, parts and joints from a picture; heavy imports wait until it runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from exporters.text import plain_text
from fig2mesh.commands.options import messages, request_options
from fig2mesh.conversion.fields import option, request_class
from fig2mesh.conversion.request import FigureFiles
from fig2mesh.errors import InputError, OutputError
from fig2mesh.terminal import configure_logging, log, print_outputs, progress

if TYPE_CHECKING:
    from fig2mesh.parse.sheet import SheetFigure

JointFormat = Literal["fig2mesh", "coco", "labelme", "supervisely"]


@request_class
class ParseRequest(FigureFiles):
    """A picture, and how to parse it."""

    output: Path = option(short="o", metavar="DIR", help="Output folder.")
    format: JointFormat = option(
        default="fig2mesh", help="Format of keypoints.json; the main command reads all of them."
    )
    all: bool = option(
        default=False, help="Find all figures of a sheet; write figures.json and a folder for each figure."
    )
    smallest: float | None = option(
        default=None,
        low=16,
        high=100_000,
        metavar="PX",
        help="With --all: minimum height of figures, pixels. Default: a tenth of the sheet's longer side.",
    )
    overwrite: bool = option(default=False, help="Replace existing files.")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.all and (self.mask, self.keypoints, self.part_labels, self.bbox) != (None,) * 4:
            raise InputError(
                "--all", "cannot be combined with --mask, --keypoints, --part-labels or --bbox", "leave them out"
            )
        if self.smallest is not None and not self.all:
            raise InputError("--smallest", "requires --all", "add --all")


@click.command()
@request_options(ParseRequest)
@messages
def parse(request: ParseRequest, quiet: bool, verbose: int) -> None:
    """Find the figure in the picture FIGURE; write keypoints.json, mask.png and part_labels.png.

    The files cover the whole picture. Correct them by hand if necessary, and give them to the main command as
    --keypoints, --mask and --part-labels; after --all, add the --bbox printed for each figure, or give figures.csv to
    `fig2mesh batch`; overview.jpg shows the boxes with their numbers. Files given here with
    --mask, --keypoints or --part-labels are kept, and only the rest is inferred.
    """
    configure_logging(quiet, verbose)
    if request.output.exists() and not request.output.is_dir():
        raise OutputError(request.output, "not a directory", "give -o a folder")
    if request.all:
        parse_sheet(request, quiet)
    else:
        parse_figure(request)


def parse_figure(request: ParseRequest) -> None:
    """Find one figure and write its three files."""
    from fig2mesh.parse.annotation import KEYPOINTS, MASK, PART_LABELS, write_annotation
    from fig2mesh.parse.files import annotation_of
    from fig2mesh.parse.read import read_parsed

    there = [name for name in (KEYPOINTS, MASK, PART_LABELS) if (request.output / name).exists()]
    if there and not request.overwrite:
        raise OutputError(request.output / there[0], "already exists", "use --overwrite or choose another folder")
    annotation = annotation_of(read_parsed(**request.reading(), labels=True))
    picture = plain_text(request.figure.name)
    print_outputs(*write_annotation(request.output, annotation, picture, request.format, request.overwrite))


def parse_sheet(request: ParseRequest, quiet: bool) -> None:
    """Find all figures of a sheet; write a folder for each, and a table of all for `fig2mesh batch`."""
    from fig2mesh.parse.files import FIGURES, write_sheet
    from fig2mesh.parse.picture import on_white, read_view
    from fig2mesh.parse.sheet_table import OVERVIEW, TABLE

    folder, sheet = request.output, request.figure
    if (folder / FIGURES).exists() and not request.overwrite:
        raise OutputError(folder / FIGURES, "already exists", "use --overwrite or choose another folder")
    georeference = georeference_of(sheet)
    view = read_view(sheet, None)
    # torch takes seconds to load, so it is imported after all checks.
    from fig2mesh.parse.sheet import figures_in

    rgb = on_white(view.rgba)
    with progress(quiet) as advance:
        figures = figures_in(rgb, request.smallest, advance)
    feet = None if georeference is None else [feet_on_sheet(figure) for figure in figures]
    names = write_sheet(folder, figures, sheet, rgb, request.format, request.overwrite, feet, georeference or ())
    for name, figure in zip(names, figures, strict=True):
        box = " ".join(map(str, figure.bbox))
        doubts = f"; {'; '.join(figure.found.doubts)}" if figure.found.doubts else ""
        print_outputs(f"{folder / name}: --bbox {box}, confidence {figure.confidence:.2f}{doubts}")
    if figures:
        log.info("%s: numbered boxes; %s: input of fig2mesh batch", folder / OVERVIEW, folder / TABLE)
        if georeference is None:
            log.info("%s: without places: fill in lon and lat, or use --map or --unplaced", folder / TABLE)
    else:
        log.warning("%s: no figure found; search for smaller ones with --smallest PX", sheet)


def feet_on_sheet(figure: SheetFigure) -> tuple[float, float]:
    """Pixel (x, y) of the sheet where a figure stands."""
    import numpy as np

    from fig2mesh.asset_frame import foot_on_picture
    from fig2mesh.records import Figure

    found, (x0, y0) = figure.found, figure.bbox[:2]
    blank = np.zeros((*found.mask.shape, 4), np.uint8)
    alone = Figure("", blank, found.mask, found.joints_px, found.visible, found.part_labels, origin_px=(x0, y0))
    return foot_on_picture(alone)


def georeference_of(sheet: Path) -> list[Path] | None:
    """Files beside a sheet that may hold its georeference; None if there is none, or it is not complete."""
    from fig2mesh.batch.row_files import sheet_files
    from georef.mapsheet import read_sheet

    try:
        read_sheet(sheet)
    except InputError as error:
        log.debug("%s", error)
        return None
    return sheet_files(sheet)
