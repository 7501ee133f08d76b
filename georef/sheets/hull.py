"""Convex hulls of control points: inside them a transformation interpolates, outside it extrapolates."""

from __future__ import annotations

import numpy as np

from georef.sheets.controls import FloatArray


def convex_hull(points: FloatArray) -> FloatArray:
    """(M, 2) corners of the convex hull of (N, 2) points, in order. Andrew's monotone chain."""
    ordered = np.array(sorted(set(map(tuple, points.tolist()))))

    def half(chain: FloatArray) -> list[FloatArray]:
        corners: list[FloatArray] = []
        for point in chain:
            while len(corners) > 1 and _turn(corners[-2], corners[-1], point) <= 0:
                corners.pop()
            corners.append(point)
        return corners[:-1]

    return ordered if len(ordered) < 3 else np.array(half(ordered) + half(ordered[::-1]))


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def nearest_in(hull: FloatArray, point: FloatArray) -> FloatArray:
    """(2,) the point of a convex hull nearest to `point`, which is `point` itself if it is inside."""
    ends = np.roll(hull, -1, axis=0)
    edges, offsets = ends - hull, point - hull
    if len(hull) > 2 and (edges[:, 0] * offsets[:, 1] - edges[:, 1] * offsets[:, 0] >= 0).all():
        return point
    along = np.clip((edges * offsets).sum(axis=1) / np.maximum((edges**2).sum(axis=1), 1e-300), 0.0, 1.0)
    candidates = hull + along[:, None] * edges
    return np.asarray(candidates[np.argmin(((candidates - point) ** 2).sum(axis=1))])
