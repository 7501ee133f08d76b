"""The pieces that a drawing consists of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import ndimage

from fig2mesh.parse.frame import ImageFrame
from fig2mesh.records import Figure

SPECK = 3.0
"""Pieces smaller than this many voxels across cannot be told from dirt."""


def clean(figure: Figure, frame: ImageFrame, voxel: float) -> tuple[Figure, int, int]:
    """The figure without specks that no grid could hold, the number of pieces kept and of specks dropped.

    Pieces are 8-connected. The largest one is always kept.
    """
    pieces, count = ndimage.label(figure.mask, np.ones((3, 3)))
    areas = np.bincount(pieces.ravel(), minlength=count + 1)[1:] * frame.units_per_px**2
    kept = areas >= (SPECK * voxel) ** 2
    kept[np.argmax(areas)] = True
    if kept.all():
        return figure, count, 0
    mask = np.isin(pieces, np.flatnonzero(kept) + 1)
    labels = np.where(mask, figure.part_labels, 0)
    return replace(figure, mask=mask, part_labels=labels), int(kept.sum()), int((~kept).sum())
