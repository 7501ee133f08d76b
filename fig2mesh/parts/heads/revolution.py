"""Solids of revolution: outlines that are as deep as they are wide at each height along an axis.

The equation −u_ss − ε u_tt = 2 (1 + ε) across (s) and along (t) the axis, u = 0 on the rim, gives u = w² − s² where the
half width w changes slowly, and a sphere for a disc; the small ε rounds the edges of flat ends, and steps of the
outline do not become grooves. On a raster that is finer along the axis it is the equation of `inflate`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.heads.frame import HeadFrame
from fig2mesh.parts.inflate import inflate

FINER = 2.0
"""Ratio of the raster's spacings across and along the axis: ε is one over its square."""


def revolve(
    canvas: Canvas,
    frame: HeadFrame,
    distance: NDArray[np.float64],
    heights: tuple[float, float],
    device: str,
    finer: float = FINER,
) -> NDArray[np.float64]:
    """(H, W) squared half thickness of the solid of revolution with an outline, FIGURE units².

    distance : (H, W) signed distance to the outline, FIGURE units
    heights : the lowest and the highest on the axis; beyond them it continues as wide as it is there
    """
    across, along = frame.coordinates(canvas.points())
    own = (distance < 0) & (along > heights[0]) & (along < heights[1])
    if not own.any():
        return np.zeros(distance.shape)
    pitch, margin = canvas.pitch, 3.0 * canvas.pitch
    left, right = across[own].min() - margin, across[own].max() + margin
    further = 0.5 * (right - left)
    low, high = (
        value + sign * (further if np.isfinite(bound) else margin)
        for value, bound, sign in ((along[own].min(), heights[0], -1.0), (along[own].max(), heights[1], 1.0))
    )
    step = pitch / finer
    s, t = np.arange(left, right, pitch), np.arange(low, high, step)
    places = frame.points(*np.meshgrid(s, np.clip(t, max(heights[0], low), min(heights[1], high))))
    rim = canvas.sample(distance, places)
    u = inflate(rim < 0, np.full(rim.shape, 2.0 * (1.0 + finer**-2)), device, rim) * pitch**2
    where = np.stack([(along - low) / step, (across - left) / pitch])
    return np.asarray(ndimage.map_coordinates(u, where, order=1, mode="constant"))
