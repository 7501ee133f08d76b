"""Inflation of an outline: −Δu = c inside, u = 0 on the rim; the half thickness is √u.

With c = 2 a strip becomes a circular cylinder, with c = 4 a disc becomes a sphere. The solution is smooth, round
at the rim and has no ridge along the medial axis, which an inflation by distance has.

The equation is solved with PyTorch, so that it runs on the device that the networks use: conjugate gradients on the
five-point Laplacian, started from the solution on a raster half as fine.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import torch

TOLERANCE = 1e-3
"""Residual relative to the right-hand side at which the solver stops; 0.1 % of u is 0.05 % of the thickness."""

MIN_SHARE = 0.05
"""Least distance of the rim from a pixel centre, pixels, which keeps the equations well conditioned."""

MIN_COARSE_PX = 24
MAX_ITERATIONS = 400


@contextmanager
def single_threaded() -> Iterator[None]:
    """PyTorch on one thread of the CPU.

    The arrays of this package are small: threads would wait for each other most of the time, and several times as long
    where another process keeps a core busy.
    """
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def inflate(
    inside: NDArray[np.bool_],
    load: NDArray[np.float64],
    device: str = "cpu",
    distance: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Solve −Δu = load on the pixels `inside`, u = 0 elsewhere.

    Parameters
    ----------
    inside : (H, W) bool
    load : (H, W), positive
    device : PyTorch device
    distance : (H, W) signed distance in any unit, negative inside: locates the rim between pixel centres; without it
        the rim runs through the outermost pixels outside, and u carries their stairs far into the outline

    Returns
    -------
    u : (H, W) float64 in pixels²; 0 outside
    """
    import torch

    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    result = np.zeros(inside.shape)
    if not len(rows):
        return result
    window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    domain = torch.from_numpy(np.pad(inside[window], 1).astype(np.float32)).to(device)
    force = torch.from_numpy(np.pad(load[window], 1).astype(np.float32)).to(device)
    own = np.full(domain.shape, 4.0)
    if distance is not None:
        own[1:-1, 1:-1] = _own_weight(inside, distance)[window]
    with single_threaded():
        solution = _solve(domain, force * domain, torch.from_numpy(own.astype(np.float32)).to(device))
    result[window] = solution[1:-1, 1:-1].double().cpu().numpy()
    return np.maximum(result, 0.0)


def _own_weight(inside: NDArray[np.bool_], distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """(H, W) diagonal weight of each pixel in −Δu: larger where the rim is nearer than the next pixel.

    The symmetric scheme of Gibou et al. (2002), second order in the position of the rim.
    """
    weight = np.full(inside.shape, 4.0)
    for axis in (0, 1):
        for step in (1, -1):
            beyond = np.roll(distance, step, axis)
            share = distance / np.minimum(distance - beyond, -1e-12)
            leaves = inside & ~np.roll(inside, step, axis)
            weight[leaves] += 1.0 / np.clip(share, MIN_SHARE, 1.0)[leaves] - 1.0
    return weight


def _laplacian(u: torch.Tensor, domain: torch.Tensor, own: torch.Tensor | float = 4.0) -> torch.Tensor:
    """−Δu for u that vanishes outside the domain and on the raster's border."""
    out = own * u
    out[1:] -= u[:-1]
    out[:-1] -= u[1:]
    out[:, 1:] -= u[:, :-1]
    out[:, :-1] -= u[:, 1:]
    return out * domain


def _solve(domain: torch.Tensor, force: torch.Tensor, own: torch.Tensor | float = 4.0) -> torch.Tensor:
    import torch
    from torch.nn import functional

    guess = torch.zeros_like(force)
    if min(domain.shape) > MIN_COARSE_PX:
        pooled = functional.avg_pool2d(torch.stack([domain, force])[:, None], 2, ceil_mode=True)[:, 0]
        coarse_domain = (pooled[0] > 0.5).float()
        # The coarse pixel is twice as wide, so the same load weighs four times as much.
        coarse = _solve(coarse_domain, 4.0 * pooled[1] / pooled[0].clamp(min=1e-6) * coarse_domain)
        fine = functional.interpolate(coarse[None, None], scale_factor=2, mode="bilinear", align_corners=False)
        guess = fine[0, 0, : domain.shape[0], : domain.shape[1]] * domain
    residual = force - _laplacian(guess, domain, own)
    direction = residual.clone()
    energy = torch.sum(residual * residual)
    limit = TOLERANCE**2 * float(torch.sum(force * force))
    for _ in range(MAX_ITERATIONS):
        if float(energy) <= limit:
            break
        image = _laplacian(direction, domain, own)
        step = energy / torch.sum(direction * image)
        guess = guess + step * direction
        residual = residual - step * image
        previous, energy = energy, torch.sum(residual * residual)
        direction = residual + (energy / previous) * direction
    return guess
