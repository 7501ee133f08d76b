"""Transformations from pixels to a plane, fitted to control points by least squares.

All of them work on normalised coordinates: centred on their mean and divided by their largest distance from it, so
that a cubic polynomial of a sheet of 20,000 pixels per side is as well conditioned as that of a unit square. The
transformations are invariant to this, as the divisor is the same for x and y.
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

MIN_POINTS: Final = {"helmert": 2, "affine": 3, "poly1": 3, "poly2": 6, "poly3": 10, "tps": 3, "projective": 4}
"""Minimum number of control points of each transformation."""

MAX_SPLINE_POINTS = 2_000
"""Limit of points of a spline, which solves a dense system of as many unknowns."""

MAX_LEAVE_ONE_OUT = 500
"""Limit of points for the leave-one-out residuals of a spline, which need the inverse of its system."""

MIN_WIDTH_RATIO = 1e-4
"""Control points are collinear below this ratio of the width of their cloud to its length: an error of one pixel across
would rotate the sheet by as much as the whole cloud is wide."""

MIN_SINGULAR_RATIO = 1e-7
"""Minimum ratio of the smallest to the largest singular value of a system. Well-spread points have 1e-3 and more, even
for cubics; points on a conic, or three of four on a line, 1e-15."""


@dataclass(frozen=True)
class Fit:
    """A transformation of a plane.

    method : its name, see `METHODS`
    parameters : number of fitted parameters
    apply : (N, 2) IMAGE → (N, 2) coordinates of the plane; infinite where a point has no image
    leave_one_out : (N, 2) in the plane, leave-one-out residual of each control point; only for splines, whose ordinary
        residuals are zero
    """

    method: str
    parameters: int
    apply: Map
    leave_one_out: FloatArray | None = None


def fit(method: str, pixels: FloatArray, coordinates: FloatArray, source: object = "control points") -> Fit:
    """Fit a transformation.

    method : one of `METHODS`
    pixels : (N, 2) IMAGE, px
    coordinates : (N, 2) of the plane
    source : origin of the points, for error messages

    Raises PlacementError for too few points, and for points that do not determine the transformation.
    """
    _check_count(method, len(pixels), source)
    pixel_frame, plane_frame = _Normalisation(pixels), _Normalisation(coordinates)
    if pixel_frame.size == 0 or plane_frame.size == 0:
        raise PlacementError(source, "all control points coincide", "give distinct points")
    p, q = pixel_frame(pixels), plane_frame(coordinates)
    leave_one_out = None
    if method == "helmert":
        inner, parameters = _helmert(p, q), 4
    else:
        widths = np.linalg.svd(p, compute_uv=False)
        if widths[1] < MIN_WIDTH_RATIO * widths[0]:
            raise PlacementError(source, "the control points lie on one line", "add points off that line")
        if method == "projective":
            inner, parameters = _projective(p, q, source), 8
        elif method == "tps":
            inner, leave_one_out = _spline(p, q, source)
            parameters = 2 * len(p)
        else:
            degree = 1 if method == "affine" else int(method[-1])
            inner, parameters = _polynomial(p, q, degree, source), (degree + 1) * (degree + 2)
    if leave_one_out is not None:
        leave_one_out = leave_one_out * plane_frame.size
    return Fit(method, parameters, lambda points: plane_frame.undo(inner(pixel_frame(points))), leave_one_out)


def _check_count(method: str, count: int, source: object) -> None:
    if count < MIN_POINTS[method]:
        finding = f"{count} control point{'s' if count > 1 else ''}, but {method} needs {MIN_POINTS[method]}"
        fewer = [name for name in ("helmert", "affine", "poly2") if MIN_POINTS[name] <= count]
        remedy = f"add points, or use --map-transform {fewer[-1]}" if fewer else "add points"
        raise PlacementError(source, finding, remedy)
    if method == "tps" and count > MAX_SPLINE_POINTS:
        finding = f"{count} control points are too many for a spline"
        raise PlacementError(source, finding, f"give at most {MAX_SPLINE_POINTS}, or use --map-transform poly3")


class _Normalisation:
    """Normalisation of coordinates: centred on the mean of some points, divided by their largest distance from it."""

    def __init__(self, points: FloatArray) -> None:
        self.centre = points.mean(axis=0)
        self.size = float(np.linalg.norm(points - self.centre, axis=1).max())

    def __call__(self, points: FloatArray) -> FloatArray:
        return np.asarray((points - self.centre) / self.size)

    def undo(self, points: FloatArray) -> FloatArray:
        return np.asarray(points * self.size + self.centre)


def _helmert(p: FloatArray, q: FloatArray) -> Map:
    """Fit a similarity without reflection: rows run down, northings up."""
    z, w = p[:, 0] - 1j * p[:, 1], q[:, 0] + 1j * q[:, 1]
    # Both are centred on their mean, so the translation is zero and the rest one complex number.
    rotation = np.vdot(z, w) / np.vdot(z, z)

    def apply(points: FloatArray) -> FloatArray:
        result = rotation * (points[:, 0] - 1j * points[:, 1])
        return np.stack([result.real, result.imag], axis=1)

    return apply


def _monomials(p: FloatArray, degree: int) -> FloatArray:
    return np.stack([p[:, 0] ** (n - k) * p[:, 1] ** k for n in range(degree + 1) for k in range(n + 1)], axis=1)


def _polynomial(p: FloatArray, q: FloatArray, degree: int, source: object) -> Map:
    basis = _monomials(p, degree)
    coefficients, _, _, singular = np.linalg.lstsq(basis, q, rcond=None)
    if singular[-1] < MIN_SINGULAR_RATIO * singular[0]:
        finding = f"the control points lie on a curve that does not determine a polynomial of degree {degree}"
        raise PlacementError(source, finding, "spread them over the sheet, or use --map-transform affine")
    return lambda points: np.asarray(_monomials(points, degree) @ coefficients)


def _kernel(squared: FloatArray) -> FloatArray:
    """Thin-plate spline kernel r² log r of squared distances."""
    return np.asarray(0.5 * squared * np.log(np.where(squared > 0, squared, 1.0)))


def _squared(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(((a[:, None, :] - b[None, :, :]) ** 2).sum(axis=-1))


def _spline(p: FloatArray, q: FloatArray, source: object) -> tuple[Map, FloatArray | None]:
    """Fit the thin-plate spline through all points; also its leave-one-out residuals.

    Duchon (1977), Wahba (1990) 2.4; leave-one-out: Rippa (1999), Advances in Computational Mathematics 11.
    """
    count = len(p)
    squared = _squared(p, p)
    nearest = np.sqrt((squared + np.eye(count) * 9).min(axis=1))
    if nearest.min() < 1e-7:
        first = int(np.argmin(nearest))
        other = int(np.argmin(squared[first] + np.eye(count)[first] * 9))
        finding = f"control points {min(first, other) + 1} and {max(first, other) + 1} are one pixel at two places"
        raise PlacementError(source, finding, "remove one; a spline goes through every point")
    system = np.zeros((count + 3, count + 3))
    system[:count, :count] = _kernel(squared)
    system[:count, count] = system[count, :count] = 1.0
    system[:count, count + 1 :] = p
    system[count + 1 :, :count] = p.T
    right = np.concatenate([q, np.zeros((3, 2))])
    leave_one_out = None
    if 3 < count <= MAX_LEAVE_ONE_OUT:
        inverse = np.linalg.inv(system)
        weights = inverse @ right
        # One step of iterative refinement.
        weights += inverse @ (right - system @ weights)
        leave_one_out = weights[:count] / np.diag(inverse)[:count, None]
    else:
        weights = np.linalg.solve(system, right)

    def apply(points: FloatArray) -> FloatArray:
        affine = weights[count] + points @ weights[count + 1 :]
        return np.asarray(_kernel(_squared(points, p)) @ weights[:count] + affine)

    return apply, leave_one_out


def _projective(p: FloatArray, q: FloatArray, source: object) -> Map:
    """Fit the homography with the least squared residuals: Gauss-Newton steps from the linear solution.

    Hartley & Zisserman, Multiple View Geometry (2004), 4.1 and 4.5.
    """
    one, zero = np.ones((len(p), 1)), np.zeros((len(p), 3))
    h = np.concatenate([p, one], axis=1)
    system = np.concatenate(
        [np.concatenate([h, zero, -q[:, :1] * h], axis=1), np.concatenate([zero, h, -q[:, 1:] * h], axis=1)]
    )
    _, singular, rows = np.linalg.svd(system)
    matrix = rows[-1].reshape(3, 3)
    if singular[7] < MIN_SINGULAR_RATIO * singular[0] or abs(matrix[2, 2]) < 1e-6:
        finding = "the control points do not determine a projective transformation"
        raise PlacementError(source, finding, "give at least four points, no three of them on one line")
    values = (matrix / matrix[2, 2]).ravel()[:8]
    for _ in range(50):
        image, scale = _project(values, p)
        residual = (q - image).ravel()
        jacobian = np.zeros((len(p), 2, 8))
        jacobian[:, 0, 0:3] = jacobian[:, 1, 3:6] = h / scale
        jacobian[:, :, 6:] = -image[:, :, None] * p[:, None, :] / scale[:, :, None]
        step = np.linalg.lstsq(jacobian.reshape(-1, 8), residual, rcond=None)[0]
        values = values + step
        if np.abs(step).max() < 1e-14:
            break
    image, scale = _project(values, p)
    if not (np.isfinite(image).all() and (scale > 0).all()):
        finding = "no projective transformation keeps the control points on one side of its horizon"
        raise PlacementError(source, finding, "check the points, or use --map-transform affine")

    def apply(points: FloatArray) -> FloatArray:
        result, scale = _project(values, points)
        return np.where(scale > 0, result, np.inf)

    return apply


def _project(values: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Projected points, and their divisors, (N, 1), which are positive on this side of the horizon."""
    scale = points @ values[6:] + 1.0
    with np.errstate(divide="ignore", invalid="ignore"):
        image = np.stack([points @ values[0:2] + values[2], points @ values[3:5] + values[5]], axis=1) / scale[:, None]
    return image, scale[:, None]
