"""Limbs as chains of circles along the drawn bones, with radii measured on the silhouette."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fig2mesh.parts.canvas import Canvas
from fig2mesh.records import BoolArray
from fig2mesh.skeleton import JOINT, LIMB_JOINTS, LIMB_PARTS, PART

SAMPLES = 12
"""Circles per bone."""

# fmt: off
USUAL_RADIUS = {
    "upper_arm": 0.055, "lower_arm": 0.045, "hand": 0.045, "upper_leg": 0.085, "lower_leg": 0.060, "foot": 0.050
}
# fmt: on
"""Radii of a realistic body 1.79 units high, which bound the measured ones."""

STOUT = 1.7
"""Largest radius of a limb with one free side, in usual radii; what is wider is cloth."""

REACH = 0.30
"""Search distance sideways for a limb's contour, FIGURE units."""


@dataclass(frozen=True)
class Limb:
    """One arm or leg.

    name : "l_arm", "r_arm", "l_leg" or "r_leg"
    points : (N, 2) float64, FIGURE x, y of the circles' centres, from the root joint to the hand or foot
    depth : (N,) float64, FIGURE z of the centres
    radius : (N,) float64, FIGURE units
    usual : (N,) float64, radius a realistic body would have there
    part : (N,) uint8, part label of each circle
    ends : (N, 2) bool, True where the silhouette ends to the limb's left and right before anything else of the body
    free : (N, 2) bool, True where that end is near enough to be the limb's own contour
    width : (N, 2) float64, free length to the left and right, capped
    seen : (N,) bool, False between joints of which one is hidden
    cloth : True if it comes out of a garment that covers its upper part
    """

    name: str
    points: NDArray[np.float64]
    depth: NDArray[np.float64]
    radius: NDArray[np.float64]
    usual: NDArray[np.float64]
    part: NDArray[np.uint8]
    ends: NDArray[np.bool_]
    free: NDArray[np.bool_]
    width: NDArray[np.float64]
    seen: NDArray[np.bool_]
    cloth: bool = False

    @property
    def is_arm(self) -> bool:
        return self.name.endswith("arm")

    @property
    def along(self) -> NDArray[np.float64]:
        """(N,) length along the chain from the root, FIGURE units."""
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    def excess(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Signed distance of (..., 2) FIGURE points to the union of circles, and the circle they are nearest to."""
        flat = points.reshape(-1, 2)
        count = min(8, len(self.points))
        distance, index = cKDTree(self.points).query(flat, k=count)
        beyond = distance - self.radius[index]
        best = np.argmin(beyond, axis=1)
        rows = np.arange(len(flat))
        shape = points.shape[:-1]
        return beyond[rows, best].reshape(shape), index[rows, best].reshape(shape)

    def part_of(self, index: NDArray[np.intp]) -> NDArray[np.uint8]:
        return self.part[index]


ENOUGH = 0.3
"""Least share of measured circles from which the other circles of a limb are filled in."""


ALIKE = 0.8
"""Least thickness relative to its twin of a limb with one hidden side."""


def make_limb(name: str, joints: NDArray[np.float64], visible: BoolArray) -> Limb:
    """Chain of a limb from (21, 3) FIGURE joints, with usual radii and nothing measured yet."""
    side, kind = name.split("_")
    centres, depth, usual, part, seen = [], [], [], [], []
    chain = [JOINT[f"{side}_{joint}"] for joint in LIMB_JOINTS[kind]]
    for bone, (start, end) in zip(LIMB_PARTS[kind], pairwise(chain), strict=True):
        count = SAMPLES if bone not in ("hand", "foot") else SAMPLES // 2
        t = (np.arange(count) + 0.5) / count
        span = joints[start] + t[:, None] * (joints[end] - joints[start])
        centres.append(span[:, :2])
        depth.append(span[:, 2])
        usual.append(np.full(count, USUAL_RADIUS[bone]))
        part.append(np.full(count, PART[f"{side}_{bone}"], np.uint8))
        seen.append(np.full(count, bool(visible[end]) and bool(visible[start])))
    points = np.concatenate(centres)
    radius = np.concatenate(usual)
    return Limb(
        name,
        points,
        np.concatenate(depth),
        radius,
        radius.copy(),
        np.concatenate(part),
        np.zeros((len(points), 2), bool),
        np.zeros((len(points), 2), bool),
        np.zeros((len(points), 2)),
        np.concatenate(seen),
    )


def measure(limb: Limb, canvas: Canvas, rivals: NDArray[np.float64]) -> Limb:
    """Measure radii across the bone.

    From each circle's centre a line goes left and right until it leaves the silhouette (a free side), comes nearer to
    something else of the body than to the limb (`rivals`: (H, W) distance to the other limbs' bones and the torso), or
    gets longer than `REACH`.
    """
    tangent = np.gradient(limb.points, axis=0)
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    # A bone of no length has no direction; across any line will do.
    tangent = np.where(length > 1e-9, tangent / np.maximum(length, 1e-9), [0.0, 1.0])
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    max_radius = STOUT * limb.usual
    reach = np.arange(0.0, REACH, canvas.pitch)
    ends = np.zeros((len(limb.points), 2), bool)
    width = np.zeros((len(limb.points), 2))
    for side, sign in enumerate((1.0, -1.0)):
        line = limb.points[:, None] + sign * reach[None, :, None] * normal[:, None]
        outside = canvas.sample(canvas.sdf, line) > 0
        near_other = canvas.sample(rivals, line) < reach[None]
        leaves = np.where(outside.any(1), outside.argmax(1), len(reach))
        meets = np.where(near_other.any(1), near_other.argmax(1), len(reach))
        ends[:, side] = (leaves < meets) & (leaves < len(reach))
        width[:, side] = np.minimum(leaves, meets) * canvas.pitch
    # A side that is free is the limb's own contour unless it is far off: cloth. Between two free sides lies a limb,
    # however stout it is drawn.
    usable = ends & ((width <= max_radius[:, None]) | ends.all(axis=1, keepdims=True))
    count = usable.sum(axis=1)
    known = count > 0
    measured = np.where(known, (width * usable).sum(1) / np.maximum(count, 1), np.nan)
    return replace(limb, radius=measured, ends=ends, free=usable, width=width)


def stoutness(limbs: list[Limb]) -> float:
    """Stoutness of the drawn limbs: median of measured over usual radius; 0.8 where none was measured."""
    ratios = np.concatenate([limb.radius / limb.usual for limb in limbs])
    ratios = ratios[np.isfinite(ratios) & (ratios > 0)]
    return float(np.median(ratios)) if len(ratios) else 0.8


def complete(limb: Limb, twin: Limb, stout: float, pitch: float) -> Limb:
    """Fill the radii that could not be measured and smooth them.

    What is missing comes from the rest of the limb, or where too little of it is known from its twin, or else from
    the figure's `stout`ness. Radii carry over relative to the usual taper: a thigh is not as thin as its shin.
    """
    ratio = limb.radius / limb.usual
    known = np.isfinite(ratio) & (ratio > 0)
    from_twin = np.isfinite(twin.radius) & (twin.radius > 0)
    if known.mean() < ENOUGH and from_twin.mean() >= ENOUGH:
        stout = float(np.median((twin.radius / twin.usual)[from_twin]))
    ratio = np.where(
        known & ~limb.free.all(axis=1) & from_twin, np.fmax(ratio, ALIKE * twin.radius / twin.usual), ratio
    )
    if known.mean() < ENOUGH:
        ratio = np.where(known, np.maximum(ratio, 0.8 * stout), stout)
    else:
        ratio = np.interp(np.arange(len(ratio)), np.flatnonzero(known), ratio[known])
    smooth = np.convolve(np.pad(ratio * limb.usual, 2, mode="edge"), np.ones(5) / 5, mode="valid")
    return replace(limb, radius=np.maximum(smooth, pitch))


def twins(limbs: list[Limb]) -> list[Limb]:
    """Limb of the other side for each limb."""
    by_name = {limb.name: limb for limb in limbs}
    return [by_name[("r" if limb.name[0] == "l" else "l") + limb.name[1:]] for limb in limbs]
