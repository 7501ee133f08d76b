"""Heads in depth: a round skull or crown, the brim of a hat, and lobes that are as deep as they are wide."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.heads.brims import Brim, find_brim, raise_brim
from fig2mesh.parts.heads.frame import HeadFrame
from fig2mesh.parts.heads.lobes import NOOK, Bulk, find_bulk, raise_lobes
from fig2mesh.parts.heads.revolution import revolve
from fig2mesh.skeleton import PART

DEEPEST = 1.5
"""Half depth of a head towards which very wide hair and luggage are bounded, radii of the head."""

THROAT = 0.65
"""Largest distance of the throat from the middle of the neck, radii of the head: long hair hangs behind it."""

SHARPNESS = 6
"""Exponent of the union of a head with its lobes: larger is sharper."""

CROWN_FINER = 4.0
"""Sharpness of the edges of a hat's crown, see `revolution.FINER`."""

LOW_CROWN = 0.5
"""Height above a brim from which it has a crown above it, radii of the head; less is the top of a cap."""

CLEARANCE = 0.15
"""Height above a brim down to which the outline of the crown counts, radii of the head."""

BELOW = 1.6
"""Length below the chin along which the outline still counts, radii of the head."""

NECK = 1.0
"""Length above the chin along which the head passes into the neck, radii of the head."""


@dataclass(frozen=True)
class RaisedHead:
    """Head of a layer.

    u : (H, W) squared half thickness, FIGURE units²
    weight : (H, W) its share next to the rest of the layer, 0 … 1
    brim : (H, W) squared half thickness of the brim of a hat, FIGURE units²
    near : (H, W) 1 on the head and what hangs around the neck, 0 away from them
    deepest : half depth of what hangs around the neck, FIGURE units
    facing : see `HeadFrame`
    """

    u: NDArray[np.float64]
    weight: NDArray[np.float64]
    brim: NDArray[np.float64]
    near: NDArray[np.float64]
    deepest: float
    facing: float

    def joined(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Squared half thickness of the layer with the head, from that of the inflated layer."""
        below = u + self.near * (bounded(u, self.deepest) - u)
        return np.asarray(below + self.weight * (self.u - below))

    def behind_neck(
        self, u: NDArray[np.float64], z0: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Squared half thickness and middle, with what hangs beside the neck behind it rather than in front of it."""
        half = np.sqrt(np.maximum(u, 0.0))
        front = np.sqrt(bounded(half**2, THROAT * self.deepest))
        share = abs(self.facing) * np.clip(self.near - self.weight, 0.0, 1.0)
        lost = share * (half - front) / 2
        return np.where(u > 0, (half - lost) ** 2, u), z0 - np.sign(self.facing) * lost

    def bounded_ratio(self, ratio: NDArray[np.float64]) -> NDArray[np.float64]:
        """Ratio of thickness that leaves a head below a brim inside it."""
        if not self.brim.any():
            return ratio
        return np.asarray(ratio + self.near * (np.minimum(ratio, 1.0) - ratio))


def raise_head(
    canvas: Canvas,
    frame: HeadFrame,
    region: NDArray[np.bool_],
    labels: NDArray[np.uint8],
    rim: NDArray[np.float64],
    device: str,
) -> RaisedHead | None:
    """Depth of the head of a layer; None where it has none.

    region : (H, W) bool; labels : (H, W) uint8; rim : (H, W) signed distance to the layer's rim, FIGURE units
    """
    radius = frame.radius
    _, along = frame.coordinates(canvas.points())
    head = region & np.isin(labels, [PART["head"], PART["hair"]])
    if not head.any():
        return None
    brim = find_brim(canvas, frame, region, head)
    wings = np.zeros_like(region) if brim is None else brim.pixels
    bulk = find_bulk(canvas, frame, region, head, wings, rim)
    if bulk is None:
        return None
    lowest = frame.chin - BELOW * radius
    crown = -np.inf if brim is None else float(along[head].max()) - brim.top
    if brim is None or crown < LOW_CROWN * radius:
        smooth = revolve(canvas, frame, bulk.filled, (lowest, np.inf), device)
    else:
        smooth = _under_hat(canvas, frame, bulk, brim, lowest, device)
    lobes = raise_lobes(canvas, region, (bulk.lobes > 0) | wings, rim, device)
    u = bounded(smooth, DEEPEST * radius) * bulk.share
    u = (u**SHARPNESS + lobes**SHARPNESS) ** (1.0 / SHARPNESS)
    disc = np.zeros_like(u) if brim is None else raise_brim(canvas, frame, brim)
    blur = NOOK / canvas.pitch
    cover = ndimage.gaussian_filter(region.astype(float), blur)
    weight = ndimage.gaussian_filter(head.astype(float), blur) / np.maximum(cover, 1e-6)
    rise = np.clip((along - frame.chin) / (NECK * radius) + 0.6, 0.0, 1.0)
    near = np.clip(weight, 0.0, 1.0)
    return RaisedHead(u, near * rise * rise * (3.0 - 2.0 * rise), disc, near, radius, frame.facing)


def bounded(u: NDArray[np.float64], half: float) -> NDArray[np.float64]:
    """Squared half thickness that stays below that of a half thickness, and is unchanged where it is much smaller."""
    return np.asarray(u * (1.0 + (u / half**2) ** 4) ** -0.25)


def _under_hat(
    canvas: Canvas, frame: HeadFrame, bulk: Bulk, brim: Brim, lowest: float, device: str
) -> NDArray[np.float64]:
    """(H, W) squared half thickness of a crown and of the head below it, which meet inside the brim."""
    across, along = frame.coordinates(canvas.points())
    half = max(brim.thickness / 2, canvas.pitch)
    # Right above the brim its own curve would widen the crown.
    clear = brim.top + CLEARANCE * frame.radius
    crown = revolve(canvas, frame, bulk.distance, (clear, np.inf), device, CROWN_FINER)
    face = revolve(canvas, frame, bulk.filled, (lowest, brim.top - 2.0 * half), device)
    share = np.clip((along - brim.height(across)) / half, -1.0, 1.0) / 2 + 0.5
    return np.asarray(face + share * (crown - face))
