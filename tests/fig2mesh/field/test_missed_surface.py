"""No surface is missed: 10,000 rays each through what is hard to hit, against a brute-force march.

The march takes 35 to 60 samples a cell and so overlooks shorter chords. Where it does not confirm a hit, the field is
sampled again about the place of the hit, every 5e-8.
"""

from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.field import analytic
from fig2mesh.field.body import Body
from fig2mesh.field.trace import trace
from fig2mesh.records import PartSdf, Rays

from .fields import ball, gap, harsh, towards

RAYS = 10_000
TOLERANCE = 1e-6
NODES = 33
CELL = 1.0 / (NODES - 1)
START, END = 1.0, 2.2
"""Depths between which rays from a sphere of radius 1.5 pass the bodies."""


def thin(radius_in_cells: float, seed: int, factor: float = 1.0) -> tuple[Body, Rays]:
    """A limb along a grid line, where even the thinnest has nodes inside, another across all axes; rays at their axes.

    factor : greatest factor by which distances are overestimated, at random for each node
    """
    rng = np.random.default_rng(seed)
    lines = [((0, -0.4, 0), (0, 0.4, 0)), (tuple(rng.uniform(-0.35, 0.35, 3)), tuple(rng.uniform(-0.35, 0.35, 3)))]
    parts, targets = [], []
    for start, end in lines:
        clean = analytic.sample(analytic.capsule(start, end, radius_in_cells * CELL), 3, (0, 0, 0), 1.0, NODES)
        grid = clean.grid * (1 + (factor - 1) * rng.random(clean.grid.shape))
        parts.append(PartSdf(3, grid, clean.centre, clean.edge))
        share = rng.random((RAYS // 2, 1))
        reach = (radius_in_cells + 0.5) * CELL
        targets.append((1 - share) * start + share * end + rng.uniform(-reach, reach, (RAYS // 2, 3)))
    origins = rng.normal(size=(RAYS, 3))
    origins *= 1.5 / np.linalg.norm(origins, axis=1, keepdims=True)
    return Body(tuple(parts)), towards(origins, np.concatenate(targets))


def grazing(seed: int = 0) -> tuple[Body, Rays]:
    """A ball met by rays that pass its middle at its radius, half a cell more or less."""
    part, rng = ball(48), np.random.default_rng(seed)
    middle, cell = np.array([0.1, -0.2, 0.05]), 1.1 / 47
    origins = rng.normal(size=(RAYS, 3))
    origins *= 1.5 / np.linalg.norm(origins, axis=1, keepdims=True)
    side = np.cross(origins, rng.normal(size=(RAYS, 3)))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    middle = middle + side * (0.4 + rng.uniform(-0.5, 0.5, (RAYS, 1)) * cell)
    return Body((part,)), towards(middle + origins, middle)


def overestimated(seed: int = 0) -> tuple[Body, Rays]:
    """Limbs thinner than a cell, distances up to three times too large, ripples."""
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(RAYS, 3))
    origins *= 1.5 / np.linalg.norm(origins, axis=1, keepdims=True)
    return harsh(), towards(origins, rng.uniform(-0.45, 0.45, (RAYS, 3)))


CASES = {
    **{f"limb of {radius} cells": lambda r=radius: thin(r, 1) for radius in (2.0, 1.0, 0.5, 0.3, 0.2)},
    "limb of 0.5 cells, three times too far": lambda: thin(0.5, 2, 3.0),
    "overestimated": overestimated,
    "grazing": grazing,
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_hits_agree_with_a_fine_march(case):
    body, rays = CASES[case]()
    hits = trace(body, rays, tolerance=TOLERANCE)
    origins, directions = rays.origins.astype(np.float64), rays.directions.astype(np.float64)

    def field(depths: np.ndarray, which: np.ndarray) -> np.ndarray:
        return body.evaluate(origins[which] + depths[:, None] * directions[which])[0]

    samples = 2401
    step = (END - START) / (samples - 1)
    marched = np.full(RAYS, np.inf)
    left = np.arange(RAYS)
    for depth in np.linspace(START, END, samples):
        met = field(np.full(len(left), depth), left) <= 0
        marched[left[met]] = depth
        left = left[~met]
    # nothing the march finds is passed by, not one ray of them all
    late = hits.depth > marched + 2 * TOLERANCE
    assert late.sum() == 0
    # what the tracer finds sooner, or alone, is there: the solid begins within the tolerance behind the hit
    alone = np.flatnonzero(hits.hit & ~(gap(hits.depth, marched) <= step))
    assert len(alone) <= 0.01 * RAYS  # chords shorter than a sample are rare
    lowest = np.full(len(alone), np.inf)
    for further in np.linspace(-2e-6, 5e-6, 141):  # 5e-8 apart; depths are kept in float32, 1e-7 there
        lowest = np.minimum(lowest, field(hits.depth[alone].astype(np.float64) + further, alone))
    agree = RAYS - (lowest > 0).sum()
    assert agree >= 0.9999 * RAYS, f"{case}: {RAYS - agree} hits without a surface"
    assert hits.hit.sum() > 0.1 * RAYS
