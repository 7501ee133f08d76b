"""Messages between the page and the server: a JSON header, and a byte per pixel."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fig2mesh.errors import FigureError, InputError
from fig2mesh.parse.annotation import Annotation
from fig2mesh.parse.keypoints import Joints
from fig2mesh.parse.picture import on_white, read_labels, read_mask, read_view
from fig2mesh.parse.read import joints_of_view
from fig2mesh.records import BoolArray, ByteArray, FloatArray
from fig2mesh.skeleton import BONES, JOINT_NAMES, LABEL_COLOURS, LIMBS, PART_NAMES, STANDING, without_side

INSIDE = 128
"""Bit of a pixel's byte that is set inside the silhouette; the lower bits are its part label."""

MAX_PIXELS = 40_000_000
"""Browsers do not support larger canvases."""


@dataclass(frozen=True)
class AnnotatedPicture:
    """A drawing that is being annotated.

    rgba : (H, W, 4) of the part of the picture that is shown; corner : (x, y) of its top left corner in the picture
    size : (width, height) of the whole picture; picture : its file name
    """

    name: str
    picture: str
    rgba: ByteArray
    corner: tuple[int, int]
    size: tuple[int, int]


def begin(
    path: Path,
    mask: Path | None,
    keypoints: Path | None,
    part_labels: Path | None,
    bbox: tuple[int, int, int, int] | None,
) -> tuple[AnnotatedPicture, Annotation]:
    """Read a drawing and its annotation, in IMAGE pixels of the part that is shown.

    Anything that no file provides is inferred from the picture; if no figure is found in it, the silhouette is empty
    and the joints are those of a standing person. Raises FigureError as `fig2mesh.parse.read.read_figure` does.
    """
    view = read_view(path, bbox)
    height, width = view.rgba.shape[:2]
    if height * width > MAX_PIXELS:
        raise FigureError(path, f"{width}×{height} px is too large for a page", "give --bbox round the figure")
    subject = AnnotatedPicture(path.stem, path.name, view.rgba, view.corner, view.size)
    silhouette = read_mask(mask, view)
    labels = np.zeros((height, width), np.uint8) if part_labels is None else read_labels(part_labels, view)
    given = None if keypoints is None else joints_of_view(keypoints, view, path, bbox)
    if silhouette is None or given is None:
        # torch takes seconds to load, so it is imported only for pictures without mask or joints.
        from fig2mesh.parse.infer import infer_figure

        usable = silhouette is None or bool(silhouette.any())
        found = infer_figure(on_white(view.rgba), silhouette) if usable else None
        if silhouette is None:
            silhouette = np.zeros((height, width), np.bool_) if found is None else found.mask
        if given is None and found is not None:
            given = Joints(found.joints_px, found.visible)
        elif given is None:
            given = Joints(standing(silhouette), np.ones(len(JOINT_NAMES), np.bool_))
    return subject, Annotation(silhouette, given.points_px, given.visible, labels, given.depth_order)


def standing(mask: BoolArray) -> FloatArray:
    """(21, 2) joints of a standing person as high as the silhouette, or as the picture if it is empty."""
    rows, columns = np.nonzero(mask) if mask.any() else np.nonzero(np.ones_like(mask))
    top, height, middle = rows.min(), np.ptp(rows) + 1, (columns.min() + columns.max() + 1) / 2
    joints = []
    for name in JOINT_NAMES:
        x, y = STANDING[without_side(name)]
        # The figure faces the viewer: its left is on the right.
        joints.append((middle + (-x if name.startswith("r_") else x) * height, top + y * height))
    limit = np.array([mask.shape[1], mask.shape[0]], np.float32)
    return np.clip(np.array(joints, np.float32), 0, limit)


def packed(subject: AnnotatedPicture, annotation: Annotation) -> bytes:
    """Message for the page, see `unpacked`; its header also has names, colours and bones."""
    height, width = annotation.mask.shape
    rows = zip(JOINT_NAMES, annotation.joints_px.astype(float).tolist(), annotation.visible.tolist(), strict=True)
    head = {
        "name": subject.name,
        "width": width,
        "height": height,
        "joints": {name: [*point, int(visible)] for name, point, visible in rows},
        "depth_order": dict(annotation.depth_order),
        "parts": PART_NAMES,
        "colours": LABEL_COLOURS,
        "bones": BONES,
        "limbs": LIMBS,
    }
    pixels = np.where(annotation.mask, annotation.part_labels | INSIDE, 0).astype(np.uint8)
    text = json.dumps(head).encode()
    return struct.pack("<I", len(text)) + text + pixels.tobytes()


def unpacked(message: bytes, subject: AnnotatedPicture) -> Annotation:
    """Annotation in a message of the page: the length of the header (4 bytes, little-endian), the header in JSON, and a
    byte per pixel, row by row: `INSIDE` and the part label.

    The contents are not trusted: raises InputError for an invalid message.
    """
    height, width = subject.rgba.shape[:2]
    try:
        (length,) = struct.unpack_from("<I", message)
        head: dict[str, Any] = json.loads(message[4 : 4 + length])
        pixels = np.frombuffer(message, np.uint8, height * width, 4 + length).reshape(height, width)
        if len(message) != 4 + length + height * width:
            raise ValueError("wrong length")
        values = np.array([head["joints"][name] for name in JOINT_NAMES], np.float64)
        if values.shape != (len(JOINT_NAMES), 3) or not np.isfinite(values).all():
            raise ValueError("joints")
        order = head["depth_order"]
        mask, labels = pixels >= INSIDE, pixels & (INSIDE - 1)
        if labels.max() >= len(PART_NAMES):
            raise ValueError("label")
        annotation = Annotation(
            mask,
            np.clip(values[:, :2], 0, [width, height]).astype(np.float32),
            values[:, 2] > 0,
            np.where(mask, labels, 0).astype(np.uint8),
            order,
        )
        annotation.figure(subject.name, subject.rgba)  # checks shapes and limbs
        return annotation
    except (struct.error, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise InputError("the page", f"sent an invalid annotation ({type(error).__name__})", "reload it") from None
