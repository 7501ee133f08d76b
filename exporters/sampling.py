"""Sampling of textures at texture coordinates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from exporters.asset import ByteArray, Texture, TexturedMesh


def sample(texture: Texture, uv: NDArray[np.floating]) -> ByteArray:
    """Sample a texture with bilinear interpolation.

    texture : (H, W, C); uv : (N, 2) float, v = 0 at image row 0, clamped to [0, 1]
    returns : (N, C) uint8
    """
    pixels = texture.pixels
    size = np.array([pixels.shape[1], pixels.shape[0]])
    # Texel centres lie at half integers, as in the samplers of glTF viewers.
    place = np.clip(np.asarray(uv, dtype=np.float64), 0.0, 1.0) * size - 0.5
    place = np.clip(place, 0.0, size - 1.0)
    low = np.floor(place).astype(np.int64)
    high = np.minimum(low + 1, size - 1)
    right, down = (place - low).T
    blend = sum(
        pixels[row, column].astype(np.float64) * (weight_row * weight_column)[:, None]
        for row, weight_row in ((low[:, 1], 1 - down), (high[:, 1], down))
        for column, weight_column in ((low[:, 0], 1 - right), (high[:, 0], right))
    )
    return np.asarray(np.rint(blend), dtype=np.uint8)


def vertex_colors(mesh: TexturedMesh) -> ByteArray | None:
    """Colours (V, 3) uint8 sRGB of the vertices: the mesh's own, else sampled from its texture; None if neither."""
    if mesh.colors is not None:
        return mesh.colors
    if mesh.texture is None or mesh.uv is None:
        return None
    samples = sample(mesh.texture, mesh.uv)
    return np.repeat(samples, 3, axis=1) if samples.shape[1] == 1 else samples[:, :3]


def face_parts(mesh: TexturedMesh) -> ByteArray:
    """Part label (F,) uint8 of each triangle: that of at least two corners, else of the first corner."""
    assert mesh.parts is not None
    first, second, third = mesh.parts[mesh.faces].T
    return np.asarray(np.where(second == third, second, first), dtype=np.uint8)


_SPLIT = 4
"""Triangles are sampled at the centres of 16 equal pieces: 1 % noise per part, 20 k triangles in 50 ms."""


def observed_shares(mesh: TexturedMesh) -> dict[int, float] | None:
    """Observed share of each part's surface, label → [0, 1]; None if unknown."""
    if mesh.parts is None or mesh.observed is None or mesh.uv is None:
        return None
    centres = []
    for row in range(_SPLIT):
        for column in range(_SPLIT - row):
            centres.append((column + 1 / 3, row + 1 / 3))
            if column + row < _SPLIT - 1:
                centres.append((column + 2 / 3, row + 2 / 3))
    second, third = np.array(centres).T / _SPLIT
    weights = np.stack([1 - second - third, second, third], axis=1)
    corners = mesh.uv[mesh.faces].astype(np.float64)
    points = np.einsum("kc,fcx->fkx", weights, corners)
    observed = sample(mesh.observed, points.reshape(-1, 2))[:, 0].reshape(len(corners), -1).mean(axis=1) / 255.0
    # Weighted by area in space: observed surface has more texels than the rest.
    placed = mesh.vertices[mesh.faces].astype(np.float64)
    area = np.linalg.norm(np.cross(placed[:, 1] - placed[:, 0], placed[:, 2] - placed[:, 0]), axis=1)
    parts = face_parts(mesh)
    total = np.bincount(parts, weights=area, minlength=256)
    visible = np.bincount(parts, weights=area * observed, minlength=256)
    # A vertex label may not be the majority of any triangle: nothing of such a part is observed.
    return {
        int(label): float(visible[label] / total[label]) if total[label] else 0.0 for label in np.unique(mesh.parts)
    }


def observed_share(mesh: TexturedMesh) -> float | None:
    """Observed share of the whole surface, in [0, 1]; None if unknown."""
    shares = observed_shares(replace(mesh, parts=np.zeros(len(mesh.vertices), np.uint8)))
    return None if shares is None else shares.get(0, 0.0)
