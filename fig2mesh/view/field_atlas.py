"""Part fields as bricks of one 3D texture.

A browser filters 16-bit textures only, with one fetch where the compiled kernel reads eight values, and cannot afford
to solve cells as cubics. So a brick is a part's grid cropped to its solid, with limited slope: far from the surface
networks and carved outlines leave values a thousand times too steep, which would cost steps or lose limbs.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.field.blend import blend
from fig2mesh.field.body import Body
from fig2mesh.field.distance import lipschitz, negative_bounds
from fig2mesh.records import FloatArray, PartSdf

MARGIN: Final = 3
"""Nodes kept around the negative region: normals read one node further, outlines two."""

MAX_STEP: Final = 1.5
"""Maximum difference of neighbouring values, nodes. One in fifty cells of the surface is steeper, where an outline was
carved; there the surface moves by a third of a cell at most."""

NEAR: Final = 3.0
"""Values beyond this many nodes only limit the step of a ray: neighbours differ by at most 1, and they are rounded."""

OUTSIDE: Final = 24.0
INSIDE: Final = 4.0
"""Bounds of values, nodes."""

SPECK: Final = 27
"""Minimum number of nodes of an island; smaller ones are errors of the network, which the mesher drops as well."""

MAX_VOXELS: Final = 4_000_000
"""Nodes of all bricks together; figures with more are resampled, so that pages stay below some 12 MB."""

MAX_NODES: Final = 254
"""Nodes along an edge; every WebGL 2 supports 3D textures of 256 texels per edge."""


@dataclass(frozen=True)
class Brick:
    """A grid cropped to its solid.

    values : (a, b, c) float16 indexed [x, y, z], FIGURE units, negative inside, with limited slope
    origin : (3,) float64 FIGURE, of node (0, 0, 0); spacing : of the nodes, FIGURE units
    slope : Lipschitz bound of the interpolant where it is positive
    box : (2, 3) float64 FIGURE, around the negative region
    owners : index of the part in the body, twice; for a fillet, indices of the two parts that it joins
    """

    values: NDArray[np.float16]
    origin: NDArray[np.float64]
    spacing: float
    slope: float
    box: NDArray[np.float64]
    owners: tuple[int, int]


@dataclass(frozen=True)
class FieldAtlas:
    """Atlas of part fields.

    bricks : of parts first, then of fillets; parts : number of those of parts
    places : (B, 3) texel of each brick's first node; size : (3,) texels of the whole texture
    """

    bricks: tuple[Brick, ...]
    parts: int
    places: NDArray[np.int_]
    size: tuple[int, int, int]

    def values(self) -> NDArray[np.float16]:
        """Values of all bricks, one brick after the other, x fastest."""
        return np.concatenate([brick.values.ravel(order="F") for brick in self.bricks])


def field_atlas(body: Body) -> FieldAtlas:
    """Make bricks of a body's grids that have a surface, and pack them into the texture."""
    grids = [(part, (i, i)) for i, part in enumerate(body.parts)]
    for first, second, radius in body.smooth:
        fillet = blend(body.parts[first], body.parts[second], radius)
        if fillet is not None:
            grids.append((fillet, (first, second)))
    grids += [(fillet, (first, second)) for first, second, fillet in body.fillets]
    crops = [(crop, owners) for grid, owners in grids if (crop := _cut(grid)) is not None]
    shrink = max(1.0, (sum(crop.values.size for crop, _ in crops) / MAX_VOXELS) ** (1 / 3))
    bricks = tuple(brick for crop, owners in crops if (brick := _brick(crop, owners, shrink)) is not None)
    if not bricks:
        raise ValueError("body: no grid has a negative value, expected a surface")
    places, size = _shelves([brick.values.shape for brick in bricks])
    return FieldAtlas(bricks, sum(brick.owners[0] == brick.owners[1] for brick in bricks), places, size)


@dataclass(frozen=True)
class _Crop:
    """Nodes around a solid, and the cube (2, 3) in FIGURE that bounds it."""

    values: FloatArray
    origin: NDArray[np.float64]
    spacing: float
    cube: NDArray[np.float64]


def _cut(part: PartSdf) -> _Crop | None:
    grid = _without_specks(part.grid, part.spacing)
    bounds = negative_bounds(grid)
    if bounds is None:
        return None
    first = np.floor(bounds[0]).astype(int) - MARGIN
    last = np.ceil(bounds[1]).astype(int) + MARGIN
    n = grid.shape[0]
    inner = tuple(slice(max(a, 0), min(b, n - 1) + 1) for a, b in zip(first, last, strict=True))
    beyond = [(max(-a, 0), max(b - n + 1, 0)) for a, b in zip(first, last, strict=True)]
    values = np.pad(grid[inner], beyond, mode="edge")
    # Extend the values beyond the cube as in `Body`; a part that is still negative at its faces ends there.
    nodes = [np.arange(a, b + 1) for a, b in zip(first, last, strict=True)]
    away = [line - line.clip(0, n - 1) for line in nodes]
    squared = sum(np.square(offset) for offset in np.ix_(*away)) * part.spacing**2
    values = np.where(squared > 0, np.sqrt(squared + np.maximum(values, 0) ** 2), values).astype(np.float32)
    corner = part.centre.astype(np.float64) - float(part.edge) / 2
    return _Crop(values, corner + first * part.spacing, part.spacing, np.stack([corner, corner + float(part.edge)]))


def _without_specks(grid: FloatArray, spacing: float) -> FloatArray:
    islands, count = ndimage.label(grid <= 0, np.ones((3, 3, 3)))
    if count < 2:
        return grid
    nodes = np.bincount(islands.ravel())
    nodes[0] = 0
    small = nodes < min(SPECK, nodes.max())
    small[0] = False
    return np.where(small[islands], np.float32(spacing), grid)


def _brick(crop: _Crop, owners: tuple[int, int], shrink: float) -> Brick | None:
    """Brick of a crop; None if it is thinner than the resampled nodes, and so invisible."""
    values, spacing = crop.values, crop.spacing
    shrink = max(shrink, (max(values.shape) - 1) / (MAX_NODES - 1))
    if shrink > 1:
        counts = [max(int(np.ceil((n - 1) / shrink)) + 1, 2) for n in values.shape]
        lines = [np.minimum(np.arange(count) * shrink, n - 1) for count, n in zip(counts, values.shape, strict=True)]
        at = np.stack(np.meshgrid(*lines, indexing="ij"))
        values, spacing = ndimage.map_coordinates(values, at, order=1), spacing * shrink
    halves = _limited(values, spacing).astype(np.float16)
    limited = halves.astype(np.float32)
    bounds = negative_bounds(limited)
    if bounds is None:
        return None
    box = np.clip(crop.origin + (bounds + _BOX_MARGIN) * spacing, *crop.cube)
    slope = max(lipschitz(limited, spacing, outside=True), 1.0)
    return Brick(halves, crop.origin, spacing, slope, box, owners)


_BOX_MARGIN = np.array([[-1e-3], [1e-3]])


def _limited(values: FloatArray, spacing: float) -> FloatArray:
    """Limit the range of values, and their slope outside of the solid; signs do not change."""
    outside = values > 0
    size = np.where(outside, np.minimum(values / spacing, OUTSIDE), 0).astype(np.float32)
    # In both directions along each axis; twice, because the permitted difference depends on the value.
    for axis in (0, 1, 2, 0, 1, 2):
        for layers in (np.moveaxis(size, axis, 0), np.moveaxis(size, axis, 0)[::-1]):
            for before, layer in pairwise(layers):
                np.minimum(layer, before + np.where(before < NEAR, np.float32(MAX_STEP), np.float32(1)), out=layer)
    size = np.where(size > NEAR, np.floor(size * 4) / 4, size)
    return np.asarray(np.where(outside, size * spacing, np.maximum(values, -INSIDE * spacing)), np.float32)


def _shelves(shapes: list[tuple[int, ...]]) -> tuple[NDArray[np.int_], tuple[int, int, int]]:
    """Pack boxes into a texture 256 texels wide and high, in shelves, largest first; return places and size."""
    width = height = MAX_NODES + 2
    places = np.zeros((len(shapes), 3), int)
    x = y = z = row = layer = 0
    for i in sorted(range(len(shapes)), key=lambda i: (-shapes[i][2], -shapes[i][1], i)):
        a, b, c = shapes[i]
        if x + a > width:
            x, y, row = 0, y + row, 0
        if y + b > height:
            x, y, z, row, layer = 0, 0, z + layer, 0, 0
        places[i] = x, y, z
        x, row, layer = x + a, max(row, b), max(layer, c)
    ends = places + np.array(shapes)
    a, b, c = (int(end) for end in ends.max(axis=0))
    return places, (a, b, c)
