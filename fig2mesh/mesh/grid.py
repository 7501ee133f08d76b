"""Sampling of the body's field on a regular grid, evaluated only near the surface.

Of a figure's box less than a tenth of the nodes lie near its surface. Blocks of 4³ nodes are judged by the value at
their centre and evaluated only where they can hold the surface. As fields may overestimate distances, that alone could
cut the surface off at a block that was left out; so wherever a sign change touches such a block it is evaluated after
all, until none does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.mesh.protocol import Field
from fig2mesh.records import BoolArray, FloatArray

BLOCK = 4
"""Nodes along the edge of a block."""

LIPSCHITZ = 1.5
"""Assumed limit of a field's overestimation of distances; the sign check covers worse ones."""

MAX_NODES = 400_000_000
"""Largest number of nodes; a larger grid takes gigabytes and means a wrong unit."""


@dataclass(frozen=True)
class Grid:
    """Sampled field.

    values : (nx, ny, nz) float32, indexed [x, y, z], negative inside, never zero; the outermost nodes are outside
    known : (nx, ny, nz) bool, True where values are the field's own; elsewhere only the sign is correct
    outside : (nx, ny, nz) bool, nodes connected with the space round the body: not inside and not in a cavity
    origin : (3,) float64 position of node (0, 0, 0), FIGURE
    spacing : distance between neighbouring nodes
    """

    values: FloatArray
    known: BoolArray
    outside: BoolArray
    origin: NDArray[np.float64]
    spacing: float


def sample_grid(field: Field, spacing: float) -> Grid:
    """Sample `field` on the grid of the given spacing that covers its bounds with a margin."""
    low, high = np.asarray(field.bounds(), np.float64)
    low = low - 2.5 * spacing
    blocks = np.maximum(np.ceil((high - low + 2.5 * spacing) / (spacing * BLOCK)).astype(int), 1)
    shape = blocks * BLOCK
    if not spacing > 0 or float(np.prod(shape.astype(float))) > MAX_NODES:
        raise ValueError(f"spacing: {spacing} gives a grid of {tuple(shape)} nodes; use a coarser one")
    corner = np.stack(np.meshgrid(*(np.arange(n) for n in blocks), indexing="ij"), axis=-1)
    centres = low + (corner + (BLOCK - 1) / (2 * BLOCK)) * (BLOCK * spacing)
    coarse = field.distance(centres.reshape(-1, 3).astype(np.float32)).reshape(blocks)
    # Half a block plus the cell that joins it to the next one.
    radius = np.sqrt(3) / 2 * (BLOCK + 1) * spacing
    wanted = ~(np.abs(coarse) > LIPSCHITZ * radius)
    values = np.repeat(np.repeat(np.repeat(coarse, BLOCK, 0), BLOCK, 1), BLOCK, 2).astype(np.float32)
    known = np.zeros(tuple(blocks), np.bool_)
    inner = np.stack(np.meshgrid(*(np.arange(BLOCK),) * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    while wanted.any():
        nodes = np.argwhere(wanted)[:, None] * BLOCK + inner
        found = field.distance((low + nodes.reshape(-1, 3) * spacing).astype(np.float32))
        values[tuple(np.moveaxis(nodes.reshape(-1, 3), -1, 0))] = np.where(np.isfinite(found), found, spacing)
        known |= wanted
        wanted = _cut_blocks(values < 0, known)
    known = np.repeat(np.repeat(np.repeat(known, BLOCK, 0), BLOCK, 1), BLOCK, 2)
    for axis in range(3):
        edge = np.moveaxis(values, axis, 0)
        edge[[0, -1]] = np.maximum(edge[[0, -1]], spacing / 2)
    # A node exactly on the surface would make triangles of no area; move it by an invisible amount.
    tiny = np.float32(1e-3 * spacing)
    values = np.where(np.abs(values) < tiny, np.where(values < 0, -tiny, tiny), values)
    return Grid(values, known, _outside(values), low, spacing)


def _cut_blocks(inside: BoolArray, known: BoolArray) -> BoolArray:
    """Blocks not yet evaluated that a sign change touches."""
    cut = np.zeros_like(known)
    for axis in range(3):
        there, back = np.moveaxis(inside, axis, 0), np.moveaxis(known, axis, 0)
        change = there[BLOCK - 1 : -1 : BLOCK] != there[BLOCK::BLOCK]
        count, rows, columns = change.shape
        change = change.reshape(count, rows // BLOCK, BLOCK, columns // BLOCK, BLOCK).any(axis=(2, 4))
        target = np.moveaxis(cut, axis, 0)
        target[:-1] |= change & ~back[:-1]
        target[1:] |= change & ~back[1:]
    return cut


def _outside(values: FloatArray) -> BoolArray:
    labels = ndimage.label(values > 0)[0]
    return np.asarray(labels == labels[0, 0, 0])
