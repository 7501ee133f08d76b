"""Read one drawn figure from its files, and infer from the picture what they do not give."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from exporters.file_names import figure_name
from exporters.text import plain_text
from fig2mesh.errors import FigureError
from fig2mesh.parse.checks.consistency import (
    Mismatch,
    PictureFrame,
    ReducedSilhouette,
    coordinate_finding,
    joint_finding,
    reduced_silhouette,
    side_finding,
    stray_finding,
    upright_finding,
)
from fig2mesh.parse.checks.missed import detached_pieces, missed_things
from fig2mesh.parse.checks.person import check_person, person_doubts
from fig2mesh.parse.checks.silhouette_checks import edge_finding, label_finding, silhouette_finding
from fig2mesh.parse.keypoints import Joints, read_keypoints
from fig2mesh.parse.labelled_points import listed
from fig2mesh.parse.picture import PictureView, on_white, read_labels, read_mask, read_view
from fig2mesh.parse.standing import moved
from fig2mesh.records import BoolArray, ByteArray, Figure, FloatArray
from fig2mesh.skeleton import JOINT_NAMES

if TYPE_CHECKING:
    from fig2mesh.parse.infer import Inference

log = logging.getLogger("fig2mesh")

REMEDY = "inspect the files that `fig2mesh parse` writes, correct keypoints.json or mask.png, and pass them"

FEW = 0.25
"""Share of joints far outside the picture up to which these are named; more are all wrong in the same way."""

JOINT_SLACK_PX = 1.0
"""Tolerance: joints may lie on the picture's edge, and rounding by annotation tools puts them up to a pixel outside."""


@dataclass(frozen=True)
class Reading:
    """Figure as read, and what was inferred for it.

    figure : within its window of the picture; view : that window
    part_labels : (H, W) uint8 of the window, those given, or inferred where requested
    confidence : (21,) 0-1 where joints were inferred, else None
    """

    figure: Figure
    view: PictureView
    part_labels: ByteArray
    confidence: FloatArray | None


@dataclass(frozen=True)
class Given:
    """Content of the files of a figure.

    view : the figure's window of the picture; silhouette : (H, W) bool, None where no file has one; joints : in pixels
    of the view, None without a file; part_labels : (H, W) uint8, 0 where no label is given
    doubts : what is unlikely about them, as text
    """

    view: PictureView
    silhouette: BoolArray | None
    joints: Joints | None
    part_labels: ByteArray
    doubts: tuple[str, ...] = ()


def read_figure(
    path: Path | str,
    *,
    mask: Path | str | None = None,
    keypoints: Path | str | None = None,
    part_labels: Path | str | None = None,
    bbox: tuple[int, int, int, int] | None = None,
    name: str | None = None,
    force: bool = True,
) -> Figure:
    """Read a figure from its files; a missing silhouette and missing joints are inferred from the picture.

    Parameters
    ----------
    path : the picture; its alpha channel, if it has one, is the silhouette unless `mask` is given
    mask : picture of the same size, or of the size of `bbox`; figure bright (≥ 128) on dark, or its alpha channel
    keypoints : joints, see `read_keypoints`
    part_labels : 8-bit single-channel picture of a size as for `mask` with the labels of `PART_NAMES`
    bbox : x0, y0, x1, y1 in IMAGE pixels, x1 and y1 exclusive; everything outside is cut off
    name : identifier of the figure; default: the file's stem, or its folder, see `exporters.file_names.figure_name`
    force : whether a picture is read in which hardly a person is found; its score and doubts say so

    Raises
    ------
    FigureError : a file cannot be read, sizes differ, the mask is empty, a joint lies outside the picture, files do not
        belong together, no figure is found in the picture
    """
    given = read_parsed(
        Path(path),
        mask=None if mask is None else Path(mask),
        keypoints=None if keypoints is None else Path(keypoints),
        part_labels=None if part_labels is None else Path(part_labels),
        bbox=bbox,
        name=name,
        force=force,
    )
    return given.figure


def read_parsed(
    path: Path,
    *,
    mask: Path | None = None,
    keypoints: Path | None = None,
    part_labels: Path | None = None,
    bbox: tuple[int, int, int, int] | None = None,
    name: str | None = None,
    labels: bool = False,
    force: bool = True,
) -> Reading:
    """As `read_figure`, and return what was inferred as well; labels : infer part labels where none are given."""
    given = read_given(path, mask=mask, keypoints=keypoints, part_labels=part_labels, bbox=bbox)
    view, silhouette, joints, known = given.view, given.silhouette, given.joints, given.part_labels
    confidence, parts, doubts = None, known, list(given.doubts)
    if silhouette is None or joints is None or joints.missing or (labels and part_labels is None):
        found = _inferred(path, view.rgba, silhouette)
        if joints is None:
            joints, confidence = Joints(found.joints_px, found.visible), found.confidence
            check_person(path, found.score, force)
            unlikely = (*person_doubts(found.score), *found.doubts)
            if unlikely:
                log.warning("%s: %s; %s", path, "; ".join(unlikely), REMEDY)
            doubts += unlikely
        elif joints.missing:
            joints = _completed(joints, found)
            missing = f"{listed(joints.missing)} inferred: the joints file does not have them"
            doubts += _logged(path, (missing,))
        if silhouette is None:
            silhouette = found.mask
            beside = missed_things(on_white(view.rgba), silhouette, view.corner)
            doubts += _logged(path, (*beside, *detached_pieces(silhouette, view.corner)))
            if keypoints is not None:
                doubts += _settled(
                    keypoints, _joint_findings(joints, reduced_silhouette(silhouette), view, inferred=True)
                )
        if part_labels is None:
            parts = found.part_labels
    figure = Figure(
        name=plain_text(name or figure_name(path.absolute())),
        rgba=view.rgba,
        mask=silhouette,
        joints_px=np.clip(joints.points_px, 0, np.array(silhouette.shape[::-1], np.float32)),
        visible=joints.visible,
        part_labels=np.where(silhouette, known, 0),
        depth_order=joints.depth_order,
        origin_px=(float(view.corner[0]), float(view.corner[1])),
        doubts=tuple(doubts),
        score=None if confidence is None else found.score,
    )
    return Reading(figure, view, parts, confidence)


def read_given(
    path: Path,
    *,
    mask: Path | None = None,
    keypoints: Path | None = None,
    part_labels: Path | None = None,
    bbox: tuple[int, int, int, int] | None = None,
) -> Given:
    """Read the files of a figure; nothing is inferred. Parameters and errors as of `read_figure`."""
    view = read_view(path, bbox)
    silhouette = read_mask(mask, view)
    joints = None if keypoints is None else joints_of_view(keypoints, view, path, bbox)
    shape = view.rgba.shape[:2]
    known = np.zeros(shape, np.uint8) if part_labels is None else read_labels(part_labels, view)
    where = mask if mask is not None else path
    if silhouette is not None and not silhouette.any():
        raise FigureError(where, "the silhouette is empty", "the figure must be opaque, or bright in --mask")
    doubts = list(view.notes)
    if joints is not None and keypoints is not None:
        doubts += _logged(keypoints, _notes(joints, path))
        _check_inside(keypoints, joints, view, float(max(shape)), FEW)
    outline = None if silhouette is None else reduced_silhouette(silhouette)
    if joints is not None and keypoints is not None and (outline is None or not outline.small):
        _check_coordinates(keypoints, joints, view)
    if silhouette is not None:
        doubts += _settled(where, _silhouette_findings(silhouette, view, mask is not None))
        if joints is not None and keypoints is not None and outline is not None and not outline.small:
            doubts += _settled(keypoints, _joint_findings(joints, outline, view))
        if part_labels is not None:
            points = None if joints is None else joints.points_px
            doubts += _settled(part_labels, [label_finding(known, silhouette, points)])
    if joints is not None and keypoints is not None:
        _check_inside(keypoints, joints, view)
    return Given(view, silhouette, joints, known, tuple(doubts))


def joints_of_view(path: Path, view: PictureView, picture: Path, bbox: tuple[int, int, int, int] | None) -> Joints:
    """Read the joints of a file, in IMAGE pixels of the view. Raises FigureError, also for those of another picture."""
    given = read_keypoints(path, picture.name, bbox, view.size)
    if given.size is not None and given.size != view.size:
        made, has = (f"{width}×{height}" for width, height in (given.size, view.size))
        found = f"made for a picture of {made} px, but {picture.name} has {has}"
        raise FigureError(path, found, size_remedy(given.size, view.size, view.rgba.shape[1::-1]))
    return replace(given, points_px=given.points_px - np.array(view.corner, np.float32))


def size_remedy(made: tuple[int, int], has: tuple[int, int], window: tuple[int, ...]) -> str:
    """Remedy for joints made for a picture of another size, with a guess."""
    remedy = "pass the joints that belong to this picture"
    if made == tuple(window):
        return f"made for the part inside --bbox? add its corner to them, or {remedy}"
    across, down = (length / other for length, other in zip(has, made, strict=True))
    if abs(across / down - 1) < 0.01:
        return f"scale them by {across:.4g}, with width and height, or {remedy}"
    if made == has[::-1]:
        return f"made before the picture was turned? turn them too, or {remedy}"
    return remedy


def _notes(joints: Joints, picture: Path) -> Iterator[str]:
    if joints.picture is not None:
        yield f"is about {joints.picture[:60]}, not {picture.name}"
    if joints.missing and joints.unknown:
        yield f"not understood: {listed(joints.unknown)}; write {', '.join(joints.missing[:3])}, …"


def _check_inside(
    path: Path, joints: Joints, view: PictureView, slack_px: float = JOINT_SLACK_PX, most: float = 1.0
) -> None:
    """Raise FigureError for a joint so far outside the picture, unless more than a share `most` of the joints are."""
    height, width = view.rgba.shape[:2]
    size = np.array([width, height], np.float32)
    outside = ((joints.points_px < -slack_px) | (joints.points_px > size + slack_px)).any(axis=1)
    outside &= joints.drawn
    if outside.any() and outside.sum() <= most * joints.drawn.sum():
        index = int(np.argmax(outside))
        x, y = joints.points_px[index]
        finding = f"{JOINT_NAMES[index]} at ({x:g}, {y:g}) is outside the picture of {width}×{height} px"
        raise FigureError(path, finding, "move it inside, or pass the joints that belong to this picture")


def _check_coordinates(path: Path, joints: Joints, view: PictureView) -> None:
    points = joints.points_px[joints.drawn] + np.array(view.corner, np.float32)
    _settled(path, [coordinate_finding(points, _frame(view))])


def _frame(view: PictureView) -> PictureFrame:
    height, width = view.rgba.shape[:2]
    return PictureFrame(view.size, view.corner, (width, height))


def _joint_findings(
    joints: Joints, outline: ReducedSilhouette, view: PictureView, inferred: bool = False
) -> Iterator[Mismatch | None]:
    whole = joint_finding(joints.points_px[joints.drawn], outline, _frame(view), inferred)
    yield whole
    if whole is None and not inferred:
        yield stray_finding(joints.points_px, joints.drawn, outline)
    if not joints.missing:
        yield upright_finding(joints.points_px, outline)
        yield side_finding(joints.points_px, joints.visible)


def _silhouette_findings(silhouette: BoolArray, view: PictureView, given: bool) -> Iterator[Mismatch | None]:
    yield silhouette_finding(view.rgba, silhouette, _frame(view))
    if given:  # an alpha channel is a part of its picture
        yield edge_finding(view.rgba, silhouette)


def _settled(path: Path, findings: Iterable[Mismatch | None]) -> list[str]:
    """Doubts of findings, logged. Raises FigureError for the first that is certain."""
    found = [each for each in findings if each is not None]
    for each in found:
        if each.certain:
            raise FigureError(path, each.text, each.remedy)
    return _logged(path, [f"{each.text}; {each.remedy}" for each in found])


def _logged(path: Path, doubts: Iterable[str]) -> list[str]:
    """Doubts about a file, each logged as a warning of one line."""
    found = list(doubts)
    for each in found:
        log.warning("%s: %s", path, each)
    return found


def _completed(joints: Joints, found: Inference) -> Joints:
    """Joints whose missing ones are those inferred from the picture, moved as the others differ."""
    has = joints.annotated
    fitted = moved(found.joints_px, joints.points_px, has)
    points = np.where(has[:, None], joints.points_px, fitted).astype(np.float32)
    return replace(joints, points_px=points, visible=np.where(has, joints.visible, found.visible))


def _inferred(path: Path, rgba: ByteArray, silhouette: BoolArray | None) -> Inference:
    """Infer with the figure parser. Raises FigureError where it finds no figure."""
    # torch takes seconds to load: it is imported only for pictures without mask or joints.
    from fig2mesh.parse.infer import infer_figure

    found = infer_figure(on_white(rgba), silhouette)
    if found is None:
        raise FigureError(path, "no figure found", "pass --bbox round the figure, or --mask and --keypoints")
    return found
