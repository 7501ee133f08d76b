"""Rims of layers between pixel centres, and what lies beyond them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.canvas import Canvas, raster_distance
from fig2mesh.parts.ends import Ends

RIM_BLUR = 0.012
"""Smoothing of rims inside the silhouette, FIGURE units: the stairs of pixels would become teeth."""

MIN_SLOPE = 0.03
"""Least increase of the squared half thickness from the rim inwards, FIGURE units: it makes strokes thinner than
half of it (strands, fringes) deeper than wide, so that grids and meshes hold it."""

OVERLAP = 0.008
"""Overlap of layers that meet inside the silhouette, FIGURE units."""


def rim_distance(canvas: Canvas, region: NDArray[np.bool_], ends: Ends | None) -> NDArray[np.float64]:
    """(H + extra, W) signed distance to the rim of a layer, FIGURE units, negative inside.

    The drawn contour is known to a fraction of a pixel. Where a layer ends inside the silhouette only pixels are known:
    that rim is smoothed, and reaches a little further, so that layers side by side still overlap.
    """
    extra = 0 if ends is None else ends.extra
    inside, contour = np.pad(canvas.inside, ((0, extra), (0, 0))), canvas.sdf
    region = np.pad(region, ((0, extra), (0, 0)))
    if ends is not None:
        inside, region = inside | ends.beyond, region | ends.beyond
        contour = np.pad(canvas.sdf, ((0, extra), (0, 0)), mode="edge")
        whole = raster_distance(inside) * canvas.pitch
        contour = np.where(np.abs(whole - contour) < 1.5 * canvas.pitch, contour, whole)
    # Outside the silhouette the layer is continued, so that its smoothed rim does not touch the drawn one.
    _, nearest = ndimage.distance_transform_edt(~inside, return_indices=True)
    mine = region[tuple(nearest)]
    if mine.all():
        return contour
    own = ndimage.gaussian_filter(raster_distance(mine), RIM_BLUR / canvas.pitch)
    distance = np.maximum(contour, own * canvas.pitch - OVERLAP)
    # Across a narrow gap the layer would reach into what is drawn on the other side.
    pieces, _ = ndimage.label(distance < 0, np.ones((3, 3)))
    return np.asarray(np.where(np.isin(pieces, pieces[region]), distance, np.abs(distance)))


def extended(distance: NDArray[np.float64], u: NDArray[np.float64], pitch: float) -> NDArray[np.float64]:
    """Continue u below zero outside its rim.

    A circle's u is −(s d + d²) at the signed distance d, where s is the slope at the rim: with it the distance formula
    of `_evaluate` is exact for circular cross-sections.
    """
    inside = distance < 0
    depth = np.where(inside, -distance, 0.0)
    u = np.maximum(u, MIN_SLOPE * depth)
    # Sums before quotients: nearest to the rim both are small.
    slope = ndimage.gaussian_filter(np.where(inside, u + depth**2, 0.0), 1.5)
    slope = slope / np.maximum(ndimage.gaussian_filter(depth, 1.5), 1e-3 * pitch)
    _, rim = ndimage.distance_transform_edt(~inside, return_indices=True)
    slope = ndimage.gaussian_filter(slope[tuple(rim)], 1.5)
    return np.asarray(np.where(inside, u, -(slope * distance + distance**2)))
