"""Depth of the middle of each layer: interpolated from the bones, limbs in front of what they cross."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.limbs import Limb

STRIDE = 5
"""Stride of interpolation, pixels: depth varies slowly."""

REST = 0.35
"""A limb's axis keeps this share of its radius clear of the surface it rests on; the rest of it sinks in, so that
what touches in the drawing is joined in space."""

SOFTNESS = 0.03
"""Distance within which a bone's depth applies, FIGURE units; also the standard deviation of the smoothing after it."""


def mid_surface(canvas: Canvas, points: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """(H, W) depth interpolated from points on the bones.

    Parameters
    ----------
    points : (N, 2) FIGURE x, y
    depth : (N,) FIGURE z
    """
    height, width = canvas.sdf.shape
    if np.ptp(depth) < 1e-6:
        return np.full((height, width), float(depth[0]))
    coarse = canvas.points()[::STRIDE, ::STRIDE]
    distance2 = ((coarse[..., None, :] - points) ** 2).sum(axis=-1)
    weight = (distance2 + SOFTNESS**2) ** -2.0
    values = (weight * depth).sum(axis=-1) / weight.sum(axis=-1)
    values = ndimage.gaussian_filter(values, SOFTNESS / (STRIDE * canvas.pitch), mode="nearest")
    rows, columns = np.arange(height) / STRIDE, np.arange(width) / STRIDE
    grid = np.meshgrid(rows, columns, indexing="ij")
    fine = ndimage.map_coordinates(values, grid, order=3, mode="nearest")
    return np.asarray(fine)


def place_limb(
    limb: Limb, canvas: Canvas, top: NDArray[np.float64], bottom: NDArray[np.float64], *, behind: bool = False
) -> Limb:
    """Bring a limb in front of (or behind) the surfaces that it crosses.

    Parameters
    ----------
    top, bottom : (H, W) FIGURE z of the layers placed so far, NaN elsewhere
    behind : put the hidden bones of the limb behind instead of in front
    """
    nearest = np.round(canvas.pixels(limb.points)).astype(int)
    rows = np.clip(nearest[:, 0], 0, top.shape[0] - 1)
    columns = np.clip(nearest[:, 1], 0, top.shape[1] - 1)
    there = np.isfinite(top[rows, columns])
    # A limb grows out of the body at its root: there it stays in the middle of it.
    start = 0.5 if limb.is_arm else 1.5
    ramp = np.clip((limb.along / limb.radius[0] - start) / 2.0, 0.0, 1.0)
    ramp = ramp * ramp * (3.0 - 2.0 * ramp)
    front = np.maximum(limb.depth, ramp * (top[rows, columns] + REST * limb.radius))
    back = np.minimum(limb.depth, ramp * (bottom[rows, columns] - REST * limb.radius))
    wanted = np.where(limb.seen | (not behind), front, back)
    depth = np.where(there, wanted, limb.depth)
    return replace(limb, depth=ndimage.gaussian_filter1d(depth, 2.0, mode="nearest"))
