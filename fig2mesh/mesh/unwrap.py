"""Texture coordinates: a solid is cut into charts, which are packed into one square texture.

xatlas, 20,000 triangles: 0.8 s with `max_cost` 1, 2 s with its default of 2, for 180 charts instead of 140 and the same
stretch. Its time grows faster than the mesh (60,000: 7 s), so larger meshes are handed over in patches (3 s), which
brings no more charts, rather fewer. Turned charts are off because xatlas mirrors some (a quarter of all triangles).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fig2mesh.mesh.topology import face_areas
from fig2mesh.records import BoolArray, Mesh, UvMesh

MAX_COST = 1.0
"""Cost at which a chart stops growing."""

MAX_PATCH = 8_000
"""Triangles of the largest patch given to xatlas in one piece."""

ESTIMATE = 0.78
"""Share of the size that is requested of xatlas, which exceeds the requested size by a quarter; with it, charts about
fit."""

FILL = 0.62
"""Share of a texture that charts of figures fill."""

MAX_DRAWN_SHARE = 0.6
"""Largest share of that for the observed surface."""

MIN_DENSITY = 0.45
"""Least density of the rest, texels per unit of length, relative to the observed surface."""


@dataclass(frozen=True)
class Drawn:
    """Part of a mesh that the drawing shows.

    faces : (F,) bool, triangles that are wholly visible
    pixels : (V, 2) float64, positions of the vertices in the drawing, pixels, y down
    line_pixels, line_faces : (L, 2) and (M, 3) int, the same of a ribbon that shows the drawn contour
    """

    faces: BoolArray
    pixels: NDArray[np.float64]
    line_pixels: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    line_faces: NDArray[np.int32] = field(default_factory=lambda: np.empty((0, 3), np.int32))


def unwrap(mesh: Mesh, *, texture_size: int, padding: int = 4, drawn: Drawn | None = None) -> UvMesh:
    """Texture coordinates for a closed, oriented mesh.

    Parameters
    ----------
    mesh : FIGURE (any unit will do)
    texture_size : texels along each side of the square texture
    padding : least distance between charts, texels; less only where tens of charts are to fit into a tiny texture
    drawn : the visible part lies in the texture as in the drawing, one texel per pixel where the texture is large
        enough, and the rest has no more texels per unit of length; None: nothing is drawn

    Returns
    -------
    A `UvMesh` whose charts have the same number of texels per unit of length in both directions and, except what is
    drawn, everywhere, do not overlap, and are not mirrored: the texture shows the surface as viewed from outside.
    Charts smaller than a texel are enlarged to one.
    """
    if texture_size < 16 or padding < 0:
        raise ValueError(f"texture_size {texture_size}, padding {padding}: expected at least 16 and 0 texels")
    if len(mesh.faces) == 0:
        raise ValueError("mesh: has no faces to unwrap")
    if drawn is not None and drawn.faces.any():
        found = _with_drawing(mesh, drawn, texture_size, padding)
        if found is not None:
            return found
    wish = ESTIMATE * texture_size
    for _ in range(3):
        source, faces, texels, size = _pack(mesh, max(int(wish), 8), padding + 1)
        scale = texture_size / max(size)
        if scale * (padding + 1) >= padding:
            break
        # Padding takes a larger share of small textures than the estimate assumes.
        wish *= scale
    uv = np.clip(_upright(texels, max(size)) / max(size), 0.0, 1.0).astype(np.float32)
    return UvMesh(mesh, faces.astype(np.int32), source.astype(np.int32), uv, (texture_size, texture_size))


def _with_drawing(mesh: Mesh, drawn: Drawn, texture_size: int, padding: int) -> UvMesh | None:
    """Pack charts laid out as in the drawing together with charts of the rest; None where they do not fit."""
    indices, local = _part(mesh, drawn.faces)
    pixels = drawn.pixels[indices]
    rest = _part(mesh, ~drawn.faces)
    # A drawn pixel is a texel, or less of one where the texture is small.
    line = drawn.line_pixels, drawn.line_faces.astype(np.int64)
    seen = float(_flat_areas(pixels, local).sum())
    area = seen + float(_flat_areas(*line).sum())
    usable = FILL * texture_size**2
    longest = float(np.ptp(np.concatenate([pixels, line[0]]), axis=0).max())
    scale = min(1.0, math.sqrt(MAX_DRAWN_SHARE * usable / max(area, 1e-9)), (texture_size - 4 * padding - 4) / longest)
    units = math.sqrt(seen / max(float(face_areas(mesh)[drawn.faces].sum()), 1e-12)) * scale
    layout = None
    if len(rest[1]):
        piece = Mesh(mesh.vertices[rest[0]], rest[1].astype(np.int32))
        source, faces, texels, _ = _pack(piece, texture_size, padding + 1)
        layout = source, faces, _upright(texels, texels[:, 1].max())
        covered = max(float(_flat_areas(texels, faces).sum()), 1e-9)
        lengths = math.sqrt(covered / max(float(face_areas(piece).sum()), 1e-12))
        wanted = math.sqrt(max(usable - area * scale**2, 0.1 * usable) / covered)
        factor = min(wanted, units / lengths)
    for _ in range(12):
        charts = [(pixels * scale, local)]
        if layout is not None:
            charts.append((layout[2] * factor, layout[1]))
        if len(line[1]):
            charts.append((line[0] * scale, line[1]))
        placed = _place(charts, texture_size, padding + 1)
        if placed is not None:
            break
        if layout is not None and factor * lengths > MIN_DENSITY * units:
            factor *= 0.92
        else:
            scale *= 0.92
            units *= 0.92
    else:
        return None
    sources, all_faces, positions, count = [], np.empty((len(mesh.faces), 3), np.int64), [], 0
    own = [indices] if layout is None else [indices, rest[0][layout[0]]]
    for chosen, vertex, (position, faces) in zip((drawn.faces, ~drawn.faces), own, placed, strict=False):
        all_faces[chosen] = faces + count
        sources.append(vertex)
        positions.append(position)
        count += len(vertex)
    uv = np.clip(np.concatenate(positions) / texture_size, 0.0, 1.0).astype(np.float32)
    sourced = np.concatenate(sources).astype(np.int32)
    line_uv = np.clip(placed[-1][0] / texture_size, 0.0, 1.0).astype(np.float32) if len(line[1]) else None
    return UvMesh(mesh, all_faces.astype(np.int32), sourced, uv, (texture_size, texture_size), line_uv)


def _upright(texels: NDArray[np.float64], height: float) -> NDArray[np.float64]:
    """xatlas has v upwards, pictures have rows downwards."""
    return np.stack([texels[:, 0], height - texels[:, 1]], axis=1)


def _part(mesh: Mesh, chosen: BoolArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Vertices of some faces, and the faces among them."""
    indices, local = np.unique(mesh.faces[chosen], return_inverse=True)
    return indices.astype(np.int64), local.reshape(-1, 3).astype(np.int64)


def _flat_areas(points: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """(F,) areas of triangles in the plane."""
    a, b, c = (points[faces[:, i]] for i in range(3))
    first, second = b - a, c - a
    return np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2


def _place(
    charts: list[tuple[NDArray[np.float64], NDArray[np.int64]]], resolution: int, padding: int
) -> list[tuple[NDArray[np.float64], NDArray[np.int64]]] | None:
    """Layouts (positions in texels, faces) with their charts moved so that they fit; None where they do not.

    Charts move by whole texels and are not scaled: xatlas widens them to whole texels, so only its positions are used.
    """
    import xatlas

    atlas = xatlas.Atlas()
    for positions, faces in charts:
        atlas.add_uv_mesh(positions.astype(np.float32), faces.astype(np.uint32))
    packing = xatlas.PackOptions()
    packing.rotate_charts = packing.rotate_charts_to_axis = False
    packing.texels_per_unit = 1.0
    packing.resolution = resolution
    packing.padding = padding
    packing.bilinear = True
    atlas.generate(xatlas.ChartOptions(), packing)
    if atlas.atlas_count != 1 or max(atlas.width, atlas.height) > resolution:
        return None
    size = np.array([atlas.width, atlas.height], np.float64)
    result = []
    for number, (positions, faces) in enumerate(charts):
        vertex, _, uv = atlas[number]
        # Charts are numbered across all layouts.
        _, chart = np.unique(np.asarray(atlas.get_mesh_vertex_assignment(number)[1]), return_inverse=True)
        found, before = uv.astype(np.float64) * size, positions[vertex]
        low, start = _lowest(found, chart), _lowest(before, chart)
        # xatlas silently shrinks what does not fit.
        if (-_lowest(-found, chart) - low < -_lowest(-before, chart) - start - 0.5).any():
            return None
        moved = before + np.round(low - start)[chart]
        if moved.min() < -0.5 or moved.max() > resolution + 0.5:
            return None
        # xatlas splits vertices between charts only, so faces keep their corners.
        by_source = np.empty((len(positions), 2))
        by_source[vertex] = moved
        result.append((by_source, faces))
    return result


def _lowest(points: NDArray[np.float64], chart: NDArray[np.int64]) -> NDArray[np.float64]:
    """(C, 2) lowest coordinates of the points of each chart."""
    result = np.full((int(chart.max()) + 1, 2), np.inf)
    np.minimum.at(result, chart, points)
    return result


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
        raise RuntimeError(f"xatlas: made {atlas.atlas_count} textures instead of one; use a larger texture")
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
    if len(faces) <= MAX_PATCH:
        return [faces]
    chosen = middles[faces]
    order = np.argsort(chosen[:, np.ptp(chosen, axis=0).argmax()], kind="stable")
    half = len(faces) // 2
    return _patches(middles, np.sort(faces[order[:half]])) + _patches(middles, np.sort(faces[order[half:]]))
