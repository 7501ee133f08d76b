"""Legs under cloth: the circles of a leg hidden by a skirt, robe or gown, and legs that come out of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.limbs import STOUT, Limb, twins
from fig2mesh.records import BoolArray
from fig2mesh.skeleton import JOINT, PART

CLOTHED = 4
"""Least number of circles of a leg under cloth for the rest of it to become a layer that comes out of the cloth."""


NARROWER = 0.65
"""Largest width of such a leg, share of the width of the cloth above it."""


REACH_UNDER = 3
"""Circles by which such a leg is continued under the cloth."""


def shortened(covered: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Covered circles without the last few: a leg is continued a little under its cloth."""
    result = covered.copy()
    result[: len(covered) - REACH_UNDER] &= covered[REACH_UNDER:]
    result[len(covered) - REACH_UNDER :] &= covered.all()
    return result


def steps_out(limb: Limb, covered: NDArray[np.bool_]) -> bool:
    """Whether a leg comes out of its cloth much narrower than the cloth is, as out of a skirt."""
    if covered.sum() < CLOTHED or covered.all():
        return False
    below = limb.radius[~covered][: 2 * REACH_UNDER]
    above = limb.width[covered][-2 * REACH_UNDER :].sum(axis=1) / 2
    return float(np.median(below)) < NARROWER * float(np.median(above))


def clothed(bare: Limb, covered: NDArray[np.bool_]) -> Limb:
    """Leg that comes out of cloth; under it, where only the cloth can be measured, as thick as just below."""
    under = len(bare.points) - int((~covered).sum())
    radius = bare.radius.copy()
    radius[:under] = np.median(radius[under : under + REACH_UNDER])
    return replace(bare, radius=radius, cloth=True)


def keep(limb: Limb, chosen: NDArray[np.bool_]) -> Limb | None:
    """Reduce a limb to some of its circles; None where fewer than two are left."""
    if chosen.all():
        return limb
    if chosen.sum() < 2:
        return None
    arrays = {
        name: getattr(limb, name)[chosen]
        for name in ("points", "depth", "radius", "usual", "part", "ends", "free", "width", "seen")
    }
    return Limb(limb.name, **arrays, cloth=limb.cloth)


def under_cloth(limb: Limb, twin: Limb, visible: BoolArray) -> NDArray[np.bool_]:
    """(N,) bool: circles of a leg under a skirt, robe or gown.

    Cloth fills the space between the legs. A leg that hangs down is covered where its inner side has no contour of its
    own and either its outer side is far wider than a leg, or the drawing hides the knee although no other leg is in
    front of it; from there upwards to the hip, and downwards until the legs part or the outline narrows to the hem.
    """
    side = limb.name[0]
    none = np.zeros(len(limb.points), bool)
    knee, ankle = len(limb.points) * 2 // 5, len(limb.points) * 4 // 5
    drop = limb.points[0] - limb.points[knee]
    if drop[1] < abs(drop[0]):
        return none
    normal = np.gradient(limb.points, axis=0)[:, ::-1] * [-1.0, 1.0]
    towards = np.sum(normal * (twin.points - limb.points), axis=1)
    # Column 0 is the side of +normal.
    inner = np.where(towards > 0, 0, 1)
    rows = np.arange(len(inner))
    open_inside = limb.ends[rows, inner]
    outer = limb.width[rows, 1 - inner]
    covered = ~open_inside & (outer > STOUT * limb.usual)
    crossing = (twin.excess(limb.points)[0] < 0)[max(0, knee - 4) : knee + 4].any()
    if not visible[JOINT[f"{side}_knee"]] and not crossing:
        covered[: knee + 1] |= ~open_inside[: knee + 1]
        if covered[knee]:
            reference = limb.width[max(0, knee - 3) : knee].sum(axis=1).mean()
            bare = open_inside[knee:] | (limb.width[knee:].sum(axis=1) < 0.72 * reference)
            if not visible[JOINT[f"{side}_ankle"]]:
                bare[:] = False
            end = int(np.argmax(bare)) if bare.any() else len(bare)
            covered[knee : knee + end] = True
    if not covered.any():
        return none
    # The hem: the lowest circle down to which most of the leg is covered.
    share = np.cumsum(covered) / (rows + 1.0)
    deep = np.flatnonzero(covered & (share > 0.6))
    if not len(deep) or deep[-1] < knee // 2:
        return none
    hem = int(deep[-1]) + 1
    return rows < (len(rows) if hem > ankle else hem)


def labelled_cloth(limb: Limb, canvas: Canvas) -> NDArray[np.bool_]:
    """(N,) bool: circles of a leg under the label `garment`, from the hip down to the last labelled one."""
    rows, columns = np.round(canvas.pixels(limb.points)).astype(int).T
    height, width = canvas.labels.shape
    there = canvas.labels[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)] == PART["garment"]
    below = np.logical_or.accumulate(there[::-1])[::-1]
    return below if there.sum() > 0.5 * below.sum() else np.zeros_like(there)


def same_hem(limbs: list[Limb], covered: dict[str, NDArray[np.bool_]]) -> dict[str, NDArray[np.bool_]]:
    """Extend cloth from one leg to the other, down to the same height, where that one has no contour of its own."""
    result = dict(covered)
    for limb, twin in zip(limbs, twins(limbs), strict=True):
        if limb.is_arm or covered[limb.name].any() or not steps_out(twin, covered[twin.name]):
            continue
        hem = twin.points[covered[twin.name], 1].min()
        if hem < limb.points[len(limb.points) * 2 // 5, 1]:
            # Long coats open in front: a leg steps out of them.
            continue
        inside_cloth = (limb.points[:, 1] > hem) & ~limb.free.all(axis=1)
        result[limb.name] = np.logical_and.accumulate(inside_cloth)
    return result
