"""Grids of a body laid out for the kernels: one flat array of values and a few numbers for each grid."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.compiled import sealed
from fig2mesh.field.distance import negative_bounds
from fig2mesh.records import PartSdf


class Grids(NamedTuple):
    """G grids; a named tuple, because that is what a compiled kernel can take as one argument.

    values : (sum n^3,) float32, FIGURE units, all grids one after the other, each in order [x, y, z]
    starts : (G,) int64, start of each grid's values
    sizes : (G,) int64, nodes along an edge
    origins : (G, 3) float64, FIGURE, position of node (0, 0, 0)
    spacings : (G,) float64, FIGURE units
    boxes : (G, 2, 3) float64, FIGURE, bounding box of the negative region, a little enlarged; (inf, -inf) if none
    owners : (G, 2) int64, the part a grid belongs to, twice; for a blend the two parts that it joins
    """

    values: NDArray[np.float32]
    starts: NDArray[np.int64]
    sizes: NDArray[np.int64]
    origins: NDArray[np.float64]
    spacings: NDArray[np.float64]
    boxes: NDArray[np.float64]
    owners: NDArray[np.int64]


_BOX_MARGIN = 1e-3
"""Cells added around the negative region, so that rounding cannot put the surface on the box itself."""


def pack(grids: Sequence[PartSdf], owners: Sequence[tuple[int, int]]) -> Grids:
    """Lay out `grids`, each belonging to the one or two parts of `owners`."""
    count = len(grids)
    sizes = np.array([grid.grid.shape[0] for grid in grids], np.int64).reshape(count)
    ends = np.cumsum(sizes**3)
    origins, boxes = np.zeros((count, 3)), np.zeros((count, 2, 3))
    for i, grid in enumerate(grids):
        # not grid.origin: in float32 it is off by up to 1e-7, which two grids of one field would show as a step
        origins[i] = grid.centre.astype(np.float64) - float(grid.edge) / 2
        box = negative_bounds(grid.grid)
        boxes[i] = (np.inf,), (-np.inf,)
        if box is None:
            continue
        inside = np.clip([box[0] - _BOX_MARGIN, box[1] + _BOX_MARGIN], 0, sizes[i] - 1)
        boxes[i] = origins[i] + inside * grid.spacing
    values = np.concatenate([grid.grid.ravel() for grid in grids]) if count else np.zeros(0, np.float32)
    fields: list[tuple[Any, Any]] = [
        (values, np.float32),
        (ends - sizes**3, np.int64),
        (sizes, np.int64),
        (origins, np.float64),
        ([grid.spacing for grid in grids], np.float64),
        (boxes, np.float64),
        (np.reshape(np.array(owners, np.int64), (count, 2)), np.int64),
    ]
    return Grids(*(sealed(array, dtype) for array, dtype in fields))
