"""A drawing without the line along its rim, for surfaces that are seen at a slant: there it would be a broad band."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from fig2mesh.image_frame import ImageFrame
from fig2mesh.texture.contour import DrawnLine

SOFT_PX: Final = 1.5
"""Width of a line's soft edge, pixels."""

UNLIKE: Final = 0.35
"""Share of the difference between a line and what lies beside it, up to which a pixel belongs to the line."""

REACH: Final = 1.6
"""Distance from the rim up to which its line is looked for, relative to its width there."""

MAX_FILL: Final = 2.5
"""Largest distance of the colour that replaces the line, relative to its width: thin things are ink all through, and
keep it."""

OUTSIDE: Final = 0.25
"""Share of a line's width on the other side of the rim: where limbs overlap, the rim runs along the line's middle."""


def without_line(
    picture: NDArray[np.float32],
    mask: NDArray[np.bool_],
    frame: ImageFrame,
    points: NDArray[np.float64],
    line: DrawnLine,
) -> NDArray[np.float32]:
    """(H, W, 3) picture in which the line along the rim has the colours beside it; the picture itself without a line.

    picture : (H, W, 3) sRGB 0-255, its colours continued beyond the silhouette; mask : (H, W) bool, the silhouette
    points : (N, 2 or 3) of the rim, FIGURE
    """
    drawn = np.isfinite(line.width) & (line.width > 0)
    if not drawn.any():
        return picture
    places = frame.image_from_figure(points[drawn])
    width = line.width[drawn] / frame.units_per_px
    reach = REACH * float(width.max()) + SOFT_PX
    # Only pixels near the rim are looked at.
    near = np.zeros(mask.shape, bool)
    at = np.clip(np.floor(places[:, ::-1]).astype(int), 0, np.array(mask.shape) - 1)
    near[tuple(at.T)] = True
    near = ndimage.distance_transform_edt(~near) <= reach + 1.0
    rows, columns = np.nonzero(near & mask)
    distance, index = cKDTree(places).query(np.stack([columns + 0.5, rows + 0.5], axis=1))
    pen, local = line.color[drawn][index], width[index]
    apart = np.linalg.norm(picture[rows, columns] - pen, axis=1)
    dark = apart < 110.0
    inked = np.zeros(mask.shape, bool)
    chosen = dark & (distance <= np.maximum(REACH * local, local + SOFT_PX))
    inked[rows[chosen], columns[chosen]] = True
    # Soft edges beside the line are mixed with its colour.
    inked |= near & mask & ndimage.binary_dilation(inked, iterations=1)
    away, source = ndimage.distance_transform_edt(inked | ~mask, return_indices=True)
    limit = np.zeros(mask.shape)
    limit[rows, columns] = MAX_FILL * local + SOFT_PX
    outside = ~mask & (away <= reach)
    replaced = (inked & (away <= limit)) | outside
    return np.where(replaced[..., None], picture[tuple(source)], picture).astype(np.float32)
