"""Newton projection onto the zero level of a field, and outward directions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fig2mesh.mesh.protocol import Field, Points
from fig2mesh.records import BoolArray, FloatArray


def newton(
    field: Field, points: Points, *, tolerance: float, reach: float | NDArray[np.float32], iterations: int = 8
) -> tuple[FloatArray, BoolArray]:
    """Project points onto the zero level.

    Parameters
    ----------
    points : (N, 3), FIGURE
    tolerance : distance from the surface, by the field's own values, at which a point has converged
    reach : largest distance of a point from its start; a scalar or (N,)
    iterations : largest number of steps

    Returns
    -------
    (N, 3) float32 positions and (N,) bool, True where a point converged within reach. Other points are returned
    unchanged.

    Full Newton steps oscillate across a crease, where the gradient changes abruptly; from the fourth step on they are
    damped, and all but some 0.1 % of the points of a body converge.
    """
    start = np.ascontiguousarray(points, np.float32)
    current = start.copy()
    limit = np.broadcast_to(np.asarray(reach, np.float32), (len(start),))
    value = field.distance(current)
    arrived = np.abs(value) <= tolerance
    active = np.flatnonzero(~arrived)
    for step in range(iterations):
        if len(active) == 0:
            break
        gradient = field.gradient(current[active])
        square = np.maximum(np.einsum("nd,nd->n", gradient, gradient), 1e-6)
        move = gradient * (-(value[active] / square) * (1.0 if step < 3 else 0.7))[:, None]
        length = np.linalg.norm(move, axis=1)
        move *= np.minimum(1.0, limit[active] / np.maximum(length, 1e-12))[:, None]
        current[active] += move
        value[active] = field.distance(current[active])
        arrived[active] = np.abs(value[active]) <= tolerance
        near = np.linalg.norm(current[active] - start[active], axis=1) <= 2 * limit[active]
        active = active[~arrived[active] & near]
    arrived &= np.linalg.norm(current - start, axis=1) <= limit
    current[~arrived] = start[~arrived]
    return current, arrived


def outward(field: Field, points: Points, step: float) -> FloatArray:
    """(N, 3) float32 directions out of the body at points (N, 3) of its surface, not normalised.

    The field's gradient; but where a part ends at a face of its grid the field jumps from below to above zero, and the
    gradient there belongs to a surface elsewhere. Such points are identified by their value, and get differences across
    `step`, FIGURE units, on either side, in which the jump prevails.
    """
    points = np.ascontiguousarray(points, np.float32)
    result = np.array(field.gradient(points), np.float32)
    slope = np.linalg.norm(result, axis=1)
    jumps = np.flatnonzero(np.abs(field.distance(points)) > step * np.maximum(slope, 1e-3))
    for axis in range(3 if len(jumps) else 0):
        aside = np.zeros(3, np.float32)
        aside[axis] = step
        result[jumps, axis] = field.distance(points[jumps] + aside) - field.distance(points[jumps] - aside)
    return result
