"""Smooth union of parts: fillets where limbs meet at an angle."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from fig2mesh.field.blend import blend
from fig2mesh.field.body import Body
from fig2mesh.field.evaluate import evaluate
from fig2mesh.field.grids import pack
from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.fillets import NEIGHBOURS, within
from fig2mesh.records import PartSdf

RADIUS = 0.07
"""Blend radius, FIGURE units: surfaces nearer to each other than this are blended; less where a part is thinner."""

SHARED_COSINE = 0.7
"""Threshold, cosine between gradients where both surfaces pass, above which two parts share one surface."""


def smooth_union(body: Body, canvas: Canvas | None = None, radius: float = RADIUS) -> Body:
    """The body with fillets between all kinematic neighbours that cross each other.

    canvas : its drawn contour is not changed by fillets; None: there is none

    A hand on a hip keeps its crease. Parts that are cut from one surface are smooth already: where one ends in the
    other, a smooth minimum would only swell into a ring, so they get no fillet.
    """
    # Pairs that have a fillet already have separate surfaces, even where they run along each other.
    filleted = {(first, second) for first, second, _ in body.fillets}
    thickness = [-float(part.grid.min()) for part in body.parts]
    made = []
    for first, second in combinations(range(len(body.parts)), 2):
        a, b = body.parts[first], body.parts[second]
        size = min(radius, thickness[first], thickness[second])
        if frozenset((a.part, b.part)) not in NEIGHBOURS or size <= 0:
            continue
        if (first, second) in filleted or _cross(a, b):
            fillet = blend(a, b, size, creases_only=(first, second) not in filleted)
            if fillet is not None:
                made.append((first, second, fillet if canvas is None else within(canvas, fillet, size)))
    return Body(body.parts, body.smooth, (*body.fillets, *made))


def _cross(first: PartSdf, second: PartSdf) -> bool:
    """Whether the surfaces of two parts meet at an angle, rather than being one surface."""
    near = np.argwhere(np.abs(first.grid) < first.spacing)
    points = first.origin.astype(np.float64) + near * first.spacing
    distance, _, slope = evaluate(pack([second], [(0, 0)]), points, with_gradients=True)
    both = np.abs(distance) < max(first.spacing, second.spacing)
    if not both.any():
        return False
    own = evaluate(pack([first], [(0, 0)]), points[both], with_gradients=True)[2]
    lengths = np.linalg.norm(own, axis=1) * np.linalg.norm(slope[both], axis=1)
    cosine = (own * slope[both]).sum(axis=1) / np.maximum(lengths, 1e-12)
    return bool(np.median(cosine) < SHARED_COSINE)
