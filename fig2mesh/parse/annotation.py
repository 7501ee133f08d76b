"""Annotation of a drawing, and its files: keypoints.json, mask.png, part_labels.png."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from PIL import Image, PngImagePlugin

from exporters.atomic_file import write_whole
from fig2mesh.parse.joint_writers import WRITERS
from fig2mesh.records import BoolArray, ByteArray, DepthOrder, Figure, FloatArray
from fig2mesh.skeleton import JOINT_NAMES, LABEL_COLOURS, PART_NAMES

KEYPOINTS, MASK, PART_LABELS = "keypoints.json", "mask.png", "part_labels.png"
"""Names of the files in a folder of annotations; they are read by the main command's options of the same names."""


@dataclass(frozen=True)
class Annotation:
    """Annotation of a drawing; all in IMAGE pixels of the whole picture.

    mask : (H, W) bool; joints_px : (21, 2) float32; visible : (21,) bool; part_labels : (H, W) uint8, 0 outside of
    the mask; depth_order : as in `Figure`; confidence : (21,) 0-1 where the joints were inferred, else None
    """

    mask: BoolArray
    joints_px: FloatArray
    visible: BoolArray
    part_labels: ByteArray
    depth_order: Mapping[str, DepthOrder] = field(default_factory=dict)
    confidence: FloatArray | None = None

    def figure(self, name: str, rgba: ByteArray) -> Figure:
        """Figure made of a picture and this annotation."""
        return Figure(name, rgba, self.mask, self.joints_px, self.visible, self.part_labels, self.depth_order)


def write_annotation(
    folder: Path, annotation: Annotation, picture: str, kind: str = "fig2mesh", overwrite: bool = False
) -> tuple[Path, ...]:
    """Write the three files of an annotation, all or none.

    folder : created if it does not exist; picture : file name of the drawing; kind : of the joints file, see `WRITERS`
    returns : the files written

    part_labels.png has a palette for viewing; its text chunk "legend" explains its numbers.
    Raises ExportError where the disk refuses or a file already exists.
    """
    height, width = annotation.mask.shape

    def fill(stage: Path) -> None:
        save_annotation(stage, annotation, picture, kind, (width, height))

    return write_whole(folder, folder / KEYPOINTS, fill, overwrite)


def save_annotation(
    folder: Path,
    annotation: Annotation,
    picture: str,
    kind: str,
    size: tuple[int, int],
    corner: tuple[int, int] = (0, 0),
) -> None:
    """Save the three files in an existing folder.

    annotation : of a window of the picture; mask and labels are saved as large as that, joints in IMAGE of the picture
    size : (width, height) of the picture; corner : (x, y) of the window; others as for `write_annotation`
    """
    points = annotation.joints_px + np.array(corner, np.float32)
    joints = WRITERS[kind](points, annotation.visible, size, picture)
    if annotation.depth_order and kind == "fig2mesh":
        joints["depth_order"] = dict(annotation.depth_order)
    if annotation.confidence is not None and kind == "fig2mesh":
        rounded = [round(value, 3) for value in annotation.confidence.astype(float).tolist()]
        joints["confidence"] = dict(zip(JOINT_NAMES, rounded, strict=True))
    (folder / KEYPOINTS).write_text(json.dumps(joints, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    Image.fromarray(np.where(annotation.mask, np.uint8(255), np.uint8(0))).save(folder / MASK)
    labels = Image.fromarray(np.where(annotation.mask, annotation.part_labels, np.uint8(0)))
    labels.putpalette([value for colour in LABEL_COLOURS for value in colour])
    text = PngImagePlugin.PngInfo()
    text.add_text("legend", json.dumps(dict(enumerate(PART_NAMES))))
    labels.save(folder / PART_LABELS, pnginfo=text, optimize=False)


def on_whole_picture(annotation: Annotation, corner: tuple[int, int], size: tuple[int, int]) -> Annotation:
    """Annotation of a window, in pixels of the whole picture.

    corner : (x, y) of the window; size : (width, height) of the picture
    """
    (x, y), (width, height) = corner, size
    rows, columns = annotation.mask.shape
    mask, labels = np.zeros((height, width), np.bool_), np.zeros((height, width), np.uint8)
    window = np.s_[y : y + rows, x : x + columns]
    mask[window], labels[window] = annotation.mask, annotation.part_labels
    joints = annotation.joints_px + np.array([x, y], np.float32)
    return replace(annotation, mask=mask, joints_px=joints, part_labels=labels)
