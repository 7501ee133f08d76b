"""Orthographic rasterisation of triangle meshes, in NumPy alone.

The viewing direction is -z. Pixel (row, col) has its centre at x = low[0] + (col + 0.5) pitch and
y = high - (row + 0.5) pitch, high = low[1] + size pitch: row 0 is on top. All triangles are drawn at once: the pixels
of their bounding boxes are listed, those inside kept, the nearest of each pixel found.

Measured on one core: 27,000 triangles at 256 x 256 in 18 ms (10 ms without their far side), 3,000 at 64 x 64 in 1 ms;
`coverage` takes four fifths of that.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

SLACK = 1e-9
"""Barycentric tolerance: a pixel centre on a shared edge counts for both triangles, so that no crack opens."""
AT_ONCE = 1 << 21
"""Candidate pixels per batch, some 200 MB of memory."""


class Raster(NamedTuple):
    """Visible face, depth and barycentric weights of each pixel.

    face : (H, W) int32, row of `faces`; -1 where nothing
    depth : (H, W) float32, z of the surface nearest to the viewer; -inf where nothing
    bary : (H, W, 3) float32, weights of the face's corners; zeros where nothing
    """

    face: NDArray[np.int32]
    depth: NDArray[np.float32]
    bary: NDArray[np.float32]

    @property
    def mask(self) -> NDArray[np.bool_]:
        """(H, W) bool: pixels in which a face is visible."""
        return self.face >= 0

    def blend(self, values: NDArray[Any], faces: NDArray[Any]) -> NDArray[np.float32]:
        """(H, W, ...) float32 interpolation of values at the vertices (V, ...); zeros where no face is visible."""
        seen = self.mask
        out = np.zeros((*self.face.shape, *values.shape[1:]), np.float32)
        corners = np.asarray(values, np.float32)[np.asarray(faces)[self.face[seen]]]
        out[seen] = np.einsum("nc,nc...->n...", self.bary[seen], corners)
        return out

    def pick(self, values: NDArray[Any], nothing: Any = 0) -> NDArray[Any]:
        """(H, W, ...) value of the visible face, of (F, ...); `nothing` where no face is visible."""
        out = np.full((*self.face.shape, *values.shape[1:]), nothing, values.dtype)
        out[self.mask] = values[self.face[self.mask]]
        return out


class _Inside(NamedTuple):
    """Pixels inside triangles: pixel (n,) flat index; face (n,); weights (3, n)."""

    pixel: NDArray[np.int64]
    face: NDArray[np.int64]
    weights: NDArray[np.float64]


def rasterise(
    vertices: NDArray[Any], faces: NDArray[Any], *, size: int, low: Any, pitch: float, cull: bool = False
) -> Raster:
    """Find the nearest face in every pixel.

    vertices : (V, 3) float, z to the viewer
    faces : (F, 3) int; both sides are visible
    size : edge of the picture, pixels; low : (2,) x and y of the lower left corner; pitch : edge of a pixel
    cull : back-face culling; allowed for closed surfaces that are counter-clockwise from outside
    """
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    face = np.full(size * size, -1, np.int32)
    depth = np.full(size * size, -np.inf, np.float32)
    bary = np.zeros((size * size, 3), np.float32)
    for hit in _inside(vertices, faces, size, low, pitch, cull):
        corner = vertices[:, 2][faces[hit.face]]
        z = (hit.weights.T * corner).sum(axis=1).astype(np.float32)
        before = depth[hit.pixel]
        np.maximum.at(depth, hit.pixel, z)
        # On equal depths several faces are written, and the last one stays, its weights with it.
        won = np.flatnonzero((z == depth[hit.pixel]) & (z > before))
        face[hit.pixel[won]] = hit.face[won]
        bary[hit.pixel[won]] = hit.weights[:, won].T
    return Raster(face.reshape(size, size), depth.reshape(size, size), bary.reshape(size, size, 3))


def coverage(
    vertices: NDArray[Any], faces: NDArray[Any], *, size: int, low: Any, pitch: float, cull: bool = False
) -> NDArray[np.bool_]:
    """(H, W) bool: pixels whose centre a face covers; arguments as for `rasterise`."""
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    out = np.zeros(size * size, np.bool_)
    for hit in _inside(vertices, faces, size, low, pitch, cull):
        out[hit.pixel] = True
    return out.reshape(size, size)


def _inside(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], size: int, low: Any, pitch: float, cull: bool
) -> list[_Inside]:
    """The pixel centres inside each triangle, in batches."""
    low_x, low_y = (float(value) for value in low)
    # In pixels from the upper left; centres lie on the integers.
    x = ((vertices[:, 0] - low_x) / pitch - 0.5)[faces.T]
    y = (size - (vertices[:, 1] - low_y) / pitch - 0.5)[faces.T]
    left = np.maximum(np.ceil(x.min(axis=0) - SLACK), 0).astype(np.int64)
    top = np.maximum(np.ceil(y.min(axis=0) - SLACK), 0).astype(np.int64)
    wide = np.minimum(np.floor(x.max(axis=0) + SLACK), size - 1).astype(np.int64) - left + 1
    tall = np.minimum(np.floor(y.max(axis=0) + SLACK), size - 1).astype(np.int64) - top + 1
    area = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0])
    # y runs down here, so counter-clockwise faces have a negative area.
    wanted = (wide > 0) & (tall > 0) & ((area < 0) if cull else (area != 0))
    rows = np.flatnonzero(wanted)
    if not len(rows):
        return []
    x, y, area = x[:, rows], y[:, rows], area[rows]
    left, top, wide, count = left[rows], top[rows], wide[rows], (wide * tall)[rows]
    # Edge functions are linear in the pixel: w = at the box's corner + right * column + down * row.
    right = np.stack([y[1] - y[2], y[2] - y[0]]) / area
    down = np.stack([x[2] - x[1], x[0] - x[2]]) / area
    start = right * (left - x[2]) + down * (top - y[2])
    ends = np.cumsum(count)
    cuts = np.searchsorted(ends, np.arange(AT_ONCE, ends[-1], AT_ONCE))
    portions = []
    for part in np.split(np.arange(len(rows)), cuts):
        if len(part):
            portions.append(_portion(part, rows, left, top, wide, count, (start, right, down), size))
    return portions


def _portion(
    part: NDArray[np.int64],
    rows: NDArray[np.int64],
    left: NDArray[np.int64],
    top: NDArray[np.int64],
    wide: NDArray[np.int64],
    count: NDArray[np.int64],
    edges: tuple[NDArray[np.float64], ...],
    size: int,
) -> _Inside:
    start, right, down = edges
    number = count[part]
    owner = np.repeat(part, number)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(number) - number, number)
    row, column = np.divmod(step, wide[owner])
    first, second = start[:, owner] + right[:, owner] * column + down[:, owner] * row
    third = 1.0 - first - second
    keep = np.flatnonzero((first >= -SLACK) & (second >= -SLACK) & (third >= -SLACK))
    owner = owner[keep]
    pixel = (top[owner] + row[keep]) * size + left[owner] + column[keep]
    return _Inside(pixel, rows[owner], np.stack([first[keep], second[keep], third[keep]]))
