"""Areas of a drawing and the layers that they belong to.

The skeleton splits a silhouette only roughly: slivers of a sleeve lie on the trunk's side of the cut, and of a hand on
the hip's. An area of one material with lines around it belongs to the layer that has most of it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

MIN_SHARE: Final = 0.6
"""Least share of an area in one layer for slivers in others to be that layer's."""

MAX_SHARE: Final = 0.35
"""Largest share of an area that is a sliver."""

MAX_SLIVER: Final = 0.03
"""Largest half width of a sliver, FIGURE units."""

MAX_BESIDE: Final = 0.06
"""The same for pieces beside a limb's bone: what belongs to a limb lies on it."""


def slivers(
    layer: NDArray[np.int_],
    index: NDArray[np.int_],
    ink: NDArray[np.bool_],
    bones: NDArray[np.bool_],
    pitch: float,
) -> NDArray[np.bool_]:
    """(h, w) bool: pixels shown as one layer's that are slivers of another's areas.

    Parameters
    ----------
    layer : (h, w) number of the layer that each pixel is attributed to, from 0; -1 outside
    index : (h, w) material of each pixel; ink : (h, w) bool, lines
    bones : (h, w) bool, near the bone of a limb that is a layer; pitch : FIGURE units per pixel
    """
    clear = (layer >= 0) & ~ink
    areas = np.zeros(layer.shape, int)
    last = 0
    for k in np.unique(index[clear]):
        found, count = ndimage.label(clear & (index == k))
        areas = np.where(found > 0, found + last, areas)
        last += count
    number = int(layer.max()) + 1
    if number < 2 or not last:
        return np.zeros(layer.shape, bool)
    table = np.bincount(areas[clear] * number + layer[clear], minlength=(last + 1) * number).reshape(-1, number)
    share = table / np.maximum(table.sum(axis=1, keepdims=True), 1)
    main = share.argmax(axis=1)
    result = np.zeros(layer.shape, bool)
    for own in range(number):
        minor = (share[:, own] > 0) & (share[:, own] < MAX_SHARE) & (main != own) & (share.max(axis=1) >= MIN_SHARE)
        pieces, count = ndimage.label(clear & (layer == own) & minor[areas])
        if count:
            numbers = np.arange(count + 1)
            wide = np.asarray(ndimage.maximum(ndimage.distance_transform_edt(pieces > 0), pieces, numbers)) * pitch
            on_bone = np.asarray(ndimage.maximum(bones, pieces, numbers)) > 0
            is_limb = bool((bones & (layer == own)).any())
            thin = wide <= np.where(is_limb & ~on_bone, MAX_BESIDE, MAX_SLIVER)
            thin[0] = False
            result |= thin[pieces]
    return result
