"""The pieces that a drawing consists of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from PIL import Image
from scipy import ndimage

from fig2mesh.parse.frame import image_frame
from fig2mesh.records import Figure

SPECK = 3.0
"""Pieces that are smaller than this many voxels in both directions cannot be told from dirt."""

MARGIN_PX = 4


def clean(figure: Figure, voxel: float, most_px: int) -> tuple[Figure, int, int]:
    """The figure without specks that no grid could hold, the number of pieces kept and of specks dropped.

    Pieces are 8-connected. The largest one is always kept. The picture is cut down to the silhouette and the joints,
    so that nothing that follows depends on how much of a sheet lies around the figure, and reduced to about `most_px`
    pixels on its longer side: scans have far more than a texture can show.
    """
    pieces, count = ndimage.label(figure.mask, np.ones((3, 3)))
    windows = ndimage.find_objects(pieces)
    areas = np.bincount(pieces.ravel(), minlength=count + 1)[1:]
    extent = np.array([max(s.stop - s.start for s in window) for window in windows])
    kept = extent * image_frame(figure).units_per_px >= SPECK * voxel
    kept[np.argmax(areas)] = True
    mask = figure.mask if kept.all() else np.isin(pieces, np.flatnonzero(kept) + 1)

    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    low = np.minimum([columns[0], rows[0]], np.floor(figure.joints_px.min(axis=0))) - MARGIN_PX
    high = np.maximum([columns[-1], rows[-1]], np.ceil(figure.joints_px.max(axis=0))) + 1 + MARGIN_PX
    x0, y0 = np.maximum(low, 0).astype(int)
    x1, y1 = np.minimum(high, figure.mask.shape[::-1]).astype(int)
    window = np.s_[y0:y1, x0:x1]
    trimmed = replace(
        figure,
        rgba=figure.rgba[window],
        mask=mask[window],
        joints_px=figure.joints_px - np.array([x0, y0], np.float32),
        part_labels=np.where(mask[window], figure.part_labels[window], 0),
    )
    return _reduced(trimmed, max(trimmed.mask.shape) // most_px), int(kept.sum()), int((~kept).sum())


def _reduced(figure: Figure, factor: int) -> Figure:
    """The figure with `factor` pixels a side made one; silhouette and labels by their majority and nearest pixel."""
    if factor < 2:
        return figure
    # With alpha premultiplied, colours of transparent pixels do not bleed into opaque ones.
    picture = Image.fromarray(figure.rgba).convert("RGBa").reduce(factor).convert("RGBA")
    cover = np.asarray(Image.fromarray(np.where(figure.mask, np.uint8(255), np.uint8(0))).reduce(factor))
    mask = cover >= min(128, int(cover.max()))
    half = factor // 2
    labels = np.pad(figure.part_labels, ((0, factor), (0, factor)), mode="edge")[half::factor, half::factor]
    return replace(
        figure,
        rgba=np.asarray(picture),
        mask=mask,
        joints_px=np.minimum(figure.joints_px / factor, np.array(mask.shape[::-1], np.float32)),
        part_labels=np.where(mask, labels[: mask.shape[0], : mask.shape[1]], 0),
    )
