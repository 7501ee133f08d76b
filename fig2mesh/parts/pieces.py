"""Connected pieces of a drawing."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from PIL import Image
from scipy import ndimage

from fig2mesh.image_frame import image_frame
from fig2mesh.records import BoolArray, ByteArray, Figure

SPECK = 3.0
"""Least size of a piece in either direction, voxels; smaller ones cannot be distinguished from dirt."""

MARGIN_PX = 4

BAND_PX = 512
"""Rows reduced at a time."""


class CleanFigure(NamedTuple):
    """Figure without specks too small for a grid, the number of pieces kept and of specks dropped."""

    figure: Figure
    pieces: int
    specks: int


def clean(figure: Figure, voxel: float, max_px: int) -> CleanFigure:
    """Drop specks, and crop and reduce the picture to what the stages need.

    Pieces are 8-connected. The largest one is always kept. The picture is cropped to the silhouette and the joints,
    so that nothing that follows depends on how much of a sheet lies around the figure, and reduced to about `max_px`
    pixels on its longer side: scans have far more than a texture can show.
    """
    pieces, _ = ndimage.label(figure.mask, np.ones((3, 3)))
    windows = ndimage.find_objects(pieces)
    areas = [np.count_nonzero(pieces[window] == number) for number, window in enumerate(windows, start=1)]
    extent = np.array([max(s.stop - s.start for s in window) for window in windows])
    kept = extent * image_frame(figure).units_per_px >= SPECK * voxel
    kept[np.argmax(areas)] = True
    mask = figure.mask if kept.all() else np.concatenate([[False], kept])[pieces]
    del pieces  # four bytes per pixel of what may be a whole sheet

    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    low = np.minimum([columns[0], rows[0]], np.floor(figure.joints_px.min(axis=0))) - MARGIN_PX
    high = np.maximum([columns[-1], rows[-1]], np.ceil(figure.joints_px.max(axis=0))) + 1 + MARGIN_PX
    x0, y0 = np.maximum(low, 0).astype(int)
    x1, y1 = np.minimum(high, figure.mask.shape[::-1]).astype(int)
    window = np.s_[y0:y1, x0:x1]
    factor = max(y1 - y0, x1 - x0) // max_px
    joints = figure.joints_px - np.array([x0, y0], np.float32)
    labels = np.where(mask[window], figure.part_labels[window], 0)
    rgba, mask = figure.rgba[window], mask[window]
    if factor > 1:
        rgba, mask, labels = _reduced(rgba, factor), _reduced_mask(mask, factor), _reduced_labels(labels, factor)
        joints = np.minimum(joints / factor, np.array(mask.shape[::-1], np.float32))
        labels = np.where(mask, labels, 0)
    corner = (figure.origin_px[0] + figure.step_px * x0, figure.origin_px[1] + figure.step_px * y0)
    cut = replace(
        figure,
        rgba=rgba,
        mask=mask,
        joints_px=joints,
        part_labels=labels,
        origin_px=corner,
        step_px=figure.step_px * max(factor, 1),
    )
    return CleanFigure(cut, int(kept.sum()), int((~kept).sum()))


def _reduced(rgba: ByteArray, factor: int) -> ByteArray:
    """Reduce by a whole factor, in bands of rows: whole copies of a large scan take gigabytes."""
    band = factor * max(1, BAND_PX // factor)
    rows = []
    for top in range(0, len(rgba), band):
        # With alpha premultiplied, colours of transparent pixels do not bleed into opaque ones.
        picture = Image.fromarray(np.ascontiguousarray(rgba[top : top + band])).convert("RGBa")
        rows.append(np.asarray(picture.reduce(factor).convert("RGBA")))
    return np.concatenate(rows)


def _reduced_mask(mask: BoolArray, factor: int) -> BoolArray:
    """Reduce a mask by majority; where no pixel has one, keep the fullest ones."""
    cover = np.asarray(Image.fromarray(np.where(mask, np.uint8(255), np.uint8(0))).reduce(factor))
    return np.asarray(cover >= min(128, int(cover.max())))


def _reduced_labels(labels: ByteArray, factor: int) -> ByteArray:
    """Reduce labels to those of the pixels in the middle."""
    half, (height, width) = factor // 2, labels.shape
    padded = np.pad(labels, ((0, factor), (0, factor)), mode="edge")
    return padded[half::factor, half::factor][: -(-height // factor), : -(-width // factor)]
