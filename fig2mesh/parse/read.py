"""Read one drawn figure: the picture, its silhouette, joints and, where given, part labels."""

from __future__ import annotations

import logging
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageOps, UnidentifiedImageError

from fig2mesh.errors import FigureError
from fig2mesh.parse.keypoints import read_keypoints
from fig2mesh.records import JOINT_NAMES, PART_NAMES, BoolArray, ByteArray, Figure, FloatArray

if TYPE_CHECKING:
    from fig2mesh.parse.infer import Inference

log = logging.getLogger("fig2mesh")

MAX_PIXELS = 178_956_970
"""Twice Pillow's warning level: decoding more would need gigabytes."""

BAND_PX = 512
"""Rows that are converted to RGBA at a time."""

JOINT_SLACK_PX = 1.0
"""Joints may lie on the picture's edge; rounding by annotation tools puts them up to a pixel outside."""


@dataclass(frozen=True)
class Reading:
    """A figure as it was read, and what was inferred for it.

    figure : within its window of the picture; origin : (x, y) of the window; size : (width, height) of the picture
    part_labels : (H, W) uint8 of the window, those given, or inferred where that was asked for
    confidence : (21,) 0-1 where joints were inferred, else None
    """

    figure: Figure
    origin: tuple[int, int]
    size: tuple[int, int]
    part_labels: ByteArray
    confidence: FloatArray | None


def read_figure(
    path: Path,
    *,
    mask: Path | None = None,
    keypoints: Path | None = None,
    part_labels: Path | None = None,
    bbox: tuple[int, int, int, int] | None = None,
    name: str | None = None,
) -> Figure:
    """Read a figure from its files; silhouette and joints that none of them gives are inferred from the picture.

    Parameters
    ----------
    path : the picture; its alpha channel, if it has one, is the silhouette unless `mask` is given
    mask : picture of the same size, figure bright (≥ 128) on dark, or its alpha channel
    keypoints : joints, see `read_keypoints`
    part_labels : 8-bit single-channel picture of the same size with the labels of `PART_NAMES`
    bbox : x0, y0, x1, y1 in IMAGE pixels, x1 and y1 exclusive; everything outside is cut off
    name : identifier of the figure; default: the file's stem

    Raises
    ------
    FigureError : a file cannot be read, sizes differ, the mask is empty, a joint lies outside the picture, no figure is
        found in the picture
    """
    return read_parsed(path, mask=mask, keypoints=keypoints, part_labels=part_labels, bbox=bbox, name=name).figure


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
    """As `read_figure`, with what it was inferred from; labels : infer part labels where none are given."""
    rgba = read_picture(path)
    height, width = rgba.shape[:2]
    silhouette = _silhouette(mask, rgba)
    joints, visible = np.zeros((len(JOINT_NAMES), 2), np.float32), np.zeros(len(JOINT_NAMES), np.bool_)
    if keypoints is not None:
        joints, visible, drawn_on = read_keypoints(keypoints)
        if drawn_on is not None and drawn_on != (width, height):
            raise FigureError(
                keypoints,
                f"made for a picture of {drawn_on[0]}×{drawn_on[1]} px, but {path.name} has {width}×{height}",
                "pass the joints that belong to this picture",
            )
    given = np.zeros((height, width), np.uint8) if part_labels is None else _read_labels(part_labels, rgba)
    size, origin = (width, height), (0, 0)
    if bbox is not None:
        x0, y0, x1, y1 = bbox
        if not (0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height):
            raise FigureError("--bbox", f"{x0} {y0} {x1} {y1} is not inside {width}×{height} px", "give X0 Y0 X1 Y1")
        window = np.s_[y0:y1, x0:x1]
        rgba, given, origin = rgba[window], given[window], (x0, y0)
        silhouette = None if silhouette is None else silhouette[window]
        joints = joints - np.array([x0, y0], np.float32)
        height, width = rgba.shape[:2]
    if silhouette is not None and not silhouette.any():
        where = mask if mask is not None else path
        raise FigureError(where, "the silhouette is empty", "the figure must be opaque, or bright in --mask")
    confidence, parts = None, given
    if silhouette is None or keypoints is None or (labels and part_labels is None):
        found = _inferred(path, rgba, silhouette)
        silhouette = found.mask if silhouette is None else silhouette
        if keypoints is None:
            joints, visible, confidence = found.joints_px, found.visible, found.confidence
        if part_labels is None:
            parts = found.part_labels
    low, high = -JOINT_SLACK_PX, np.array([width, height]) + JOINT_SLACK_PX
    outside = ((joints < low) | (joints > high)).any(axis=1)
    if outside.any():
        index = int(np.argmax(outside))
        x, y = joints[index]
        said = f"{JOINT_NAMES[index]} at ({x:g}, {y:g}) is outside the picture of {width}×{height} px"
        where = keypoints if keypoints is not None else path
        raise FigureError(where, said, "move it inside, or pass the joints that belong to this picture")
    figure = Figure(
        name=name or path.stem,
        rgba=rgba,
        mask=silhouette,
        joints_px=np.clip(joints, 0, [width, height]),
        visible=visible,
        part_labels=np.where(silhouette, given, 0),
    )
    return Reading(figure, origin, size, parts, confidence)


def _open(path: Path, what: str) -> Image.Image:
    """Open and decode a picture, or say in one line why not."""
    try:
        with warnings.catch_warnings():
            # The limit below is ours and explicit; Pillow's warning would only repeat it.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(path)
            if image.width * image.height > MAX_PIXELS:
                found = f"{image.width}×{image.height} px is more than {MAX_PIXELS / 1e6:.0f} Mpx"
                raise FigureError(path, found, "cut the figure out of the sheet first")
            image.load()
            ImageOps.exif_transpose(image, in_place=True)
            return image
    except FigureError:
        raise
    except Image.DecompressionBombError:
        raise FigureError(path, f"more than {MAX_PIXELS / 1e6:.0f} Mpx", "cut the figure out first") from None
    except UnidentifiedImageError:
        raise FigureError(path, "not a picture that can be read", f"give a PNG, JPEG, TIFF or WebP as {what}") from None
    except FileNotFoundError:
        raise FigureError(path, "no such file", f"check the path of the {what}") from None
    except Exception as error:
        # Decoders raise whatever their format's parser raises; each of these means that the file is damaged.
        reason = getattr(error, "strerror", None) or str(error).split("\n")[0][:100] or type(error).__name__
        raise FigureError(path, f"cannot be read ({reason})", f"give an intact picture as {what}") from None


def read_picture(path: Path) -> ByteArray:
    """(H, W, 4) uint8 a picture; `FigureError` where it cannot be read."""
    image = _open(path, "figure")
    if image.mode.startswith(("I", "F")):
        # 16-bit and float greys: Pillow's own conversion clips instead of scaling.
        values = np.asarray(image, np.float64)
        top = 65535.0 if values.max() > 255 else 255.0
        image = Image.fromarray(np.clip(values / top * 255.0, 0, 255).astype(np.uint8))
    # In bands, as Pillow would keep two more copies of the whole picture meanwhile.
    width, height = image.size
    rgba = np.empty((height, width, 4), np.uint8)
    for top in range(0, height, BAND_PX):
        bottom = min(top + BAND_PX, height)
        rgba[top:bottom] = np.asarray(image.crop((0, top, width, bottom)).convert("RGBA"))
    return rgba


def _inferred(path: Path, rgba: ByteArray, silhouette: BoolArray | None) -> Inference:
    """What the figure parser finds in a picture; what it doubts is said."""
    # torch takes seconds to load: only pictures without mask or joints pay for it.
    from fig2mesh.parse.infer import REMEDY, infer_figure

    found = infer_figure(on_white(rgba), silhouette)
    if found is None:
        raise FigureError(path, "no figure is found in it", "pass --bbox round the figure, or --mask and --keypoints")
    if found.doubts:
        log.warning("%s: %s; %s", path, "; ".join(found.doubts), REMEDY)
    return found


def on_white(rgba: ByteArray) -> ByteArray:
    """(H, W, 3) the picture as a viewer shows it on white paper."""
    if (rgba[..., 3] == 255).all():
        return np.ascontiguousarray(rgba[..., :3])
    alpha = rgba[..., 3:].astype(np.float32) / 255
    return np.rint(rgba[..., :3] * alpha + 255 * (1 - alpha)).astype(np.uint8)


def _silhouette(path: Path | None, rgba: ByteArray) -> BoolArray | None:
    """The mask of a file, or of the alpha channel; None where there is neither."""
    if path is None:
        return None if (rgba[..., 3] >= 128).all() else np.asarray(rgba[..., 3] >= 128)
    return read_mask(path, rgba)


def read_mask(path: Path, rgba: ByteArray) -> BoolArray:
    """(H, W) bool, the mask in a file for a picture (H, W, 4)."""
    height, width = rgba.shape[:2]
    values = read_picture(path)
    if values.shape[:2] != (height, width):
        found = f"{values.shape[1]}×{values.shape[0]} px, but the figure has {width}×{height}"
        raise FigureError(path, found, "pass a mask of the figure's size")
    if (values[..., 3] < 255).any():
        return values[..., 3] >= 128
    grey = values[..., :3].max(axis=2)
    # Masks also come as 0/1 pictures.
    return np.asarray(grey >= (128 if grey.max() > 1 else 1))


def _read_labels(path: Path, rgba: ByteArray) -> ByteArray:
    image = _open(path, "part labels")
    if image.mode not in ("L", "P"):
        raise FigureError(path, f"mode {image.mode}", "give an 8-bit single-channel or palette picture of labels")
    labels = np.asarray(image, np.uint8)
    if labels.shape != rgba.shape[:2]:
        found = f"{labels.shape[1]}×{labels.shape[0]} px, but the figure has {rgba.shape[1]}×{rgba.shape[0]}"
        raise FigureError(path, found, "pass part labels of the figure's size")
    if labels.max() >= len(PART_NAMES):
        raise FigureError(path, f"label {labels.max()}", f"use 0 to {len(PART_NAMES) - 1}")
    return labels
