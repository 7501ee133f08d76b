"""Pictures of the sides that the drawing hides, and the colours that points of the surface have in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.field.camera import VIEW_YAW_DEG, axes
from fig2mesh.texture.sides import Sides

UNSEEN: Final = (1, 2, 3)
"""Left, back, right."""

BEFORE: Final = 0.02
"""A side sees a point that is at most this far behind what its pixel shows, FIGURE units."""

SHARPNESS: Final = 3
"""Power of the cosine between normal and direction of the side by which sides are weighted: one side rules."""

LEAST_COSINE: Final = 0.1


@dataclass(frozen=True)
class ViewTextures:
    """sides : where the pictures are from; pictures : (4, H, W, 3) float32, 0-255, front, left, back, right, colours
    carried on beyond the silhouette."""

    sides: Sides
    pictures: NDArray[np.float32]

    def at(
        self, points: NDArray[np.floating], normals: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(N, 3) colours of points (N, 3) in the unseen sides that see them, and (N,) sums of weights, 0 for none.

        normals : (N, 3) of unit length
        """
        total = np.zeros(len(points))
        colour = np.zeros((len(points), 3))
        for side in UNSEEN:
            cosine = np.asarray(normals @ axes(list(VIEW_YAW_DEG.values())[side])[2], np.float64)
            facing = np.flatnonzero(cosine > LEAST_COSINE)
            pixels, depth = self.sides.project(points[facing], side)
            where = np.moveaxis(pixels[:, ::-1] - 0.5, -1, 0)
            # The nearest of the pixels round about: at a step of depth the point may be on either of its sides.
            shown = ndimage.grey_dilation(np.where(np.isfinite(d := self.sides.depth[side]), d, -1e3), (3, 3))
            hidden = ndimage.grey_erosion(np.where(np.isfinite(d), d, 1e3), (3, 3))
            low, high = (ndimage.map_coordinates(image, where, order=0, mode="nearest") for image in (hidden, shown))
            seen = (depth > low - BEFORE) & (depth < high + BEFORE)
            weight = np.where(seen, cosine[facing] ** SHARPNESS, 0.0)
            for channel in range(3):
                values = ndimage.map_coordinates(self.pictures[side, ..., channel], where, order=1, mode="nearest")
                colour[facing, channel] += weight * values
            total[facing] += weight
        return np.asarray(colour / np.maximum(total, 1e-9)[:, None]), total


def carried_on(pictures: NDArray[np.float32], labels: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Pictures (4, H, W, 3) whose rim, where the pixel mixes figure and nothing, has the colours a pixel further in."""
    result = pictures.copy()
    for side, picture in enumerate(pictures):
        inner = ndimage.binary_erosion(labels[side] > 0)
        if inner.any():
            nearest = ndimage.distance_transform_edt(~inner, return_distances=False, return_indices=True)
            result[side] = picture[tuple(nearest)]
    return result


def snapped(colours: NDArray[np.floating], palette: NDArray[np.floating]) -> NDArray[np.float64]:
    """(N, 3) the palette's colours nearest to colours (N, 3): a drawing has few, and networks mix them."""
    from scipy.spatial import cKDTree

    _, index = cKDTree(palette).query(np.asarray(colours, np.float64))
    return np.asarray(np.asarray(palette, np.float64)[index])
