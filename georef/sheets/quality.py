"""Quality of a fitted transformation: residuals of its control points, in metres on the ground."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from georef.errors import PlacementError
from georef.sheets.controls import FloatArray
from georef.sheets.fit import Fit
from georef.sheets.reference import Plane


@dataclass(frozen=True)
class FitQuality:
    """Agreement of a transformation with its control points.

    residuals_m : residual of each control point, on the ground, metres
    rmse_m : root mean square of the residuals
    degrees_of_freedom : number of coordinates minus number of parameters; 0: the transformation interpolates every
        point, and residuals are meaningless
    sigma_m : standard error of one coordinate, from the residuals and the degrees of freedom; None without any
    leave_one_out_m : leave-one-out residual of each control point, on the ground, metres; only of splines
    """

    residuals_m: tuple[float, ...]
    rmse_m: float
    degrees_of_freedom: int
    sigma_m: float | None
    leave_one_out_m: tuple[float, ...] = ()

    @property
    def leave_one_out_rmse_m(self) -> float | None:
        """Root mean square of `leave_one_out_m`."""
        return _rms(np.array(self.leave_one_out_m)) if self.leave_one_out_m else None


def fit_quality(fitted: Fit, plane: Plane, pixels: FloatArray, coordinates: FloatArray) -> FitQuality:
    """Quality of a fit, from its control points.

    plane : the plane in which it was fitted
    pixels : (N, 2) IMAGE; coordinates : (N, 2) of the plane
    """
    given = plane.to_lonlat(coordinates)
    residuals = distances_m(plane.to_lonlat(fitted.apply(pixels)), given)
    free = max(2 * len(given) - fitted.parameters, 0)
    sigma = math.sqrt(float((residuals**2).sum()) / free) if free else None
    leave_one_out: tuple[float, ...] = ()
    if fitted.leave_one_out is not None:
        # A spline of too few points may put the one left out off the earth.
        with suppress(PlacementError):
            leave_one_out = tuple(distances_m(plane.to_lonlat(coordinates - fitted.leave_one_out), given).tolist())
    return FitQuality(tuple(residuals.tolist()), _rms(residuals), free, sigma, leave_one_out)


def distances_m(one: FloatArray, other: FloatArray) -> FloatArray:
    """(N,) lengths of geodesics on WGS 84, metres, between (N, 2) longitudes and latitudes."""
    from pyproj import Geod

    return np.asarray(Geod(ellps="WGS84").inv(one[:, 0], one[:, 1], other[:, 0], other[:, 1])[2], np.float64)


def _rms(values: FloatArray) -> float:
    return math.sqrt(float((values**2).mean()))
