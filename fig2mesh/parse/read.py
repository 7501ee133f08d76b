"""Read one drawn figure from its files, and infer from the picture what they do not give."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fig2mesh.errors import FigureError
from fig2mesh.parse.keypoints import Joints, read_keypoints
from fig2mesh.parse.picture import PictureView, on_white, read_labels, read_mask, read_view
from fig2mesh.records import BoolArray, ByteArray, Figure, FloatArray
from fig2mesh.skeleton import JOINT_NAMES
from fig2mesh.system.surroundings import valid_text

if TYPE_CHECKING:
    from fig2mesh.parse.infer import Inference

log = logging.getLogger("fig2mesh")

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
    """

    view: PictureView
    silhouette: BoolArray | None
    joints: Joints | None
    part_labels: ByteArray


def read_figure(
    path: Path | str,
    *,
    mask: Path | str | None = None,
    keypoints: Path | str | None = None,
    part_labels: Path | str | None = None,
    bbox: tuple[int, int, int, int] | None = None,
    name: str | None = None,
) -> Figure:
    """Read a figure from its files; a missing silhouette and missing joints are inferred from the picture.

    Parameters
    ----------
    path : the picture; its alpha channel, if it has one, is the silhouette unless `mask` is given
    mask : picture of the same size, or of the size of `bbox`; figure bright (≥ 128) on dark, or its alpha channel
    keypoints : joints, see `read_keypoints`
    part_labels : 8-bit single-channel picture of a size as for `mask` with the labels of `PART_NAMES`
    bbox : x0, y0, x1, y1 in IMAGE pixels, x1 and y1 exclusive; everything outside is cut off
    name : identifier of the figure; default: the file's stem

    Raises
    ------
    FigureError : a file cannot be read, sizes differ, the mask is empty, a joint lies outside the picture, no figure is
        found in the picture
    """
    given = read_parsed(
        Path(path),
        mask=None if mask is None else Path(mask),
        keypoints=None if keypoints is None else Path(keypoints),
        part_labels=None if part_labels is None else Path(part_labels),
        bbox=bbox,
        name=name,
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
) -> Reading:
    """As `read_figure`, and return what was inferred as well; labels : infer part labels where none are given."""
    given = read_given(path, mask=mask, keypoints=keypoints, part_labels=part_labels, bbox=bbox)
    view, silhouette, joints, known = given.view, given.silhouette, given.joints, given.part_labels
    confidence, parts = None, known
    if silhouette is None or joints is None or (labels and part_labels is None):
        found = _inferred(path, view.rgba, silhouette)
        silhouette = found.mask if silhouette is None else silhouette
        if joints is None:
            joints, confidence = Joints(found.joints_px, found.visible), found.confidence
        if part_labels is None:
            parts = found.part_labels
    figure = Figure(
        name=valid_text(name or path.stem),
        rgba=view.rgba,
        mask=silhouette,
        joints_px=np.clip(joints.points_px, 0, np.array(silhouette.shape[::-1], np.float32)),
        visible=joints.visible,
        part_labels=np.where(silhouette, known, 0),
        depth_order=joints.depth_order,
        origin_px=(float(view.corner[0]), float(view.corner[1])),
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
    if silhouette is not None and not silhouette.any():
        where = mask if mask is not None else path
        raise FigureError(where, "the silhouette is empty", "the figure must be opaque, or bright in --mask")
    if joints is not None:
        size = np.array(shape[::-1], np.float32)
        outside = ((joints.points_px < -JOINT_SLACK_PX) | (joints.points_px > size + JOINT_SLACK_PX)).any(axis=1)
        if outside.any():
            index = int(np.argmax(outside))
            x, y = joints.points_px[index]
            finding = f"{JOINT_NAMES[index]} at ({x:g}, {y:g}) is outside the picture of {shape[1]}×{shape[0]} px"
            raise FigureError(keypoints, finding, "move it inside, or pass the joints that belong to this picture")
    return Given(view, silhouette, joints, known)


def joints_of_view(path: Path, view: PictureView, picture: Path, bbox: tuple[int, int, int, int] | None) -> Joints:
    """Read the joints of a file, in IMAGE pixels of the view. Raises FigureError, also for those of another picture."""
    given = read_keypoints(path, picture.name, bbox)
    if given.size is not None and given.size != view.size:
        made, has = (f"{width}×{height}" for width, height in (given.size, view.size))
        found = f"made for a picture of {made} px, but {picture.name} has {has}"
        raise FigureError(path, found, "pass the joints that belong to this picture")
    points = given.points_px - np.array(view.corner, np.float32)
    return Joints(points, given.visible, given.size, given.depth_order)


def _inferred(path: Path, rgba: ByteArray, silhouette: BoolArray | None) -> Inference:
    """Infer with the figure parser; its doubts are logged as a warning."""
    # torch takes seconds to load: it is imported only for pictures without mask or joints.
    from fig2mesh.parse.infer import REMEDY, infer_figure

    found = infer_figure(on_white(rgba), silhouette)
    if found is None:
        raise FigureError(path, "no figure found", "pass --bbox round the figure, or --mask and --keypoints")
    if found.doubts:
        log.warning("%s: %s; %s", path, "; ".join(found.doubts), REMEDY)
    return found
