"""Fillets between the layers: what grows out of a body does so in a curve, what only rests against it does not.

Parts of one layer share one surface. Kinematic neighbours of different layers melt together, but not at the drawn
contour, which stays as it is; a hand on a hip keeps its crease.
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
"""Surfaces nearer to each other than this melt together, FIGURE units; less where a part is thinner."""

NEIGHBOURS = PART_NEIGHBOURS | {
    frozenset((PART["garment"], PART[f"{side}_{leg}"])) for side in SIDES for leg in ("upper_leg", "lower_leg")
}
"""Pairs of part labels between which fillets are laid."""


def make_fillets(
    canvas: Canvas, parts: Sequence[PartSdf], layer_of: Sequence[int]
) -> tuple[tuple[int, int, PartSdf], ...]:
    """(first, second, fillet) for all pairs of kinematic neighbours in different layers.

    layer_of : for each part the number of its layer
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
    """A fillet that shrinks to nothing towards the drawn contour: it is a quarter of its radius deep at most."""
    axis = np.linspace(-fillet.edge / 2, fillet.edge / 2, fillet.grid.shape[0])
    columns = np.stack(np.meshgrid(fillet.centre[0] + axis, fillet.centre[1] + axis, indexing="ij"), axis=-1)
    share = np.clip(-canvas.sample(canvas.sdf, columns) / radius, 0.0, 1.0)
    lost = 0.25 * radius * (1.0 - share * share * (3.0 - 2.0 * share))
    grid = (fillet.grid + lost[..., None]).astype(np.float32)
    return PartSdf(fillet.part, grid, fillet.centre, fillet.edge, fillet.observed)
