"""Interface that meshing needs of a body: a signed distance and its gradient.

`fig2mesh.field.body.Body` fits, and so does any formula, which makes spheres and capsules the oracle of the tests.
"""

from __future__ import annotations

from typing import Any, Protocol

from numpy.typing import NDArray

from fig2mesh.records import FloatArray

Points = NDArray[Any]


class Field(Protocol):
    """Solid as a signed distance field in FIGURE, negative inside; it may over- or underestimate the distance."""

    def distance(self, points: Points) -> FloatArray:
        """(N,) float32 signed distance at `points` (N, 3)."""
        ...

    def gradient(self, points: Points) -> FloatArray:
        """(N, 3) float32 gradient at `points` (N, 3); its length need not be 1."""
        ...

    def bounds(self) -> FloatArray:
        """(2, 3) lowest and highest corner of a bounding box of the solid."""
        ...
