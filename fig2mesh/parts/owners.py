"""Assignment of each pixel of a silhouette to a layer: the core of the body, or a limb in front of or behind it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.limbs import Limb
from fig2mesh.skeleton import PART

MIN_OWN_SHARE = 0.3
"""A piece cut off from its layer stays with it if at least this share of the piece lies along the layer's bones."""

MIN_ISLAND = 0.01
"""And if the piece has at least this share of the silhouette."""


def owners(
    canvas: Canvas,
    core_excess: NDArray[np.float64],
    layered: list[Limb],
    points: NDArray[np.float64],
) -> NDArray[np.int64]:
    """(H, W) layer that the drawing shows at each pixel: 0 core, 1.. layered limbs, -1 outside.

    core_excess : (H, W) signed distance to the bones of the core, less their radius
    """
    inside = canvas.inside
    owner = np.full(inside.shape, -2)
    costs = [core_excess]
    for index, limb in enumerate(layered, start=1):
        excess, nearest = limb.excess(points)
        mine = inside & (excess < 0.25 * limb.radius[nearest])
        # A hidden limb lies behind: the drawing shows the core there.
        shown = limb.seen[nearest] | (core_excess > 0)
        better = np.ones(inside.shape, bool)
        for rival in range(1, index):
            better &= (owner != rival) | (excess < costs[rival])
        owner[mine & shown & better] = index
        costs.append(excess)
    owner[inside & (owner == -2) & (core_excess < 0)] = 0
    owner[~inside] = -1
    given = canvas.labels
    for label in np.unique(given[inside]):
        index = next((i for i, limb in enumerate(layered, start=1) if label in limb.part), 0)
        # Hair, cloth and held things stay with the layer that the skeleton finds for them.
        if 0 < label < PART["hair"]:
            owner[inside & (given == label)] = index
    _give_leftovers(owner, np.stack(costs))
    _rejoin_islands(owner, np.stack(costs))
    return owner


def _give_leftovers(owner: NDArray[np.int64], costs: NDArray[np.float64]) -> None:
    """Assign unclaimed pixels (cloth, hair, bags), piece by piece, to the layer with which they share most border."""
    pieces, _ = ndimage.label(owner == -2)
    for index, window in enumerate(ndimage.find_objects(pieces), start=1):
        grown = tuple(slice(max(0, s.start - 1), s.stop + 1) for s in window)
        piece = pieces[grown] == index
        border = ndimage.binary_dilation(piece) & ~piece & (owner[grown] >= 0)
        neighbours = np.bincount(owner[grown][border], minlength=len(costs)) if border.any() else np.zeros(len(costs))
        if neighbours.sum():
            choice = int(np.argmax(neighbours))
            # A large piece that also touches the core is cloth or hair of the body, not of the limb in front of it.
            if piece.sum() > 0.5 * (owner == choice).sum() and neighbours[0] > 0.05 * neighbours.sum():
                choice = 0
        else:
            choice = int(np.argmin(costs[(slice(None), *grown)][:, piece].mean(axis=1)))
        owner[grown][piece] = choice


def _rejoin_islands(owner: NDArray[np.int64], costs: NDArray[np.float64]) -> None:
    """Assign pixels cut off from their own layer to the layer around them: at their own layer's depth they float."""
    for index in range(len(costs)):
        pieces, count = ndimage.label(owner == index, np.ones((3, 3)))
        if count < 2:
            continue
        sizes = np.bincount(pieces.ravel())[1:]
        for piece in np.argsort(sizes)[:-1] + 1:
            here = pieces == piece
            if (costs[index][here] < 0).mean() > MIN_OWN_SHARE and here.sum() > MIN_ISLAND * (owner >= 0).sum():
                # A head beyond the hand in front of its neck; what lies behind the hand joins it to the body.
                continue
            border = ndimage.binary_dilation(here, np.ones((3, 3))) & ~here & (owner >= 0) & (owner != index)
            if border.any():
                owner[here] = np.bincount(owner[border]).argmax()
