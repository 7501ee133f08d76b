"""Exact signed distances to closed meshes: by Open3D where it is installed, otherwise by torch alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import torch

CHUNK, CHUNK_CPU = 4_000_000, 60_000
"""Pairs of point and triangle per batch of the torch method; on a CPU as many as fit its cache."""


def signed_distance(
    vertices: NDArray[np.floating], faces: NDArray[np.integer], points: NDArray[np.floating]
) -> NDArray[np.float32]:
    """(N,) signed distance of points (N, 3) to a closed mesh, negative inside."""
    try:
        import open3d as o3d
    except ImportError:
        return signed_distance_torch(vertices, faces, points)
    scene: Any = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(faces, np.uint32))
    query = np.ascontiguousarray(points, np.float32)
    # Three rays vote on the sign: one alone errs once in millions of points.
    return np.asarray(scene.compute_signed_distance(query, nthreads=1, nsamples=3).numpy())


def signed_distance_torch(
    vertices: NDArray[np.floating], faces: NDArray[np.integer], points: NDArray[np.floating], device: str = "cpu"
) -> NDArray[np.float32]:
    """As `signed_distance`, brute force over all triangles, the sign from the winding number (Jacobson et al. 2013)."""
    import torch

    corner = np.asarray(vertices, np.float32)[faces].transpose(1, 2, 0)  # (3 corners, 3 axes, F)
    corners = torch.as_tensor(np.ascontiguousarray(corner), device=device)[:, :, None]
    where = torch.as_tensor(np.ascontiguousarray(np.asarray(points, np.float32).T), device=device)
    result = []
    step = max(1, (CHUNK_CPU if device == "cpu" else CHUNK) // len(faces))
    for first in range(0, where.shape[1], step):
        block = where[:, first : first + step, None]
        sign = torch.where(_winding(corners - block) > 0.5, -1.0, 1.0)
        result.append(sign * _distance(corners, block))
    return np.asarray(torch.cat(result).cpu().numpy(), np.float32)


def _dot(u: torch.Tensor, v: torch.Tensor) -> torch.Tensor:
    """Dot product of vectors whose axes come first, so that each axis is one contiguous array."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _cross(u: torch.Tensor, v: torch.Tensor) -> torch.Tensor:
    import torch

    return torch.stack([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])


def _winding(corners: torch.Tensor) -> torch.Tensor:
    """(P,) winding number from corners relative to points, (3, 3, P, F) (van Oosterom and Strackee 1983)."""
    import torch

    a, b, c = corners
    la, lb, lc = (_dot(v, v).sqrt() for v in (a, b, c))
    top = _dot(a, _cross(b, c))
    bottom = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
    return torch.atan2(top, bottom).double().sum(-1) / (2.0 * torch.pi)


def _distance(corners: torch.Tensor, points: torch.Tensor) -> torch.Tensor:
    """(P,) distance of points (3, P, 1) to the nearest of triangles (3, 3, 1, F).

    To the plane where the point projects inside of the triangle, else to an edge.
    """
    import torch

    a, b, c = corners
    normal = _cross(b - a, c - a)
    area2 = _dot(normal, normal).clamp(min=1e-20)
    best, inside = None, None
    for p, q in ((a, b), (b, c), (c, a)):
        edge, away = q - p, p - points
        t = (-_dot(away, edge) / _dot(edge, edge).clamp(min=1e-20)).clamp(0.0, 1.0)
        nearest = away + t * edge
        square = _dot(nearest, nearest)
        best = square if best is None else torch.minimum(best, square)
        # edge x (point - p) along the normal
        left = _dot(_cross(normal, edge), away) <= 0
        inside = left if inside is None else inside & left
    plane = _dot(a - points, normal).square() / area2
    assert best is not None
    assert inside is not None
    return torch.where(inside, torch.minimum(plane, best), best).amin(-1).sqrt()
