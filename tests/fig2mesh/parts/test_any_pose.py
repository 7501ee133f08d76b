"""Bodies of any pose and proportions: the laws that every solid keeps, on figures drawn at random."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from fig2mesh.mesh.topology import check_solid
from fig2mesh.records import Figure
from tests.drawn import JOINTS, Sketch, assemble


@dataclass(frozen=True)
class Drawn:
    """A figure and the FIGURE z of some of its joints."""

    figure: Figure
    depths: dict[str, float]


@st.composite
def figures(draw: st.DrawFn) -> Drawn:
    """A figure of capsules; limbs turn at every joint in the drawing and lean to and from the viewer.

    The limbs' lengths keep them on the picture whatever they do: none may be cut off by its edge.
    """
    joints: dict[str, tuple[float, float]] = {}
    depths: dict[str, float] = {}

    def limb(names: tuple[str, ...], lengths: tuple[float, ...], outwards: float, low: int, high: int) -> None:
        """low, high : degrees from straight down, outwards, of the first bone; the others bend up to 60 from it."""
        x, y = (float(place) for place in JOINTS[names[0]])
        angle = draw(st.integers(low, high))
        depth = 0.0
        for name, length in zip(names[1:], lengths, strict=True):
            x += outwards * length * math.sin(math.radians(angle))
            y += length * math.cos(math.radians(angle))
            joints[name] = x, y
            depth += draw(st.sampled_from((-0.1, 0.0, 0.1)))
            depths[name] = depth
            angle += draw(st.integers(-60, 60))

    long = draw(st.sampled_from((0.7, 0.85, 1.0)))
    for side, outwards in (("l", 1.0), ("r", -1.0)):
        arm = tuple(f"{side}_{joint}" for joint in ("shoulder", "elbow", "wrist", "hand"))
        limb(arm, (34 * long, 30 * long, 8 * long), outwards, -20, 150)
        leg = tuple(f"{side}_{joint}" for joint in ("hip", "knee", "ankle", "foot"))
        limb(leg, (52 * long, 48 * long, 10 * long), outwards, -10, 50)
    sketch = Sketch(**joints).trunk()
    sketch.legs(width=draw(st.integers(12, 26))).arms(width=draw(st.integers(10, 22)))
    return Drawn(sketch.head(radius=draw(st.integers(16, 32))).figure(), depths)


@given(figures())
@settings(derandomize=True, max_examples=8, deadline=None)
def test_every_figure_is_one_closed_solid_with_the_drawn_silhouette(drawn: Drawn) -> None:
    _, pieces = ndimage.label(drawn.figure.mask, np.ones((3, 3)))
    made = assemble(drawn.figure, drawn.depths, canvas_px=192, voxel=0.015)
    found = check_solid(made.mesh)
    assert found.outward, "closed, oriented and manifold, and nothing inside out"
    assert found.components == pieces == 1
    # A canvas of 192 pixels knows the contour to about 0.002 units; the thinnest limb is 0.06 units wide.
    assert made.front_iou() > 0.95


@given(figures())
@settings(derandomize=True, max_examples=3, deadline=None)
def test_the_same_drawing_gives_the_same_arrays(drawn: Drawn) -> None:
    first, second = (assemble(drawn.figure, drawn.depths, canvas_px=128, voxel=0.02) for _ in range(2))
    assert len(first.outline.parts) == len(second.outline.parts)
    for one, other in zip(first.outline.parts, second.outline.parts, strict=True):
        assert one.part == other.part
        assert np.array_equal(one.grid, other.grid)
        assert np.array_equal(one.centre, other.centre)
    assert np.array_equal(first.mesh.vertices, second.mesh.vertices)
    assert np.array_equal(first.mesh.faces, second.mesh.faces)
