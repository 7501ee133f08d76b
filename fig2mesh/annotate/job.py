"""`fig2mesh annotate`: read a drawing, serve the page, save the annotation. All side effects are here."""

from __future__ import annotations

import html
import logging
import shlex
from pathlib import Path

from fig2mesh.annotate.editing import AnnotatedPicture, begin
from fig2mesh.annotate.request import AnnotateRequest
from fig2mesh.annotate.server import annotation_server
from fig2mesh.errors import FigureError, OutputError
from fig2mesh.parse.annotation import KEYPOINTS, MASK, PART_LABELS, Annotation, on_whole_picture, write_annotation
from fig2mesh.settings import Parts, settings_for
from fig2mesh.skeleton import FIGURE_HEIGHT
from fig2mesh.view.job import scene_of
from fig2mesh.view.page import view_page
from fig2mesh.view.server import show
from fig2mesh.view.template import asset, filled

log = logging.getLogger("fig2mesh")

PACKAGE = "fig2mesh.annotate"


def run(request: AnnotateRequest) -> None:
    """Run `fig2mesh annotate`."""
    folder = request.folder
    if folder.exists() and not folder.is_dir():
        raise OutputError(folder, "not a directory", "give -o a folder")

    def kept(given: Path | None, name: str) -> Path | None:
        # Resume from the files saved before, unless an option names another file.
        return given if given is not None else folder / name if (folder / name).is_file() else None

    mask, labels = kept(request.mask, MASK), kept(request.part_labels, PART_LABELS)
    subject, start = begin(request.figure, mask, kept(request.keypoints, KEYPOINTS), labels, request.bbox)

    def save(annotation: Annotation) -> str:
        whole = on_whole_picture(annotation, subject.corner, subject.size)
        write_annotation(folder, whole, subject.picture, overwrite=True)
        log.info("%s", main_command(request.figure, folder, request.bbox))
        return f"saved in {folder}"

    def preview(annotation: Annotation) -> str:
        return preview_page(subject, annotation, request.parts)

    show(annotation_server(page(subject), subject, start, save, preview, request.port), request.open)


def page(subject: AnnotatedPicture) -> str:
    """HTML page of a drawing; it fetches picture and annotation from the server."""
    scripts = "\n".join(asset(f"{name}.js", PACKAGE) for name in ("document", "canvas", "page"))
    values = {"title": html.escape(subject.name), "style": asset("page.css", PACKAGE), "scripts": scripts}
    return filled("page.html", values, PACKAGE)


def preview_page(subject: AnnotatedPicture, annotation: Annotation, parts: Parts) -> str:
    """HTML page of the model in draft quality. Raises FigureError if the silhouette is empty."""
    if not annotation.mask.any():
        raise FigureError(subject.picture, "the silhouette is empty", "paint it first")
    settings = settings_for("draft", parts=parts, device="cpu", seed=0)
    return view_page(scene_of(annotation.figure(subject.name, subject.rgba), settings, FIGURE_HEIGHT))


def main_command(figure: Path, folder: Path, bbox: tuple[int, int, int, int] | None) -> str:
    """Command line that converts the saved annotation to a placed model, again and again; LON and LAT are to be filled
    in."""
    words = ["fig2mesh", str(figure)]
    for option, name in (("--keypoints", KEYPOINTS), ("--mask", MASK), ("--part-labels", PART_LABELS)):
        words += [option, str(folder / name)]
    if bbox is not None:
        words += ["--bbox", *map(str, bbox)]
    return f"{shlex.join(words)} --lonlat LON LAT --overwrite"
