"""Fillets between layers, where a part grows out of the body, and none where it only rests against it.

Parts of one layer share one surface. Kinematic neighbours of different layers are blended, but not at the drawn
contour, which is unchanged; a hand on a hip keeps its crease.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from fig2mesh.field.blend import blend
from fig2mesh.parts.canvas import Canvas
from fig2mesh.records import PartSdf
from fig2mesh.skeleton import PART, PART_NEIGHBOURS, SIDES

RADIUS = 0.04
"""Blend radius, FIGURE units: surfaces nearer to each other than this are blended; less where a part is thinner."""

NEIGHBOURS = PART_NEIGHBOURS | {
    frozenset((PART["garment"], PART[f"{side}_{leg}"])) for side in SIDES for leg in ("upper_leg", "lower_leg")
}
"""Pairs of part labels that get fillets."""


def make_fillets(
    canvas: Canvas, parts: Sequence[PartSdf], layer_of: Sequence[int]
) -> tuple[tuple[int, int, PartSdf], ...]:
    """(first, second, fillet) for all pairs of kinematic neighbours in different layers.

    layer_of : layer number of each part
    """
    thickness = [-float(part.grid.min()) for part in parts]
    found = []
    for first, second in combinations(range(len(parts)), 2):
        pair = frozenset((parts[first].part, parts[second].part))
        if layer_of[first] == layer_of[second] or pair not in NEIGHBOURS:
            continue
        radius = min(RADIUS, thickness[first], thickness[second])
        fillet = blend(parts[first], parts[second], radius) if radius > 0 else None
        if fillet is not None:
            found.append((first, second, within(canvas, fillet, radius)))
    return tuple(found)


def within(canvas: Canvas, fillet: PartSdf, radius: float) -> PartSdf:
    """Shrink a fillet to nothing towards the drawn contour: it is at most a quarter of its radius deep."""
    axis = np.linspace(-fillet.edge / 2, fillet.edge / 2, fillet.grid.shape[0])
    columns = np.stack(np.meshgrid(fillet.centre[0] + axis, fillet.centre[1] + axis, indexing="ij"), axis=-1)
    share = np.clip(-canvas.sample(canvas.sdf, columns) / radius, 0.0, 1.0)
    lost = 0.25 * radius * (1.0 - share * share * (3.0 - 2.0 * share))
    grid = (fillet.grid + lost[..., None]).astype(np.float32)
    return PartSdf(fillet.part, grid, fillet.centre, fillet.edge, fillet.observed)
