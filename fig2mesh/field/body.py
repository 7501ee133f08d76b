"""Body: union of its parts' distance grids (paper §4.3, fig. 14)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.blend import blend
from fig2mesh.field.compiled import sealed
from fig2mesh.field.empty_space import EmptySpace, empty_space
from fig2mesh.field.evaluate import evaluate
from fig2mesh.field.grids import Grids, pack
from fig2mesh.records import BoolArray, ByteArray, FloatArray, IntArray, PartSdf


@dataclass(frozen=True)
class Body:
    """Union of part fields, as a function of points.

    parts : any number of grids, each with its own position, edge and number of nodes
    smooth : (first, second, radius) for pairs of indices into `parts` that are blended; radius in FIGURE units.
        Fillets are grids computed once, so parts not named here keep their creases and cost nothing.
    fillets : (first, second, grid), fillets made elsewhere

    Distance outside of a part's cube: with b the distance to the cube and v the value at its nearest point,
    sqrt(b^2 + max(v, 0)^2). It continues v without a step, never exceeds the true distance where v does not, and is
    positive: the cube ends a part that is still negative at its faces. A part without any negative value has no surface
    and is left out altogether, whatever small numbers its grid holds.
    """

    parts: tuple[PartSdf, ...]
    smooth: tuple[tuple[int, int, float], ...] = ()
    fillets: tuple[tuple[int, int, PartSdf], ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", tuple(self.parts))
        object.__setattr__(self, "smooth", tuple(self.smooth))
        object.__setattr__(self, "fillets", tuple(self.fillets))
        for name, pairs in (("smooth", self.smooth), ("fillets", self.fillets)):
            for first, second, _ in pairs:
                if not (0 <= first < len(self.parts) and 0 <= second < len(self.parts) and first != second):
                    raise ValueError(
                        f"{name}: {(first, second)}, expected two different indices below {len(self.parts)}"
                    )
        for *_, radius in self.smooth:
            if not radius > 0:
                raise ValueError(f"smooth: radius {radius}, expected a positive one")

    @cached_property
    def grids(self) -> Grids:
        """Parts, then fillets, laid out for the kernels."""
        grids, owners = list(self.parts), [(i, i) for i in range(len(self.parts))]
        for first, second, radius in self.smooth:
            fillet = blend(self.parts[first], self.parts[second], radius)
            if fillet is not None:
                grids.append(fillet)
                owners.append((first, second))
        for first, second, fillet in self.fillets:
            grids.append(fillet)
            owners.append((first, second))
        return pack(grids, owners)

    @cached_property
    def empty_space(self) -> EmptySpace:
        """Cells that rays skip; computed at the first trace."""
        return empty_space(self.grids)

    @cached_property
    def labels(self) -> ByteArray:
        """(P,) uint8, the label of each part; `labels[hits.part_index]` where something is hit."""
        labels: ByteArray = sealed([part.part for part in self.parts], np.uint8)
        return labels

    def distance(self, points: Any) -> FloatArray:
        """(N,) float32 signed distance of points (N, 3), FIGURE; infinite without parts that have a surface."""
        return self.evaluate(points)[0].astype(np.float32)

    def nearest_part(self, points: Any) -> IntArray:
        """(N,) int32 index into `parts` of the part with the smallest distance; -1 without such parts."""
        return self.evaluate(points, with_parts=True)[1]

    def nearest_labels(self, points: Any) -> ByteArray:
        """(N,) uint8 label of the part nearest to each point (N, 3), FIGURE."""
        return self.labels[self.nearest_part(points)]

    def gradient(self, points: Any) -> FloatArray:
        """(N, 3) float32 gradient of the distance at points (N, 3), FIGURE; about 1 long where the field is a distance.

        Central differences one node of the nearest part's grid wide (paper appendix C), continuous within a part.
        """
        return self.evaluate(points, with_gradients=True)[2].astype(np.float32)

    def evaluate(
        self, points: Any, *, with_parts: bool = False, with_gradients: bool = False
    ) -> tuple[NDArray[np.float64], IntArray, NDArray[np.float64]]:
        """Distance (N,), nearest part (N,) and gradient (N, 3) in one pass, float64; empty where not requested."""
        return evaluate(self.grids, points, with_parts=with_parts, with_gradients=with_gradients)

    def bounds(self) -> FloatArray:
        """(2, 3) float32, FIGURE: lowest and highest corner of the region where the field is negative."""
        boxes = self.grids.boxes
        if not np.isfinite(boxes).any():
            raise ValueError("body: no grid has a negative value, so there is no solid to bound")
        return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)]).astype(np.float32)

    def project(self, points: Any, iterations: int = 10, *, tolerance: float = 1e-5) -> tuple[FloatArray, BoolArray]:
        """Project points (N, 3), FIGURE, onto the zero level by Newton's method; return them and (N,) bool, success.

        tolerance : distance to the surface, estimated as value by gradient, at which a point is done, FIGURE units

        Steps go along the gradient and are at most a quarter of the mean part's edge, shorter when the value grew:
        at a crease between parts the nearest part changes and full steps may oscillate.
        """
        result = np.array(points, np.float64, order="C")
        done = np.zeros(len(result), bool)
        if len(result) == 0 or not self.parts:
            return result.astype(np.float32), done
        longest = 0.25 * float(np.mean([part.edge for part in self.parts]))
        active = np.arange(len(result))
        damping = np.ones(len(result))
        previous = np.full(len(result), np.inf)
        for iteration in range(iterations + 1):
            values, _, gradients = self.evaluate(result[active], with_gradients=True)
            slope = np.linalg.norm(gradients, axis=1)
            near = np.abs(values) <= tolerance * slope
            done[active[near]] = True
            going = ~near & (slope > 1e-6) & np.isfinite(values)
            if iteration == iterations or not going.any():
                break
            active, values, gradients, slope = (array[going] for array in (active, values, gradients, slope))
            worse = np.abs(values) >= previous[active]
            damping[active[worse]] *= 0.5
            previous[active] = np.abs(values)
            step = damping[active] * np.clip(values / slope, -longest, longest) / slope
            result[active] -= step[:, None] * gradients
        return result.astype(np.float32), done
