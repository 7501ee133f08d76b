"""Part fields as bricks of one 3D texture.

A browser filters 16-bit textures only, takes one fetch for what the compiled kernel reads eight values for, and cannot
afford to settle cells as cubics. So a brick is a part's grid cut down to its solid, and tamed: far from the surface
networks and carved outlines leave values a thousand times too steep, which would cost steps or, left alone, limbs.
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
"""Nodes kept around the negative region: normals look one node further, outlines two."""

MAX_STEP: Final = 1.5
"""Difference of neighbouring values, nodes. Of the cells that hold the surface one in fifty is steeper, where an
outline was carved; there it moves by a third of a cell at most."""

NEAR: Final = 3.0
"""Values beyond this many nodes only tell how far a step may go: their neighbours differ by 1, and they are rounded."""

OUTSIDE: Final = 24.0
INSIDE: Final = 4.0
"""Nodes: the bounds of values."""

SPECK: Final = 27
"""Nodes; smaller islands beside a part's body are slips of its network, which the mesher drops as well."""

MAX_VOXELS: Final = 4_000_000
"""Of all bricks together; figures with more are resampled, so that pages stay below some 12 MB."""

MAX_NODES: Final = 254
"""Of an edge; every WebGL 2 has 3D textures of 256 texels an edge."""


@dataclass(frozen=True)
class Brick:
    """A grid cut down to its solid.

    values : (a, b, c) float16 indexed [x, y, z], FIGURE units, negative inside, tamed
    origin : (3,) float64 FIGURE, of node (0, 0, 0); spacing : of the nodes, FIGURE units
    slope : Lipschitz bound of the interpolant where it is positive
    box : (2, 3) float64 FIGURE, around the negative region
    owners : indices of the part in the body, twice; for a fillet of the two parts that it joins
    """

    values: NDArray[np.float16]
    origin: NDArray[np.float64]
    spacing: float
    slope: float
    box: NDArray[np.float64]
    owners: tuple[int, int]


@dataclass(frozen=True)
class FieldAtlas:
    """bricks : those of parts first, then of fillets; parts : how many are parts;
    places : (B, 3) texel of each brick's first node; size : (3,) texels of the whole texture."""

    bricks: tuple[Brick, ...]
    parts: int
    places: NDArray[np.int_]
    size: tuple[int, int, int]

    def values(self) -> NDArray[np.float16]:
        """The values of all bricks, one brick after the other, x fastest."""
        return np.concatenate([brick.values.ravel(order="F") for brick in self.bricks])


def field_atlas(body: Body) -> FieldAtlas:
    """The bricks of a body's grids that have a surface, and where each lies in the texture."""
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
        raise ValueError("body: no grid has a negative value, so there is nothing to show")
    places, size = _shelves([brick.values.shape for brick in bricks])
    return FieldAtlas(bricks, sum(brick.owners[0] == brick.owners[1] for brick in bricks), places, size)


@dataclass(frozen=True)
class _Crop:
    """Nodes around a solid, and the cube (2, 3) in FIGURE at which it ends."""

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
    # As `Body` has it outside of a cube; a part that is still negative at its faces ends there.
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
    """The brick of a crop; None where it is thinner than the coarser nodes, so that nothing of it can be seen."""
    values, spacing = crop.values, crop.spacing
    shrink = max(shrink, (max(values.shape) - 1) / (MAX_NODES - 1))
    if shrink > 1:
        counts = [max(int(np.ceil((n - 1) / shrink)) + 1, 2) for n in values.shape]
        lines = [np.minimum(np.arange(count) * shrink, n - 1) for count, n in zip(counts, values.shape, strict=True)]
        at = np.stack(np.meshgrid(*lines, indexing="ij"))
        values, spacing = ndimage.map_coordinates(values, at, order=1), spacing * shrink
    halves = _tamed(values, spacing).astype(np.float16)
    tamed = halves.astype(np.float32)
    bounds = negative_bounds(tamed)
    if bounds is None:
        return None
    box = np.clip(crop.origin + (bounds + _BOX_MARGIN) * spacing, *crop.cube)
    slope = max(lipschitz(tamed, spacing, outside=True), 1.0)
    return Brick(halves, crop.origin, spacing, slope, box, owners)


_BOX_MARGIN = np.array([[-1e-3], [1e-3]])


def _tamed(values: FloatArray, spacing: float) -> FloatArray:
    """Values with the same sign everywhere, bounded, and outside of the solid nowhere steep."""
    outside = values > 0
    size = np.where(outside, np.minimum(values / spacing, OUTSIDE), 0).astype(np.float32)
    # To and fro along each axis; a second time, because the permitted difference depends on the value.
    for axis in (0, 1, 2, 0, 1, 2):
        for layers in (np.moveaxis(size, axis, 0), np.moveaxis(size, axis, 0)[::-1]):
            for before, layer in pairwise(layers):
                np.minimum(layer, before + np.where(before < NEAR, np.float32(MAX_STEP), np.float32(1)), out=layer)
    size = np.where(size > NEAR, np.floor(size * 4) / 4, size)
    return np.asarray(np.where(outside, size * spacing, np.maximum(values, -INSIDE * spacing)), np.float32)


def _shelves(shapes: list[tuple[int, ...]]) -> tuple[NDArray[np.int_], tuple[int, int, int]]:
    """Places of boxes in a texture 256 texels wide and high, row by row and layer by layer, largest first."""
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
