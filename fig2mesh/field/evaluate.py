"""Values, nearest parts and gradients of packed grids at many points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.counters import count
from fig2mesh.field.compiled import run_blocks, sealed
from fig2mesh.field.grid_kernels import evaluate_blocks
from fig2mesh.field.grids import Grids
from fig2mesh.records import IntArray

_BLOCK = 1024


def evaluate(
    grids: Grids, points: Any, *, with_parts: bool = False, with_gradients: bool = False
) -> tuple[NDArray[np.float64], IntArray, NDArray[np.float64]]:
    """Distance (N,), nearest part (N,) and gradient (N, 3) of the union at points (N, 3), FIGURE.

    Outputs that are not requested are empty. Without a grid that has a surface distances are infinite, parts -1 and
    gradients zero.
    """
    points = sealed(points, np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points: shape is {points.shape}, expected (N, 3)")
    number = len(points)
    count("field values", number)
    values = np.full(number, np.inf)
    parts = np.full(number if with_parts else 0, -1, np.int32)
    gradients = np.zeros((number if with_gradients else 0, 3))

    def run(first: int, step: int) -> None:
        evaluate_blocks(grids, points, first, step, _BLOCK, values, parts, gradients)

    run_blocks(run, number, _BLOCK)
    return values, parts, gradients
