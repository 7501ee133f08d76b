"""A drawing without the line along its rim, for surfaces that are seen at a slant: there it would be a broad band."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from fig2mesh.image_frame import ImageFrame

SOFT_PX: Final = 0.5
"""Distance beyond a line, pixels, from which its colour is removed as well."""

INKY: Final = 110.0
"""Colour tolerance, RGB 0-255, of a line, soft edges included."""

MAX_FILL: Final = 2.5
"""Largest distance of the colour that replaces the line, relative to its width: thin things are ink all through, and
keep it."""


def without_line(
    picture: NDArray[np.float32],
    mask: NDArray[np.bool_],
    frame: ImageFrame,
    points: NDArray[np.float64],
    width: NDArray[np.float64],
    color: NDArray[np.float64],
    margin_px: int = 0,
) -> NDArray[np.uint8]:
    """(H, W, 3) sRGB, a picture in which the line along the rim has the colours beside it.

    Parameters
    ----------
    picture : (H, W, 3) sRGB 0-255, its colours continued beyond the silhouette; mask : (H, W) bool, the silhouette
    points : (N, 2 or 3) of the rim, FIGURE
    width, color : (N,) FIGURE units and (N, 3) sRGB 0-255 of the line that is taken off; 0 where it stays
    margin_px : width of the soft edge that is taken off with it, pixels
    """
    drawn = width > 0
    if not drawn.any():
        return np.asarray(np.clip(np.round(picture), 0, 255), np.uint8)
    places = frame.image_from_figure(points[drawn])
    local_px = width[drawn] / frame.units_per_px
    reach = float(local_px.max()) + SOFT_PX
    # Only pixels near the rim are looked at.
    near = np.ones(mask.shape, bool)
    at = np.clip(np.floor(places[:, ::-1]).astype(int), 0, np.array(mask.shape) - 1)
    near[tuple(at.T)] = False
    near = ndimage.distance_transform_edt(near) <= reach + 1.0
    rows, columns = np.nonzero(near & mask)
    distance, index = cKDTree(places).query(np.stack([columns + 0.5, rows + 0.5], axis=1))
    local = local_px[index]
    inked = np.zeros(mask.shape, bool)
    dark = np.linalg.norm(picture[rows, columns] - color[drawn][index], axis=1) < INKY
    chosen = dark & (distance <= local + SOFT_PX)
    inked[rows[chosen], columns[chosen]] = True
    if margin_px:
        inked = ndimage.binary_dilation(inked, iterations=margin_px) & mask
    away, source = ndimage.distance_transform_edt(inked | ~mask, return_indices=True)
    limit = np.full(mask.shape, SOFT_PX + margin_px)
    limit[rows, columns] = MAX_FILL * local + SOFT_PX + margin_px
    replaced = (inked & (away <= limit)) | (~mask & (away <= reach))
    result = np.where(replaced[..., None], picture[tuple(source)], picture)
    return np.asarray(np.clip(np.round(result), 0, 255), np.uint8)
