"""Transformations: exact without noise, within the statistics with it, indifferent to units, and as GDAL has them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rasterio.control import GroundControlPoint
from rasterio.transform import GCPTransformer
from scipy import stats
from scipy.interpolate import RBFInterpolator

from georef.errors import PlacementError
from georef.sheets.controls import FloatArray
from georef.sheets.fit import METHODS, MIN_POINTS, fit
from georef.sheets.hull import convex_hull, nearest_in

SHEET = 8000.0
"""Pixels a side."""

CENTRE = np.array([2_683_000.0, 1_247_000.0])
"""Coordinates as large as those of national grids, where careless arithmetic loses digits."""


def spread(count: int, seed: int = 0) -> FloatArray:
    """Control points over the whole sheet, none near another: a jittered grid, in random order."""
    rng = np.random.default_rng(seed)
    side = int(np.ceil(np.sqrt(count)))
    cells = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    cells = cells[rng.permutation(len(cells))[:count]]
    return (cells + rng.uniform(0.2, 0.8, cells.shape)) * SHEET / side


def truth(method: str, pixels: FloatArray) -> FloatArray:
    """A map of each kind, some metres a pixel, turned by 25 degrees."""
    x, y = ((pixels - SHEET / 2) / SHEET).T
    if method == "helmert":
        plane = np.stack([x, -y], axis=1)
    elif method in ("affine", "poly1"):
        plane = np.stack([1.2 * x + 0.1 * y, 0.05 * x - 0.9 * y], axis=1)
    elif method == "poly2":
        plane = np.stack([x + 0.2 * x * y, -y + 0.1 * x**2 - 0.07 * y**2], axis=1)
    elif method in ("poly3", "tps"):
        plane = np.stack([x + 0.2 * x**3 - 0.1 * x * y**2, -y + 0.1 * x**2 + 0.1 * y**3], axis=1)
    else:
        scale = 1.0 + 0.3 * x - 0.2 * y
        plane = np.stack([(1.1 * x + 0.1 * y) / scale, (0.1 * x - y) / scale], axis=1)
    turn = np.radians(25.0)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return CENTRE + 20_000.0 * plane @ rotation.T


@pytest.mark.parametrize("method", [m for m in METHODS if m != "tps"])
@pytest.mark.parametrize("extra", [0, 1, 20])
def test_without_noise_the_map_is_found_exactly(method: str, extra: int) -> None:
    pixels, probe = spread(MIN_POINTS[method] + extra), spread(50, seed=1)
    found = fit(method, pixels, truth(method, pixels))
    # 20 km in float64 coordinates of 2.7e6 m: rounding is 5e-10 m, and few points see it enlarged.
    assert np.abs(found.apply(probe) - truth(method, probe)).max() < 1e-5


def test_a_spline_goes_through_its_points_and_is_affine_where_they_are() -> None:
    pixels, probe = spread(40), spread(60, seed=1)
    bent = fit("tps", pixels, truth("tps", pixels))
    assert np.abs(bent.apply(pixels) - truth("tps", pixels)).max() < 1e-6
    flat = fit("tps", pixels, truth("affine", pixels))
    assert np.abs(flat.apply(probe) - truth("affine", probe)).max() < 1e-5


@pytest.mark.parametrize("method", [m for m in METHODS if m != "tps"])
def test_residuals_and_errors_follow_their_statistics(method: str) -> None:
    """Over 300 draws of noise, the sum of squared residuals is chi-squared with 2n - p degrees of freedom a draw, and
    what the fit is wrong by at a point that nobody gave has the variance that the points' geometry predicts."""
    sigma, draws, count = 3.0, 300, 16
    pixels, probe = spread(count), np.array([[SHEET * 0.37, SHEET * 0.71]])
    exact, there = truth(method, pixels), truth(method, probe)[0]
    clean = fit(method, pixels, exact)
    # Derivatives of the prediction by each coordinate of each control point: the fit is linear in small errors.
    step = 1.0
    gradient = np.zeros((2, count, 2))
    for index in range(count):
        for axis in range(2):
            moved = exact.copy()
            moved[index, axis] += step
            gradient[:, index, axis] = (fit(method, pixels, moved).apply(probe)[0] - there) / step
    covariance = sigma**2 * np.einsum("ank,bnk->ab", gradient, gradient)
    rng = np.random.default_rng(7)
    squares, mahalanobis = 0.0, 0.0
    for _ in range(draws):
        found = fit(method, pixels, exact + rng.normal(0.0, sigma, exact.shape))
        error = found.apply(probe)[0] - there
        mahalanobis += float(error @ np.linalg.solve(covariance, error))
        noisy = found.apply(pixels) - exact
        squares += float((noisy**2).sum())
    # The fitted part of the noise has p degrees of freedom, the residuals 2n - p; tested by the fitted part.
    parts = ((squares / sigma**2, draws * clean.parameters), (mahalanobis, draws * 2))
    for value, freedom in parts:
        # One in a million draws of a right fit would be outside; a wrong number of parameters is far outside.
        low, high = stats.chi2.ppf([5e-7, 1 - 5e-7], freedom)
        assert low < value < high


@pytest.mark.parametrize("method", [m for m in METHODS if m != "tps"])
def test_what_is_left_over_is_chi_squared(method: str) -> None:
    sigma, draws, count = 3.0, 300, 14
    pixels = spread(count)
    exact = truth(method, pixels)
    rng = np.random.default_rng(11)
    total = 0.0
    for _ in range(draws):
        noisy = exact + rng.normal(0.0, sigma, exact.shape)
        total += float(((fit(method, pixels, noisy).apply(pixels) - noisy) ** 2).sum())
    freedom = draws * (2 * count - fit(method, pixels, exact).parameters)
    low, high = stats.chi2.ppf([5e-7, 1 - 5e-7], freedom)
    assert low < total / sigma**2 < high


def test_more_points_make_better_maps() -> None:
    rng = np.random.default_rng(3)
    probe = spread(30, seed=9)

    def error(count: int) -> float:
        total = 0.0
        for seed in range(40):
            pixels = spread(count, seed)
            found = fit("affine", pixels, truth("affine", pixels) + rng.normal(0, 5.0, (count, 2)))
            total += float(((found.apply(probe) - truth("affine", probe)) ** 2).mean())
        return float(np.sqrt(total / 40))

    assert error(100) < 0.5 * error(9)


similarities = st.tuples(st.floats(0.01, 100.0), st.floats(-np.pi, np.pi), st.floats(-1e5, 1e5), st.floats(-1e5, 1e5))


def moved(points: FloatArray, similarity: tuple[float, float, float, float]) -> FloatArray:
    scale, turn, x, y = similarity
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return scale * points @ rotation.T + (x, y)


@pytest.mark.parametrize("method", METHODS)
@given(on_picture=similarities, on_map=similarities)
def test_units_turns_and_shifts_change_nothing(method: str, on_picture, on_map) -> None:
    pixels, probe = spread(15), spread(10, seed=2)
    coordinates = truth("poly3", pixels) - CENTRE
    plain = fit(method, pixels, coordinates).apply(probe)
    other = fit(method, moved(pixels, on_picture), moved(coordinates, on_map)).apply(moved(probe, on_picture))
    size = np.ptp(moved(coordinates, on_map)) + np.abs(on_map[2:]).max() * 1e-9
    assert np.abs(other - moved(plain, on_map)).max() < 1e-7 * size


def gdal(pixels: FloatArray, coordinates: FloatArray, spline: bool = False) -> GCPTransformer:
    """GDAL's transformer. It fits polynomials of the order that the number of points allows: 1 below six, then 2."""
    return GCPTransformer(
        [GroundControlPoint(row=y, col=x, x=e, y=n) for (x, y), (e, n) in zip(pixels, coordinates, strict=True)],
        tps=spline,
    )


@pytest.mark.parametrize(("method", "count"), [("affine", 3), ("affine", 5), ("poly2", 6), ("poly2", 40)])
def test_gdal_has_the_same_polynomials(method: str, count: int) -> None:
    pixels, probe = spread(count), spread(200, seed=4)
    coordinates = truth("poly3", pixels) + np.random.default_rng(5).normal(0.0, 40.0, (count, 2))
    with gdal(pixels, coordinates) as transformer:
        expected = np.stack(transformer.xy(probe[:, 1], probe[:, 0], offset="ul"), axis=1)
    apart = np.abs(fit(method, pixels, coordinates).apply(probe) - expected).max()
    assert apart < 1e-6 * np.ptp(coordinates, axis=0).max()


def test_gdal_has_the_same_spline() -> None:
    """GDAL fits its spline from the map to the picture, and inverts that one for the other direction: so it is from
    the map to the picture that two splines through the same points can be compared."""
    pixels, probe = spread(30), spread(200, seed=4)
    coordinates = truth("poly3", pixels) + np.random.default_rng(5).normal(0.0, 40.0, (30, 2))
    there = truth("poly3", probe)
    with gdal(pixels, coordinates, spline=True) as transformer:
        rows, columns = transformer.rowcol(there[:, 0], there[:, 1], op=lambda value: value)
    expected = np.stack([columns, rows], axis=1)
    assert np.abs(fit("tps", coordinates, pixels).apply(there) - expected).max() < 1e-6 * SHEET


def test_scipy_has_the_same_spline() -> None:
    pixels, probe = spread(30), spread(200, seed=4)
    coordinates = truth("poly3", pixels) + np.random.default_rng(5).normal(0.0, 40.0, (30, 2))
    expected = RBFInterpolator(pixels / SHEET, coordinates, kernel="thin_plate_spline", degree=1)(probe / SHEET)
    assert np.abs(fit("tps", pixels, coordinates).apply(probe) - expected).max() < 1e-6 * np.ptp(coordinates)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_normal_equations_have_the_same_polynomial(degree: int) -> None:
    """GDAL is not offered third order by rasterio, so NumPy's own basis and the normal equations stand in for it."""
    rng = np.random.default_rng(6)
    pixels, probe = spread(40), spread(100, seed=4)
    coordinates = truth("poly3", pixels) + rng.normal(0.0, 40.0, (40, 2)) - CENTRE

    def basis(points: FloatArray) -> FloatArray:
        x, y = (points / SHEET * 2 - 1).T
        full = np.polynomial.legendre.legvander2d(x, y, [degree, degree])
        rows, columns = np.divmod(np.arange((degree + 1) ** 2), degree + 1)
        return full[:, rows + columns <= degree]

    design = basis(pixels)
    expected = basis(probe) @ np.linalg.solve(design.T @ design, design.T @ coordinates)
    apart = np.abs(fit(f"poly{degree}", pixels, coordinates).apply(probe) - expected).max()
    assert apart < 1e-6 * np.ptp(coordinates)


def test_a_projective_map_is_the_least_squares_one() -> None:
    from scipy.optimize import least_squares

    rng = np.random.default_rng(8)
    pixels, probe = spread(12), spread(40, seed=4)
    coordinates = (truth("projective", pixels) - CENTRE) / 1e4 + rng.normal(0.0, 0.01, (12, 2))
    p = pixels / SHEET

    def image(values: FloatArray, points: FloatArray) -> FloatArray:
        scale = points @ values[6:8] + 1
        return np.stack([(points @ values[:2] + values[2]) / scale, (points @ values[3:5] + values[5]) / scale], axis=1)

    start = np.array([1.0, 0, 0, 0, -1.0, 0, 0, 0])
    best = least_squares(lambda v: (image(v, p) - coordinates).ravel(), start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert np.abs(fit("projective", pixels, coordinates).apply(probe) - image(best.x, probe / SHEET)).max() < 1e-5


def test_leaving_one_out_is_what_refitting_finds() -> None:
    pixels = spread(14)
    coordinates = truth("tps", pixels) + np.random.default_rng(2).normal(0, 100.0, (14, 2))
    missed = fit("tps", pixels, coordinates).leave_one_out
    assert missed is not None
    for index in range(14):
        others = np.arange(14) != index
        again = fit("tps", pixels[others], coordinates[others]).apply(pixels[index : index + 1])[0]
        assert coordinates[index] - again == pytest.approx(missed[index], abs=1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_too_few_points_are_refused(method: str) -> None:
    pixels = spread(MIN_POINTS[method] - 1)
    with pytest.raises(
        PlacementError, match=rf"{MIN_POINTS[method] - 1} control points?, but {method} needs {MIN_POINTS[method]}"
    ):
        fit(method, pixels, truth("affine", pixels))


@pytest.mark.parametrize("method", [m for m in METHODS if m != "helmert"])
def test_points_on_one_line_are_refused(method: str) -> None:
    along = np.linspace(0, SHEET, 15)
    pixels = np.stack([along, 0.3 * along + 17], axis=1)
    with pytest.raises(PlacementError, match="lie on one line"):
        fit(method, pixels, truth("affine", pixels))
    # A pixel of jitter does not make a plane of a line.
    with pytest.raises(PlacementError, match="lie on one line"):
        fit(method, pixels + np.random.default_rng(0).uniform(-0.3, 0.3, pixels.shape), truth("affine", pixels))


def test_points_that_leave_a_map_open_are_refused() -> None:
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    circle = SHEET / 2 + 3000 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    with pytest.raises(PlacementError, match="curve that does not determine a polynomial of degree 2"):
        fit("poly2", circle, truth("poly2", circle))
    row = np.array([[0.0, 0], [1000, 0], [2000, 0], [500, 900]])
    with pytest.raises(PlacementError, match="no three of them on one line"):
        fit("projective", row, truth("affine", row))
    same = np.full((5, 2), 7.0)
    with pytest.raises(PlacementError, match="all control points coincide"):
        fit("helmert", same, truth("affine", same))


def test_a_spline_needs_pixels_apart_and_not_too_many() -> None:
    pixels = spread(9)
    pixels[4] = pixels[2]
    with pytest.raises(PlacementError, match="control points 3 and 5 are one pixel at two places"):
        fit("tps", pixels, truth("tps", spread(9)))
    many = np.random.default_rng(0).uniform(0, SHEET, (2001, 2))
    with pytest.raises(PlacementError, match="2001 control points are too many"):
        fit("tps", many, many)


def test_beyond_the_horizon_there_is_no_place() -> None:
    pixels = spread(12)
    found = fit("projective", pixels, truth("projective", pixels))
    behind = found.apply(np.array([[-5 * SHEET, SHEET / 2]]))
    assert not np.isfinite(behind).any()


@given(st.lists(st.tuples(st.integers(-50, 50), st.integers(-50, 50)), min_size=3, max_size=30, unique=True))
def test_hulls_hold_their_points(points: list[tuple[int, int]]) -> None:
    cloud = np.array(points, np.float64)
    hull = convex_hull(cloud)
    for point in cloud:
        assert np.linalg.norm(nearest_in(hull, point) - point) < 1e-9
    beyond = cloud.max(axis=0) + (3.0, 4.0)
    nearest = nearest_in(hull, beyond)
    brute = min(np.linalg.norm(beyond - (a + t * (b - a))) for a in cloud for b in cloud for t in np.linspace(0, 1, 11))
    assert np.linalg.norm(nearest - beyond) <= brute + 1e-9
