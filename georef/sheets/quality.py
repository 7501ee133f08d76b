"""How well a transformation agrees with its control points, in metres on the ground."""

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
class Quality:
    """How well a transformation agrees with its control points.

    residuals_m : of each control point, on the ground, metres
    rmse_m : root mean square of the residuals
    degrees_of_freedom : coordinates that the points give more than the transformation needs; 0: it goes through
        every point, and residuals say nothing
    sigma_m : standard error of one coordinate, from the residuals and the degrees of freedom; None without any
    left_out_m : what each control point is missed by, on the ground, when it is left out; only of splines
    """

    residuals_m: tuple[float, ...]
    rmse_m: float
    degrees_of_freedom: int
    sigma_m: float | None
    left_out_m: tuple[float, ...] = ()

    @property
    def left_out_rmse_m(self) -> float | None:
        """Root mean square of `left_out_m`."""
        return _rms(np.array(self.left_out_m)) if self.left_out_m else None


def quality_of(fitted: Fit, plane: Plane, pixels: FloatArray, coordinates: FloatArray) -> Quality:
    """What is known of a fit from its control points.

    plane : in which it was fitted
    pixels : (N, 2) IMAGE; coordinates : (N, 2) of the plane
    """
    given = plane.to_lonlat(coordinates)
    residuals = distances_m(plane.to_lonlat(fitted.apply(pixels)), given)
    free = max(2 * len(given) - fitted.parameters, 0)
    sigma = math.sqrt(float((residuals**2).sum()) / free) if free else None
    missed: tuple[float, ...] = ()
    if fitted.left_out is not None:
        # A spline made of too few points may put the one left out off the earth.
        with suppress(PlacementError):
            missed = tuple(distances_m(plane.to_lonlat(coordinates - fitted.left_out), given).tolist())
    return Quality(tuple(residuals.tolist()), _rms(residuals), free, sigma, missed)


def distances_m(one: FloatArray, other: FloatArray) -> FloatArray:
    """(N,) lengths of geodesics on WGS 84, metres, between (N, 2) longitudes and latitudes."""
    from pyproj import Geod

    return np.asarray(Geod(ellps="WGS84").inv(one[:, 0], one[:, 1], other[:, 0], other[:, 1])[2], np.float64)


def _rms(values: FloatArray) -> float:
    return math.sqrt(float((values**2).mean()))
