"""Segmentation of a silhouette into layers and body parts by the skeleton.

The body is drawn as layers: a core (torso, head, and every limb that lies free of them) and the limbs that touch or
cross something else. Each layer has a complete outline of its own: the torso continues behind the arm in front of it,
so that inflating it does not leave a trench where the arm is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.cloth import clothed, keep, labelled_cloth, same_hem, shortened, steps_out, under_cloth
from fig2mesh.parts.distances import (
    chain_distance,
    closing,
    nearest_circle,
    polygon_distance,
    segment_distance,
    thorax_distance,
)
from fig2mesh.parts.limbs import Limb, complete, make_limb, measure, stoutness, twins
from fig2mesh.parts.owners import owners
from fig2mesh.parts.props import find_props
from fig2mesh.records import BoolArray
from fig2mesh.skeleton import JOINT, LIMBS, PART

LAYERED_SHARE = 0.22
"""Threshold of the share of a limb's length against something else, above which it becomes a layer of its own."""

MIN_HEAD_RADIUS = 0.05

LEGS_FIRST = sorted(LIMBS, key=lambda limb: limb.endswith("arm"))
"""Limbs in the order in which they are measured and claim their layers."""


@dataclass(frozen=True)
class Layer:
    """One outline to inflate.

    name : "core", a limb's name, or "prop" and a number
    region : (H, W) bool, completed outline, within the silhouette
    labels : (H, W) uint8, part label of every pixel of the region
    limb : the chain, None for the core and props
    shown : (H, W) bool, where the drawing shows it
    """

    name: str
    region: NDArray[np.bool_]
    labels: NDArray[np.uint8]
    limb: Limb | None
    shown: NDArray[np.bool_]


@dataclass(frozen=True)
class Split:
    """Layers of a figure, the core first, props last, and all its limbs (also those in the core).

    garment : (H, W) bool, pixels of the core that hang around the legs
    labels : (H, W) uint8, the part that the drawing shows at each pixel
    """

    layers: tuple[Layer, ...]
    limbs: tuple[Limb, ...]
    garment: NDArray[np.bool_]
    labels: NDArray[np.uint8]


def split(canvas: Canvas, joints: NDArray[np.float64], visible: BoolArray) -> Split:
    """Split a silhouette.

    Parameters
    ----------
    joints : (21, 3) float64, FIGURE
    visible : (21,) bool
    """
    points = canvas.points()
    inside = canvas.inside
    torso = polygon_distance(points, joints[[JOINT[n] for n in ("l_shoulder", "r_shoulder", "r_hip", "l_hip")], :2])
    head = segment_distance(points, joints[JOINT["neck"], :2], joints[JOINT["head"], :2])
    limbs = _measured_limbs(canvas, joints, visible, np.minimum(torso, head), points)

    garment = np.zeros(inside.shape, bool)
    covered = {}
    for limb, other in zip(limbs, twins(limbs), strict=True):
        if limb.is_arm:
            covered[limb.name] = np.zeros(len(limb.points), bool)
        else:
            covered[limb.name] = under_cloth(limb, other, visible) | labelled_cloth(limb, canvas)
    covered = same_hem(limbs, covered)
    strictly = [keep(limb, ~covered[limb.name]) for limb in limbs]
    bare = [keep(limb, ~shortened(covered[limb.name])) for limb in limbs]
    bare = [
        clothed(b, covered[limb.name]) if b is not None and steps_out(limb, covered[limb.name]) else b
        for b, limb in zip(bare, limbs, strict=True)
    ]
    layered = [limb for limb in bare if limb is not None and (limb.cloth or _contact(limb) > LAYERED_SHARE)]
    merged = [limb for limb in bare if limb is not None and not any(limb is x for x in layered)]

    # Owner of each pixel of the silhouette: the core or one of the layered limbs.
    core_excess = np.minimum(torso, head - head_radius(canvas, joints))
    core_excess = np.minimum(core_excess, thorax_distance(points, joints))
    for limb in merged:
        core_excess = np.minimum(core_excess, limb.excess(points)[0])
    uncovered = np.minimum.reduce([torso, *(limb.excess(points)[0] for limb in strictly if limb is not None)])
    below_hem = {}
    for limb in limbs:
        below_hem[limb.name] = inside & ~covered[limb.name][nearest_circle(limb, points)]
        hidden = keep(limb, covered[limb.name])
        if hidden is not None and covered[limb.name].any():
            cloth = hidden.excess(points)[0]
            core_excess = np.minimum(core_excess, cloth)
            garment |= inside & (cloth < uncovered)
    owner = owners(canvas, core_excess, layered, points)
    for index, limb in enumerate(layered, start=1):
        if limb.cloth:
            # Above the hem the drawing shows cloth, below it the leg: the hem runs across the leg.
            stump = below_hem[limb.name] & (limb.excess(points)[0] < 0.3 * limb.radius[-1])
            garment &= ~stump
            owner[garment & (owner == index)] = 0
            owner[stump & (owner == 0)] = index
    props = find_props(canvas)
    for index, prop in enumerate(props, start=len(layered) + 1):
        owner[prop.shown] = index

    layers: list[Layer] = []
    completed = owner == 0
    for index, limb in enumerate(layered, start=1):
        excess, nearest = limb.excess(points)
        region = inside & ((owner == index) | (excess < 0))
        region = _with_chain(region, excess)
        computed = np.where(region, limb.part_of(nearest), np.uint8(0))
        shown = owner == index
        layers.append(Layer(limb.name, region, _as_given(computed, canvas, shown, limb.part), limb, shown))
        if limb.cloth:
            continue
        # Behind a limb the core continues: inside the torso, around the root joint, and where it is on both sides.
        root = np.linalg.norm(points - limb.points[0], axis=-1) < 1.3 * limb.radius[0]
        behind = closing(owner == 0, 1.5 * float(np.median(limb.radius)) / canvas.pitch)
        completed |= inside & region & ((torso < 0) | root | behind)
    for number, prop in enumerate(props, start=1):
        labels = np.where(prop.region, np.uint8(PART["prop"]), np.uint8(0))
        layers.append(Layer(f"prop-{number}", prop.region, labels, None, prop.shown))
        wide = float(ndimage.distance_transform_edt(prop.region).max())
        completed |= prop.region & ((torso < 0) | closing(owner == 0, 1.5 * wide))
    # Detached pieces that only a limb claimed but does not reach belong to the core, with all that is left of them.
    completed |= inside & ~np.logical_or.reduce([completed, *(layer.region for layer in layers)])
    core_labels = _core_labels(points, torso, head, merged, garment)
    taken = np.concatenate([np.zeros(0, np.uint8), *(limb.part for limb in layered)])
    own_parts = np.setdiff1d(np.arange(1, PART["hair"], dtype=np.uint8), taken)
    computed = np.where(completed, core_labels, np.uint8(0))
    core = Layer("core", completed, _as_given(computed, canvas, owner == 0, own_parts), None, owner == 0)

    labels = np.where(completed, core.labels, 0).astype(np.uint8)
    for index, layer in enumerate(layers, start=1):
        labels = np.where(owner == index, layer.labels, labels)
    return Split((core, *layers), tuple(limb for limb in bare if limb is not None), garment & (owner == 0), labels)


def _measured_limbs(
    canvas: Canvas,
    joints: NDArray[np.float64],
    visible: BoolArray,
    body: NDArray[np.float64],
    points: NDArray[np.float64],
) -> list[Limb]:
    limbs = [make_limb(name, joints, visible) for name in LEGS_FIRST]
    bones = [chain_distance(limb, points) for limb in limbs]
    measured = []
    for index, limb in enumerate(limbs):
        rivals = np.minimum.reduce([np.maximum(body, 0.0), *(b for i, b in enumerate(bones) if i != index)])
        measured.append(measure(limb, canvas, rivals))
    stout = stoutness(measured)
    return [complete(limb, twin, stout, canvas.pitch) for limb, twin in zip(measured, twins(measured), strict=True)]


def _contact(limb: Limb) -> float:
    """Share of a limb's length, the root left out, that lies against or over something else."""
    beyond_root = limb.along > 1.4 * limb.radius[0] + 0.03
    if not beyond_root.any():
        return 0.0
    return float(1.0 - limb.free[beyond_root].all(axis=1).mean())


def _as_given(
    computed: NDArray[np.uint8], canvas: Canvas, shown: NDArray[np.bool_], parts: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Part labels of a layer, overridden by the user's where the drawing shows it: its own parts and extras."""
    given = canvas.labels
    wanted = shown & (computed > 0) & (np.isin(given, parts) | (given >= PART["hair"]))
    return np.where(wanted, given, computed).astype(np.uint8)


def _with_chain(region: NDArray[np.bool_], excess: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Pieces of a limb's region that contain some of its chain."""
    pieces, count = ndimage.label(region, np.ones((3, 3)))
    if count < 2:
        return region
    held = np.unique(pieces[region & (excess < 0)])
    return np.isin(pieces, held[held > 0])


def _core_labels(
    points: NDArray[np.float64],
    torso: NDArray[np.float64],
    head: NDArray[np.float64],
    merged: list[Limb],
    garment: NDArray[np.bool_],
) -> NDArray[np.uint8]:
    distances = [torso, head]
    parts: list[NDArray[np.uint8]] = [np.full(torso.shape, PART["torso"]), np.full(torso.shape, PART["head"])]
    for limb in merged:
        excess, nearest = limb.excess(points)
        distances.append(excess)
        parts.append(limb.part_of(nearest))
    nearest_part = np.argmin(np.stack(distances), axis=0)
    labels = np.take_along_axis(np.stack(parts), nearest_part[None], axis=0)[0]
    return np.where(garment, PART["garment"], labels).astype(np.uint8)


def head_radius(canvas: Canvas, joints: NDArray[np.float64]) -> float:
    """Half width of the head, FIGURE units: distance from its centre to the contour."""
    depth = -float(canvas.sample(canvas.sdf, joints[None, JOINT["head"], :2])[0])
    return max(depth, MIN_HEAD_RADIUS)
