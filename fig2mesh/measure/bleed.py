"""Bleeding of the drawing's background onto the model: colours at the rim of its front silhouette."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from exporters.asset import ByteArray, TexturedMesh
from fig2mesh.measure.model import MAX_SIDE_PX, BoolArray, box_of, coarse_point, every_step, front_pixels

RIM_PX = 2.0
"""Width of the rim of the model that is examined."""

BEYOND_PX = 3
"""Pixels this far outside and inside of the drawn contour are background and figure; those between are mixed."""

OPAQUE = 64
"""Alpha threshold for pixels of a cut-out figure whose colour is free of background."""

NEAR_PX = 8
"""Search radius for colours of the figure: contours are thin, and fills begin next to them."""

APART = 60.0
"""Minimum difference (RGB 0-255) by which background and figure can be distinguished."""


def bleed_share(
    mesh: TexturedMesh,
    rgba: ByteArray,
    mask: BoolArray,
    *,
    metres_per_pixel: float,
    origin_px: tuple[float, float],
) -> float:
    """Share of pixels at the rim of the model's front that are nearer to the background's colour than to the figure's.

    Pixels where the two cannot be distinguished count as clean. Arguments as in `measure.front_similarity`.
    """
    if not mask.any():
        return 0.0
    (x0, y0), (x1, y1) = box_of(mask)
    step = -(-max(x1 - x0, y1 - y0) // MAX_SIDE_PX)
    border = (BEYOND_PX + 2) * step
    edges = x0 - border, y0 - border, x1 + border, y1 + border
    inside, picture = every_step(mask, edges, step), every_step(rgba, edges, step)[..., :3].astype(np.float32)
    # Beyond the edge of the picture the background is unknown.
    known = every_step(np.ones(rgba.shape[:2], bool), edges, step)
    size = inside.shape[1], inside.shape[0]
    front = front_pixels(mesh, size, step * metres_per_pixel, coarse_point(origin_px, edges[:2], step), 1, "textured")
    covered = front[..., 3] > 0
    rim = covered & (ndimage.distance_transform_edt(covered) <= RIM_PX)
    outer = known & (ndimage.distance_transform_edt(~inside) >= BEYOND_PX)
    if not rim.any() or not outer.any():
        return 0.0
    alpha = every_step(rgba, edges, step)[..., 3]
    if alpha[outer].mean() < 128:
        # In a cut-out whatever is opaque is figure.
        inner = inside & (alpha >= OPAQUE)
    else:
        inner = ndimage.distance_transform_edt(inside) > BEYOND_PX
    inner = inner if inner.any() else inside
    colour = front[rim][:, :3].astype(np.float32)
    ground = picture[_nearest(outer, rim)]
    own = _min_distance(colour, picture, inner, rim)
    apart = _min_distance(ground, picture, inner, rim) > APART
    return float(((np.linalg.norm(colour - ground, axis=1) < own) & apart).mean())


def _nearest(there: NDArray[np.bool_], at: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices of the nearest pixel of `there` for each pixel of `at`."""
    nearest = ndimage.distance_transform_edt(~there, return_distances=False, return_indices=True)
    return nearest[0][at], nearest[1][at]


def _min_distance(
    colour: NDArray[np.float32], picture: NDArray[np.float32], there: NDArray[np.bool_], at: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """(N,) distance from colours (N, 3) at pixels `at` to the nearest colour of `there` in their neighbourhood."""
    rows, columns = np.nonzero(at)
    best = np.linalg.norm(colour - picture[_nearest(there, at)], axis=1)
    for down in range(-NEAR_PX, NEAR_PX + 1, 2):
        for right in range(-NEAR_PX, NEAR_PX + 1, 2):
            r, c = np.clip(rows + down, 0, at.shape[0] - 1), np.clip(columns + right, 0, at.shape[1] - 1)
            distance = np.linalg.norm(colour - picture[r, c], axis=1)
            best = np.where(there[r, c], np.minimum(best, distance), best)
    return np.asarray(best, np.float32)
