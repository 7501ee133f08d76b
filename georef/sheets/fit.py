"""Transformations from pixels to a plane, fitted to control points by least squares.

All of them work on normalised coordinates: moved to their mean and divided by their largest distance from it, so that
a cubic polynomial of a sheet with 20,000 pixels a side is as well conditioned as that of a unit square. None of the
transformations changes by that, as the divisor is the same for x and y.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from georef.errors import PlacementError
from georef.sheets.controls import FloatArray

Map = Callable[[FloatArray], FloatArray]

METHODS: Final = ("helmert", "affine", "poly1", "poly2", "poly3", "tps", "projective")

LEAST: Final = {"helmert": 2, "affine": 3, "poly1": 3, "poly2": 6, "poly3": 10, "tps": 3, "projective": 4}
"""Control points that determine each transformation."""

MAX_SPLINE_POINTS = 2_000
"""A spline solves a dense system of as many unknowns."""

MAX_LEFT_OUT = 500
"""Points up to which a spline is checked by leaving each out, which needs the inverse of its system."""

THIN = 1e-4
"""Control points whose cloud is thinner than this share of its length lie on one line: a pixel's error across it
would turn the sheet by as much as the whole cloud is wide."""

SINGULAR = 1e-7
"""Least share of a system's smallest in its largest singular value. Well-spread points have 1e-3 and more, even for
cubics; points on a conic, or three of four in a row, 1e-15."""


@dataclass(frozen=True)
class Fit:
    """A transformation of a plane.

    method : its name, see `METHODS`
    parameters : how many numbers the control points determine
    apply : (N, 2) IMAGE → (N, 2) coordinates of the plane; infinite where a point has no image
    left_out : (N, 2) in the plane, by how much each control point is missed by the transformation of all the others;
        only of splines, which miss none of their own
    """

    method: str
    parameters: int
    apply: Map
    left_out: FloatArray | None = None


def fit(method: str, pixels: FloatArray, coordinates: FloatArray, source: object = "control points") -> Fit:
    """Fit a transformation.

    method : one of `METHODS`
    pixels : (N, 2) IMAGE, px
    coordinates : (N, 2) of the plane
    source : where the points come from, for error messages

    Raises PlacementError for too few points, and for points that leave the transformation open.
    """
    _check_count(method, len(pixels), source)
    into, here = _Scale(pixels), _Scale(coordinates)
    if into.size == 0 or here.size == 0:
        raise PlacementError(source, "all control points are one and the same", "give points apart from each other")
    p, q = into(pixels), here(coordinates)
    left_out = None
    if method == "helmert":
        inner, parameters = _helmert(p, q), 4
    else:
        widths = np.linalg.svd(p, compute_uv=False)
        if widths[1] < THIN * widths[0]:
            raise PlacementError(source, "the control points lie on one line", "add points beside it")
        if method == "projective":
            inner, parameters = _projective(p, q, source), 8
        elif method == "tps":
            inner, left_out = _spline(p, q, source)
            parameters = 2 * len(p)
        else:
            degree = 1 if method == "affine" else int(method[-1])
            inner, parameters = _polynomial(p, q, degree, source), (degree + 1) * (degree + 2)
    if left_out is not None:
        left_out = left_out * here.size
    return Fit(method, parameters, lambda points: here.back(inner(into(points))), left_out)


def _check_count(method: str, count: int, source: object) -> None:
    if count < LEAST[method]:
        finding = f"{count} control point{'s' if count > 1 else ''}, but {method} needs {LEAST[method]}"
        fewer = [name for name in ("helmert", "affine", "poly2") if LEAST[name] <= count]
        remedy = f"add points, or pass --map-transform {fewer[-1]}" if fewer else "add points"
        raise PlacementError(source, finding, remedy)
    if method == "tps" and count > MAX_SPLINE_POINTS:
        finding = f"{count} control points are too many for a spline"
        raise PlacementError(source, finding, f"give at most {MAX_SPLINE_POINTS}, or pass --map-transform poly3")


class _Scale:
    """Coordinates moved to the mean of some points and divided by their largest distance from it."""

    def __init__(self, points: FloatArray) -> None:
        self.centre = points.mean(axis=0)
        self.size = float(np.linalg.norm(points - self.centre, axis=1).max())

    def __call__(self, points: FloatArray) -> FloatArray:
        return np.asarray((points - self.centre) / self.size)

    def back(self, points: FloatArray) -> FloatArray:
        return np.asarray(points * self.size + self.centre)


def _helmert(p: FloatArray, q: FloatArray) -> Map:
    """A similarity that keeps the picture the right way round: rows run down, northings up."""
    z, w = p[:, 0] - 1j * p[:, 1], q[:, 0] + 1j * q[:, 1]
    # Both are about their mean, so that the shift is nothing and the rest one complex number.
    turn = np.vdot(z, w) / np.vdot(z, z)

    def apply(points: FloatArray) -> FloatArray:
        result = turn * (points[:, 0] - 1j * points[:, 1])
        return np.stack([result.real, result.imag], axis=1)

    return apply


def _monomials(p: FloatArray, degree: int) -> FloatArray:
    return np.stack([p[:, 0] ** (n - k) * p[:, 1] ** k for n in range(degree + 1) for k in range(n + 1)], axis=1)


def _polynomial(p: FloatArray, q: FloatArray, degree: int, source: object) -> Map:
    basis = _monomials(p, degree)
    coefficients, _, _, singular = np.linalg.lstsq(basis, q, rcond=None)
    if singular[-1] < SINGULAR * singular[0]:
        finding = f"the control points lie on a curve that a polynomial of degree {degree} cannot see"
        raise PlacementError(source, finding, "spread them over the sheet, or pass --map-transform affine")
    return lambda points: np.asarray(_monomials(points, degree) @ coefficients)


def _kernel(squared: FloatArray) -> FloatArray:
    """r² log r, the bending of a thin plate, of squared distances."""
    return np.asarray(0.5 * squared * np.log(np.where(squared > 0, squared, 1.0)))


def _squared(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(((a[:, None, :] - b[None, :, :]) ** 2).sum(axis=-1))


def _spline(p: FloatArray, q: FloatArray, source: object) -> tuple[Map, FloatArray | None]:
    """The thin-plate spline through all points, and by how much it misses each when made of the others.

    Duchon (1977), Wahba (1990) 2.4; leaving one out: Rippa (1999), Advances in Computational Mathematics 11.
    """
    count = len(p)
    squared = _squared(p, p)
    nearest = np.sqrt((squared + np.eye(count) * 9).min(axis=1))
    if nearest.min() < 1e-7:
        first = int(np.argmin(nearest))
        other = int(np.argmin(squared[first] + np.eye(count)[first] * 9))
        finding = f"control points {min(first, other) + 1} and {max(first, other) + 1} are the same pixel of two places"
        raise PlacementError(source, finding, "remove one; a spline goes through every point")
    system = np.zeros((count + 3, count + 3))
    system[:count, :count] = _kernel(squared)
    system[:count, count] = system[count, :count] = 1.0
    system[:count, count + 1 :] = p
    system[count + 1 :, :count] = p.T
    right = np.concatenate([q, np.zeros((3, 2))])
    left_out = None
    if 3 < count <= MAX_LEFT_OUT:
        inverse = np.linalg.inv(system)
        weights = inverse @ right
        # One step of refinement: what rounding left over is solved for once more.
        weights += inverse @ (right - system @ weights)
        left_out = weights[:count] / np.diag(inverse)[:count, None]
    else:
        weights = np.linalg.solve(system, right)

    def apply(points: FloatArray) -> FloatArray:
        affine = weights[count] + points @ weights[count + 1 :]
        return np.asarray(_kernel(_squared(points, p)) @ weights[:count] + affine)

    return apply, left_out


def _projective(p: FloatArray, q: FloatArray, source: object) -> Map:
    """The homography that misses the coordinates least: from the linear solution by Gauss-Newton steps.

    Hartley & Zisserman, Multiple View Geometry (2004), 4.1 and 4.5.
    """
    one, zero = np.ones((len(p), 1)), np.zeros((len(p), 3))
    h = np.concatenate([p, one], axis=1)
    system = np.concatenate(
        [np.concatenate([h, zero, -q[:, :1] * h], axis=1), np.concatenate([zero, h, -q[:, 1:] * h], axis=1)]
    )
    _, singular, rows = np.linalg.svd(system)
    matrix = rows[-1].reshape(3, 3)
    if singular[7] < SINGULAR * singular[0] or abs(matrix[2, 2]) < 1e-6:
        finding = "the control points do not determine a projective transformation"
        raise PlacementError(source, finding, "give at least four of which no three lie on one line")
    values = (matrix / matrix[2, 2]).ravel()[:8]
    for _ in range(50):
        image, scale = _project(values, p)
        missed = (q - image).ravel()
        jacobian = np.zeros((len(p), 2, 8))
        jacobian[:, 0, 0:3] = jacobian[:, 1, 3:6] = h / scale
        jacobian[:, :, 6:] = -image[:, :, None] * p[:, None, :] / scale[:, :, None]
        step = np.linalg.lstsq(jacobian.reshape(-1, 8), missed, rcond=None)[0]
        values = values + step
        if np.abs(step).max() < 1e-14:
            break
    image, scale = _project(values, p)
    if not (np.isfinite(image).all() and (scale > 0).all()):
        finding = "no projective transformation keeps the control points on one side of its horizon"
        raise PlacementError(source, finding, "check the points, or pass --map-transform affine")

    def apply(points: FloatArray) -> FloatArray:
        result, scale = _project(values, points)
        return np.where(scale > 0, result, np.inf)

    return apply


def _project(values: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Images of points, and the divisors, (N, 1), which are positive on this side of the horizon."""
    scale = points @ values[6:] + 1.0
    with np.errstate(divide="ignore", invalid="ignore"):
        image = np.stack([points @ values[0:2] + values[2], points @ values[3:5] + values[5]], axis=1) / scale[:, None]
    return image, scale[:, None]
