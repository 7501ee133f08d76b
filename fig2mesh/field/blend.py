"""Smooth blending of two parts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.distance import negative_bounds
from fig2mesh.field.evaluate import evaluate
from fig2mesh.field.grids import pack
from fig2mesh.records import PartSdf

_COARSE = 24
"""Nodes per axis of the coarse grid on which a fillet is located."""


def blend(first: PartSdf, second: PartSdf, radius: float, *, creases_only: bool = False) -> PartSdf | None:
    """Fillet that a smooth minimum adds to the union of two parts, as a grid of its own; None where none is needed.

    radius : FIGURE units; surfaces nearer to each other than this are blended (polynomial smooth minimum, Quilez).
    creases_only : less, the less the gradients of the parts differ: where two parts share a surface the plain minimum
        swells by a quarter of the radius (after Gourmel et al. 2013, "A gradient-based implicit blend")

    Parts and fillet in one union give the smooth union, and a union without fillets costs nothing extra. Away from
    the fillet the grid is set a little outside of the parts, so that the parts themselves keep their own surface.
    """
    spacing = min(first.spacing, second.spacing)
    boxes = [negative_bounds(part.grid) for part in (first, second)]
    if boxes[0] is None or boxes[1] is None:
        return None
    grown = [
        part.origin + box * part.spacing + np.array([[-1.0], [1.0]]) * 1.25 * radius
        for part, box in zip((first, second), (boxes[0], boxes[1]), strict=True)
    ]
    low, high = np.maximum(grown[0][0], grown[1][0]), np.minimum(grown[0][1], grown[1][1])

    alone = [pack([part], [(0, 0)]) for part in (first, second)]

    def field(lines: list[NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        points = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
        (a, _, to_a), (b, _, to_b) = (evaluate(packed, points, with_gradients=creases_only) for packed in alone)
        overlap, union = np.clip(1 - np.abs(a - b) / radius, 0, 1), np.minimum(a, b)
        if creases_only:
            lengths = np.linalg.norm(to_a, axis=1) * np.linalg.norm(to_b, axis=1)
            cosine = (to_a * to_b).sum(axis=1) / np.maximum(lengths, 1e-12)
            # All of it from a right angle on.
            overlap *= np.clip(1 - cosine, 0, 1)
        fillet = union - 0.25 * radius * overlap**2 + 0.5 * spacing * (1 - overlap) ** 2
        shape = [len(line) for line in lines]
        return fillet.reshape(shape), union.reshape(shape)

    if (low >= high).any():
        return None
    # Two passes: find where the fillet shows on a coarse grid, then sample a cube around it at the parts' resolution.
    fillet, union = field([np.linspace(a, b, _COARSE) for a, b in zip(low, high, strict=True)])
    step = (high - low) / (_COARSE - 1)
    near = np.argwhere((fillet <= step.max()) & (union >= -step.max()) & (fillet < union))
    if len(near) == 0:
        return None
    low, high = low + (near.min(axis=0) - 2) * step, low + (near.max(axis=0) + 2) * step
    centre, edge = ((low + high) / 2).astype(np.float32), float((high - low).max())
    nodes = int(np.clip(np.ceil(edge / spacing) + 1, 16, 96))
    offsets = np.linspace(-edge / 2, edge / 2, nodes)
    grid, _ = field([float(c) + offsets for c in centre])
    # The cube cuts the fillet off inside of the bodies: round it off there, or its faces would be a surface.
    inset = 1.5 * edge / (nodes - 1) - (edge / 2 - np.abs(offsets))
    for axis in range(3):
        grid = np.maximum(grid, inset.reshape([-1 if i == axis else 1 for i in range(3)]))
    return PartSdf(first.part, grid.astype(np.float32), centre, edge, first.observed and second.observed)
