"""Poisson-disk sampling by elimination: points are dropped until none is nearer to another than a radius.

Points are visited in order; one is kept unless a kept one lies within the radius. A hash grid finds the neighbours.
Ball pivoting needs this: among clumped points it leaves hundreds of holes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.compiled import kernel


def thin(points: NDArray[Any], radius: float | NDArray[Any]) -> NDArray[np.int64]:
    """Indices, ascending, of the points that are kept.

    points : (N, 3); radius : of all points or (N,) of each. Two points are too near to each other when closer than the
    smaller of their radii: no two kept ones are, and every other point is to a kept one before it.
    """
    if len(points) == 0:
        return np.zeros(0, np.int64)
    start = np.ascontiguousarray(points - points.min(axis=0), np.float32)
    radii = np.ascontiguousarray(np.broadcast_to(np.asarray(radius, np.float32), len(points)))
    return np.flatnonzero(_kept(start, radii.copy(), float(radii.max())))


@kernel
def _kept(points: Any, radii: Any, radius: float) -> Any:
    count = len(points)
    size = 64
    while size < count:
        size *= 2
    # Buckets are chains through `following`; two cells in one bucket cost a comparison and change nothing.
    head = np.full(size, -1, np.int32)
    following = np.full(count, -1, np.int32)
    keep = np.zeros(count, np.bool_)
    for i in range(count):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        a, b, c = int(x / radius), int(y / radius), int(z / radius)
        free = True
        for da in range(-1, 2):
            for db in range(-1, 2):
                for dc in range(-1, 2):
                    bucket = ((a + da) * 73856093 ^ (b + db) * 19349663 ^ (c + dc) * 83492791) & (size - 1)
                    j = head[bucket]
                    while j >= 0:
                        dx, dy, dz = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
                        near = min(radii[i], radii[j])
                        if dx * dx + dy * dy + dz * dz < near * near:
                            free = False
                            break
                        j = following[j]
                    if not free:
                        break
                if not free:
                    break
            if not free:
                break
        if free:
            keep[i] = True
            bucket = (a * 73856093 ^ b * 19349663 ^ c * 83492791) & (size - 1)
            following[i] = head[bucket]
            head[bucket] = i
    return keep
