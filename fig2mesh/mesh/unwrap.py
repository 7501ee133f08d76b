"""Cut a solid into charts and pack them into one square texture.

xatlas, 20,000 triangles: 0.8 s with `max_cost` 1, 2 s with its default of 2, for 180 charts instead of 140 and the same
stretch. Its time grows faster than the mesh (60,000: 7 s), so larger meshes are handed over in patches (3 s), which
brings no more charts, rather fewer. Turned charts are off because xatlas mirrors some (a quarter of all triangles).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fig2mesh.mesh.topology import face_areas
from fig2mesh.records import Mesh, UvMesh

MAX_COST = 1.0
"""Cost at which a chart stops growing."""

PATCH = 8_000
"""Triangles of the largest patch that xatlas gets in one piece."""

ESTIMATE = 0.78
"""xatlas takes the size of a texture as a wish and exceeds it by a quarter; asked for this share it about fits."""


def unwrap(mesh: Mesh, *, texture_size: int, padding: int = 4) -> UvMesh:
    """Texture coordinates for a closed, oriented mesh.

    Parameters
    ----------
    mesh : FIGURE (any unit will do)
    texture_size : texels along each side of the square texture
    padding : least distance between charts, texels; less only where tens of charts are to fit into a tiny texture

    Returns
    -------
    A `UvMesh` whose charts have the same number of texels for a unit of length in both directions and everywhere, do
    not overlap, and are nowhere mirrored: no triangle has a negative area in (u, v). Charts smaller than a texel are
    enlarged to one.
    """
    if texture_size < 16 or padding < 0:
        raise ValueError(f"texture_size {texture_size}, padding {padding}: expected at least 16 and 0 texels")
    if len(mesh.faces) == 0:
        raise ValueError("mesh: has no faces to unwrap")
    wish = ESTIMATE * texture_size
    for _ in range(3):
        source, faces, texels, size = _pack(mesh, max(int(wish), 8), padding + 1)
        scale = texture_size / max(size)
        if scale * (padding + 1) >= padding:
            break
        # Padding takes a larger share of small textures than the estimate knows.
        wish *= scale
    uv = np.clip(texels / max(size), 0.0, 1.0).astype(np.float32)
    return UvMesh(mesh, faces.astype(np.int32), source.astype(np.int32), uv, (texture_size, texture_size))


def _pack(
    mesh: Mesh, resolution: int, padding: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], tuple[int, int]]:
    """Source vertex (V,), faces (F, 3) and position (V, 2) in texels of an atlas of the returned size."""
    import xatlas

    areas = face_areas(mesh)
    # xatlas ignores triangles below an absolute area of 1e-7, so they are made about 1 large.
    unit = math.sqrt(float(np.median(areas[areas > 0]))) if (areas > 0).any() else 1.0
    vertices = (mesh.vertices.astype(np.float64) - mesh.vertices.mean(axis=0, dtype=np.float64)) / unit
    atlas = xatlas.Atlas()
    patches = _patches(mesh.vertices[mesh.faces].mean(axis=1), np.arange(len(mesh.faces)))
    used = []
    for patch in patches:
        indices, local = np.unique(mesh.faces[patch], return_inverse=True)
        used.append(indices)
        atlas.add_mesh(vertices[indices].astype(np.float32), local.reshape(-1, 3).astype(np.uint32))
    charts = xatlas.ChartOptions()
    charts.fix_winding = True
    charts.max_cost = MAX_COST
    packing = xatlas.PackOptions()
    packing.rotate_charts = False
    packing.bilinear = True
    packing.padding = padding
    packing.resolution = resolution
    atlas.generate(charts, packing)
    if atlas.atlas_count != 1:
        raise RuntimeError(f"xatlas: made {atlas.atlas_count} textures instead of one; choose a larger texture")
    size = (int(atlas.width), int(atlas.height))
    faces = np.empty((len(mesh.faces), 3), np.int64)
    source, texels, count = [], [], 0
    for number, (patch, indices) in enumerate(zip(patches, used, strict=True)):
        vertex, local, uv = atlas[number]
        faces[patch] = local.astype(np.int64) + count
        source.append(indices[vertex])
        texels.append(uv.astype(np.float64) * size)
        count += len(vertex)
    return np.concatenate(source), faces, np.concatenate(texels), size


def _patches(middles: NDArray[np.float32], faces: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Halve `faces` across their longest extent until no patch is too large."""
    if len(faces) <= PATCH:
        return [faces]
    chosen = middles[faces]
    order = np.argsort(chosen[:, np.ptp(chosen, axis=0).argmax()], kind="stable")
    half = len(faces) // 2
    return _patches(middles, np.sort(faces[order[:half]])) + _patches(middles, np.sort(faces[order[half:]]))
