"""Lobes of a head's outline: brims, ears, buns, pony-tails, plumes; what an opening of the outline leaves out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.canvas import Canvas, raster_distance
from fig2mesh.parts.distances import closing
from fig2mesh.parts.heads.frame import HeadFrame
from fig2mesh.parts.inflate import inflate
from fig2mesh.parts.rim import RIM_BLUR

OPENING = 0.45
"""Largest half width of a lobe, radii of the head."""

NOOK = 0.045
"""Half width of the nooks of a head's outline that are left out of its depth, FIGURE units."""

AGREEING = 2.5
"""Distance between the rims of the bulk and of the drawing within which they are the same, pixels."""

EIGHT = np.ones((3, 3))


@dataclass(frozen=True)
class Bulk:
    """Head without its lobes.

    distance : (H, W) signed distance to its rim, FIGURE units
    filled : (H, W) the same with its nooks filled
    lobes : (H, W) int, number of the lobe of each pixel, 0 elsewhere
    """

    distance: NDArray[np.float64]
    filled: NDArray[np.float64]
    lobes: NDArray[np.int32]

    @property
    def share(self) -> NDArray[np.float64]:
        """(H, W) 0 at the rim, 1 from where the nooks no longer matter."""
        ratio = np.clip(self.distance / np.minimum(self.filled, -1e-9), 0.0, 1.0)
        return np.asarray(np.where(self.distance < 0, 1.0 - (1.0 - ratio) ** 3, 0.0))


def find_bulk(
    canvas: Canvas,
    frame: HeadFrame,
    region: NDArray[np.bool_],
    head: NDArray[np.bool_],
    brim: NDArray[np.bool_],
    rim: NDArray[np.float64],
) -> Bulk | None:
    """Bulk of a head; None where the head is as thin as a lobe.

    region : (H, W) bool, the layer with the head; head : its pixels that belong to the head; brim : those of the brim
    that stick out; rim : (H, W) signed distance to the layer's rim
    """
    pitch = canvas.pitch
    radius = OPENING * frame.radius / pitch
    core = ndimage.distance_transform_edt(np.pad(region & ~brim, 1))[1:-1, 1:-1] > radius
    if not (core & head).any():
        return None
    opened = raster_distance(core) - radius
    own = ndimage.gaussian_filter(opened, RIM_BLUR / pitch) * pitch
    beyond = np.clip((own - rim) / (AGREEING * pitch) - 1.0, 0.0, 1.0)
    distance = np.maximum(rim + beyond * (own - rim), rim)
    filled = closing(distance < 0, NOOK / pitch)
    outer = np.minimum(distance, ndimage.gaussian_filter(raster_distance(filled), RIM_BLUR / pitch) * pitch)
    lobes, _ = ndimage.label(region & (distance >= 0) & head & ~brim, EIGHT)
    return Bulk(distance, outer, lobes)


def raise_lobes(
    canvas: Canvas, region: NDArray[np.bool_], lobes: NDArray[np.bool_], rim: NDArray[np.float64], device: str
) -> NDArray[np.float64]:
    """(H, W) squared half thickness of lobes, as deep as they are wide, FIGURE units²; they continue in the bulk."""
    pitch = canvas.pitch
    if not lobes.any():
        return np.zeros(region.shape)
    depth = ndimage.distance_transform_edt(region) * lobes
    away, nearest = ndimage.distance_transform_edt(~lobes, return_indices=True)
    numbered, count = ndimage.label(lobes, EIGHT)
    widest = np.concatenate([[0.0], ndimage.maximum(depth, numbered, np.arange(1, count + 1))])
    grown = region & (away <= widest[numbered[tuple(nearest)]] + 1.0)
    # Outside the silhouette it is continued, so that its smoothed rim does not touch the drawn one.
    _, nearest = ndimage.distance_transform_edt(~region, return_indices=True)
    own = ndimage.gaussian_filter(raster_distance(grown[tuple(nearest)]), RIM_BLUR / pitch) * pitch
    distance = np.maximum(rim, own)
    return inflate(distance < 0, np.full(region.shape, 2.0), device, distance) * pitch**2
