"""Anisotropic diffusion of fixed values over a region of a raster: each free pixel is a weighted mean of its neighbours.

Weights are never negative, so that values lie between those that are fixed (maximum principle). Where the edge of the
region is not fixed nothing flows across it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse.linalg import splu

MAX_STEPS: Final = 8
"""Largest number of steps of Selling's algorithm; it needs about as many as the anisotropy."""

ISOTROPIC: Final = 1e-3
"""Weight of the diffusion in all directions that is added, so that no pixel is cut off by rounding."""

PULL: Final = 1e-7
"""Weight of each free pixel's nearest fixed value: it decides in pieces of the region without any."""


def diffused(
    region: NDArray[np.bool_],
    fixed: NDArray[np.bool_],
    values: NDArray[np.float64],
    axis: NDArray[np.float64] | None = None,
    anisotropy: float = 1.0,
    apart: NDArray[np.int_] | None = None,
) -> NDArray[np.float64]:
    """(H, W, C) values that diffuse from the fixed pixels over the region; elsewhere as given.

    Parameters
    ----------
    fixed : (H, W) bool; values : (H, W, C), those of free pixels do not count
    axis : (H, W, 2) row and column of a direction across which values diffuse faster, no longer than 1; shorter ones
        are less so
    anisotropy : ratio of distances along and across the axis at which values have the same weight
    apart : (H, W) number; nothing flows between pixels of different numbers
    """
    fixed = fixed & region
    free = region & ~fixed
    if not free.any() or not fixed.any():
        return values
    number = np.full(region.shape, -1)
    number[region] = np.arange(int(region.sum()))
    first, second, weight = _edges(region, number, _tensor(region, axis, anisotropy), apart)
    _, nearest = ndimage.distance_transform_edt(~fixed, return_indices=True)
    known = values[region].astype(np.float64)
    is_free = free[region]
    count = len(known)
    matrix = sparse.coo_matrix((weight, (first, second)), (count, count)).tocsr()
    matrix = matrix + matrix.T
    total = np.asarray(matrix.sum(axis=1)).ravel() + PULL
    inner = (sparse.diags(total) - matrix)[is_free][:, is_free].tocsc()
    right = matrix[is_free][:, ~is_free] @ known[~is_free] + PULL * values[tuple(nearest)][region][is_free]
    factors = splu(inner, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    known[is_free] = factors.solve(right)
    result = values.astype(np.float64).copy()
    result[region] = known
    return result


def _tensor(
    region: NDArray[np.bool_], axis: NDArray[np.float64] | None, anisotropy: float
) -> tuple[NDArray[np.float64], ...]:
    """Diffusion tensors (rr, rc, cc) of the region's pixels."""
    count = int(region.sum())
    if axis is None or anisotropy <= 1.0:
        return np.ones(count), np.zeros(count), np.ones(count)
    row, column = axis[region].T
    less = 1.0 - anisotropy**-2
    return 1.0 - less * row * row, -less * row * column, 1.0 - less * column * column


def _edges(
    region: NDArray[np.bool_],
    number: NDArray[np.int_],
    tensor: tuple[NDArray[np.float64], ...],
    apart: NDArray[np.int_] | None,
) -> tuple[NDArray[np.int_], NDArray[np.int_], NDArray[np.float64]]:
    """Pairs of pixels, by number, and their weights: Selling's decomposition of the tensors into whole offsets."""
    a, b, c = tensor
    rows, columns = np.nonzero(region)
    base = np.empty((3, len(rows), 2), int)
    base[0], base[1], base[2] = (1, 0), (0, 1), (-1, -1)

    def product(i: int, j: int) -> NDArray[np.float64]:
        u, v = base[i], base[j]
        return np.asarray(
            a * u[:, 0] * v[:, 0] + b * (u[:, 0] * v[:, 1] + u[:, 1] * v[:, 0]) + c * u[:, 1] * v[:, 1]
        )

    for _ in range(MAX_STEPS):
        changed = False
        for i, j, k in ((0, 1, 2), (0, 2, 1), (1, 2, 0)):
            acute = product(i, j) > 1e-12
            if acute.any():
                changed = True
                u, v = base[i][acute], base[j][acute]
                base[i][acute], base[j][acute], base[k][acute] = -u, v, u - v
        if not changed:
            break
    height, width = region.shape
    pairs: list[NDArray[np.int_]] = []
    weights: list[NDArray[np.float64]] = []

    def add(offset: NDArray[np.int_], weight: NDArray[np.float64]) -> None:
        row, column = rows + offset[:, 0], columns + offset[:, 1]
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width) & (weight > 0)
        inside[inside] = region[row[inside], column[inside]]
        if apart is not None:
            inside[inside] &= apart[rows[inside], columns[inside]] == apart[row[inside], column[inside]]
        pairs.append(np.stack([number[rows[inside], columns[inside]], number[row[inside], column[inside]]]))
        weights.append(weight[inside])

    for i, j, k in ((0, 1, 2), (0, 2, 1), (1, 2, 0)):
        # The conjugate of the third vector is at right angles to it.
        third = base[k]
        offset = np.stack([-third[:, 1], third[:, 0]], axis=1)
        weight = np.maximum(-product(i, j), 0.0)
        add(offset, weight)
    for step in ((1, 0), (0, 1)):
        add(np.broadcast_to(np.array(step), (len(rows), 2)), np.full(len(rows), ISOTROPIC))
    first, second = np.concatenate(pairs, axis=1)
    return first, second, np.concatenate(weights)
