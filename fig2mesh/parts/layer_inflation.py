"""Inflation of a layer around its bones, with the thickness that networks infer and a head of its own shape."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fig2mesh.parts.bones import Bones
from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.cross_section import CrossSection, measure_cross_section
from fig2mesh.parts.depth import mid_surface
from fig2mesh.parts.ends import Ends, clip_distance, flat_ends
from fig2mesh.parts.heads.frame import HeadFrame
from fig2mesh.parts.heads.raised import RaisedHead, raise_head
from fig2mesh.parts.inflate import inflate
from fig2mesh.parts.loads import load_of
from fig2mesh.parts.rim import extended, rim_distance
from fig2mesh.parts.split import Layer
from fig2mesh.records import PartSdf


@dataclass(frozen=True)
class LayerSurface:
    """Layer in depth: it fills z0 − √u … z0 + √u.

    u : (H, W) float64, squared half thickness in FIGURE units², negative outside the outline
    z0 : (H, W) float64, FIGURE z of its middle
    labels : (H, W) uint8, part of each pixel, 0 outside the region
    clip : (H, W) float64, signed distance to flat ends, positive beyond them, FIGURE units; None where there are none
    """

    u: NDArray[np.float64]
    z0: NDArray[np.float64]
    labels: NDArray[np.uint8]
    clip: NDArray[np.float64] | None = None


class LayerInflation:
    """Inflation of layers around their bones; the networks' cross-section of a layer is measured once."""

    def __init__(
        self,
        canvas: Canvas,
        loads: NDArray[np.float64],
        flat: NDArray[np.uint8],
        device: str,
        fields: tuple[PartSdf, ...],
        frame: HeadFrame,
    ) -> None:
        self.canvas, self.loads, self.flat, self.device, self.fields = canvas, loads, flat, device, fields
        self.frame = frame
        self.cross_sections: dict[str, CrossSection | None] = {}
        self.heads: dict[str, RaisedHead | None] = {}

    def __call__(self, layer: Layer, bones: Bones) -> LayerSurface:
        canvas = self.canvas
        if layer.name not in self.cross_sections:
            # The networks' parts lie where the joints are, also where the limb has been moved since.
            self.cross_sections[layer.name] = self._cross_section(
                layer, bones if layer.limb is None else Bones.of(layer.limb)
            )
        cross_section = self.cross_sections[layer.name]
        ends = flat_ends(canvas, layer.region, np.isin(layer.labels, self.flat))
        rim = rim_distance(canvas, layer.region, ends)
        head = self._head(layer, rim[: len(layer.region)])
        u = self._raised(layer.region, layer.labels, bones, ends, rim, head)
        u = extended(rim[: len(u)], u, canvas.pitch)
        z0 = mid_surface(canvas, bones.points, bones.depth)
        if cross_section is not None:
            ratio = cross_section.ratio if head is None else head.bounded_ratio(cross_section.ratio)
            u, z0 = u * ratio, z0 + cross_section.offset
        if head is not None:
            u, z0 = head.behind_neck(u, z0)
        if head is not None and head.brim.any():
            u = extended(rim[: len(u)], np.where(rim[: len(u)] < 0, np.maximum(u, head.brim), 0.0), canvas.pitch)
        return LayerSurface(u, z0, layer.labels, None if ends is None else clip_distance(canvas, layer.region, ends))

    def _raised(
        self,
        region: NDArray[np.bool_],
        labels: NDArray[np.uint8],
        bones: Bones,
        ends: Ends | None,
        rim: NDArray[np.float64],
        head: RaisedHead | None,
    ) -> NDArray[np.float64]:
        """(H, W) squared half thickness of an inflated outline, FIGURE units²; 0 outside its `rim_distance`."""
        height = len(region)
        if ends is not None:
            below = labels[np.maximum(ends.source, 0), np.arange(region.shape[1])]
            rows = ((0, ends.extra), (0, 0))
            labels = np.where(ends.beyond, below, np.pad(labels, rows))
            region = np.pad(region, rows) | ends.beyond
        load = load_of(region, labels, self.loads, self.canvas.pitch)
        steep = mid_surface(self.canvas, bones.points, bones.slope2)
        u = inflate(rim < 0, load, self.device, rim)[:height] * self.canvas.pitch**2
        if head is not None:
            u = np.where(rim[:height] < 0, head.joined(u), 0.0)
        return np.asarray(u * (1.0 + np.maximum(steep, 0.0)))

    def _head(self, layer: Layer, rim: NDArray[np.float64]) -> RaisedHead | None:
        if layer.name != "core":
            return None
        if layer.name not in self.heads:
            self.heads[layer.name] = raise_head(self.canvas, self.frame, layer.region, layer.labels, rim, self.device)
        return self.heads[layer.name]

    def _cross_section(self, layer: Layer, bones: Bones) -> CrossSection | None:
        """Cross-section of a layer by the networks; None where they have none of its parts."""
        canvas = self.canvas
        own = [field for field in self.fields if (layer.labels == field.part).any()]
        if not own:
            return None
        rim = rim_distance(canvas, layer.region, None)
        reference = self._raised(layer.region, layer.labels, bones, None, rim, self._head(layer, rim))
        bone = mid_surface(canvas, bones.points, bones.depth)
        return measure_cross_section(canvas, layer.labels, own, reference, bone)
