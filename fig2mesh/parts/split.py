"""Split a silhouette into layers and body parts by the skeleton.

The body is drawn as layers: a core (torso, head, and every limb that lies free of them) and the limbs that touch or
cross something else. Each layer has a complete outline of its own: the torso goes on behind the arm in front of it,
so that inflating it does not leave a trench where the arm is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.limbs import STOUT, Limb, complete, make_limb, measure, stoutness
from fig2mesh.parts.owners import owners
from fig2mesh.parts.props import find_props
from fig2mesh.records import BoolArray
from fig2mesh.skeleton import JOINT, LIMBS, PART

LAYERED_SHARE = 0.22
"""Limbs with a larger share of their length against something else become layers of their own."""

HEAD_RADIUS_MIN = 0.05

LEGS_FIRST = sorted(LIMBS, key=lambda limb: limb.endswith("arm"))
"""Limbs in the order in which they are measured and claim their layers."""

CLOTHED = 4
"""Circles of a leg that cloth covers before the rest of the leg becomes a layer of its own that comes out of it."""

NARROWER = 0.65
"""Such a leg is narrower than this share of the cloth above it."""

REACH_UNDER = 3
"""Circles that such a leg goes on under the cloth."""


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
    """The layers of a figure, the core first, props last, and all its limbs (also those in the core).

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
    torso = _polygon_distance(points, joints[[JOINT[n] for n in ("l_shoulder", "r_shoulder", "r_hip", "l_hip")], :2])
    head = _segment_distance(points, joints[JOINT["neck"], :2], joints[JOINT["head"], :2])
    limbs = _measured_limbs(canvas, joints, visible, np.minimum(torso, head), points)

    garment = np.zeros(inside.shape, bool)
    covered = {}
    for limb, other in zip(limbs, _twins(limbs), strict=True):
        if limb.is_arm:
            covered[limb.name] = np.zeros(len(limb.points), bool)
        else:
            covered[limb.name] = _under_cloth(limb, other, visible) | _labelled_cloth(limb, canvas)
    covered = _same_hem(limbs, covered)
    strictly = [_keep(limb, ~covered[limb.name]) for limb in limbs]
    bare = [_keep(limb, ~_shortened(covered[limb.name])) for limb in limbs]
    bare = [
        _clothed(b, covered[limb.name]) if b is not None and _steps_out(limb, covered[limb.name]) else b
        for b, limb in zip(bare, limbs, strict=True)
    ]
    layered = [limb for limb in bare if limb is not None and (limb.cloth or _contact(limb) > LAYERED_SHARE)]
    merged = [limb for limb in bare if limb is not None and not any(limb is x for x in layered)]

    # Who owns each pixel of the silhouette: the core or one of the layered limbs.
    core_excess = np.minimum(torso, head - head_radius(canvas, joints))
    core_excess = np.minimum(core_excess, _thorax_distance(points, joints))
    for limb in merged:
        core_excess = np.minimum(core_excess, limb.excess(points)[0])
    uncovered = np.minimum.reduce([torso, *(limb.excess(points)[0] for limb in strictly if limb is not None)])
    below_hem = {}
    for limb in limbs:
        below_hem[limb.name] = inside & ~covered[limb.name][_nearest_circle(limb, points)]
        hidden = _keep(limb, covered[limb.name])
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
        # Behind a limb the core goes on: inside the torso, around the root joint, and where it is on both sides.
        root = np.linalg.norm(points - limb.points[0], axis=-1) < 1.3 * limb.radius[0]
        behind = closing(owner == 0, 1.5 * float(np.median(limb.radius)) / canvas.pitch)
        completed |= inside & region & ((torso < 0) | root | behind)
    for number, prop in enumerate(props, start=1):
        labels = np.where(prop.region, np.uint8(PART["prop"]), np.uint8(0))
        layers.append(Layer(f"prop-{number}", prop.region, labels, None, prop.shown))
        wide = float(ndimage.distance_transform_edt(prop.region).max())
        completed |= prop.region & ((torso < 0) | closing(owner == 0, 1.5 * wide))
    # Detached pieces that only a limb claimed but does not reach belong to the core, whatever is left of them.
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
    bones = [_chain_distance(limb, points) for limb in limbs]
    measured = []
    for index, limb in enumerate(limbs):
        rivals = np.minimum.reduce([np.maximum(body, 0.0), *(b for i, b in enumerate(bones) if i != index)])
        measured.append(measure(limb, canvas, rivals))
    stout = stoutness(measured)
    return [complete(limb, twin, stout, canvas.pitch) for limb, twin in zip(measured, _twins(measured), strict=True)]


def _twins(limbs: list[Limb]) -> list[Limb]:
    by_name = {limb.name: limb for limb in limbs}
    return [by_name[("r" if limb.name[0] == "l" else "l") + limb.name[1:]] for limb in limbs]


def _shortened(covered: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """What is covered without its end: a leg goes on a little way under its cloth."""
    result = covered.copy()
    result[: len(covered) - REACH_UNDER] &= covered[REACH_UNDER:]
    result[len(covered) - REACH_UNDER :] &= covered.all()
    return result


def _steps_out(limb: Limb, covered: NDArray[np.bool_]) -> bool:
    """Whether a leg comes out of its cloth much narrower than the cloth is, as out of a skirt."""
    if covered.sum() < CLOTHED or covered.all():
        return False
    below = limb.radius[~covered][: 2 * REACH_UNDER]
    above = limb.width[covered][-2 * REACH_UNDER :].sum(axis=1) / 2
    return float(np.median(below)) < NARROWER * float(np.median(above))


def _clothed(bare: Limb, covered: NDArray[np.bool_]) -> Limb:
    """A leg that comes out of cloth; under it, where only the cloth can be measured, as thick as just below."""
    under = len(bare.points) - int((~covered).sum())
    radius = bare.radius.copy()
    radius[:under] = np.median(radius[under : under + REACH_UNDER])
    return replace(bare, radius=radius, cloth=True)


def _keep(limb: Limb, chosen: NDArray[np.bool_]) -> Limb | None:
    """The limb reduced to some of its circles; None where fewer than two are left."""
    if chosen.all():
        return limb
    if chosen.sum() < 2:
        return None
    arrays = {
        name: getattr(limb, name)[chosen]
        for name in ("points", "depth", "radius", "usual", "part", "ends", "free", "width", "seen")
    }
    return Limb(limb.name, **arrays, cloth=limb.cloth)


def _contact(limb: Limb) -> float:
    """Share of a limb's length, the root left out, that lies against or over something else."""
    beyond_root = limb.along > 1.4 * limb.radius[0] + 0.03
    if not beyond_root.any():
        return 0.0
    return float(1.0 - limb.free[beyond_root].all(axis=1).mean())


def _under_cloth(limb: Limb, twin: Limb, visible: BoolArray) -> NDArray[np.bool_]:
    """Which circles of a leg hang under a skirt, robe or gown.

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


def _labelled_cloth(limb: Limb, canvas: Canvas) -> NDArray[np.bool_]:
    """Which circles of a leg the label `garment` covers: from the hip down to the last one that has it."""
    rows, columns = np.round(canvas.pixels(limb.points)).astype(int).T
    height, width = canvas.labels.shape
    there = canvas.labels[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)] == PART["garment"]
    below = np.logical_or.accumulate(there[::-1])[::-1]
    return below if there.sum() > 0.5 * below.sum() else np.zeros_like(there)


def _same_hem(limbs: list[Limb], covered: dict[str, NDArray[np.bool_]]) -> dict[str, NDArray[np.bool_]]:
    """Cloth that covers one leg covers the other down to the same height, where that one has no contour of its own."""
    result = dict(covered)
    for limb, twin in zip(limbs, _twins(limbs), strict=True):
        if limb.is_arm or covered[limb.name].any() or not _steps_out(twin, covered[twin.name]):
            continue
        hem = twin.points[covered[twin.name], 1].min()
        if hem < limb.points[len(limb.points) * 2 // 5, 1]:
            # Long coats open in front: a leg steps out of them.
            continue
        inside_cloth = (limb.points[:, 1] > hem) & ~limb.free.all(axis=1)
        result[limb.name] = np.logical_and.accumulate(inside_cloth)
    return result


def _as_given(
    computed: NDArray[np.uint8], canvas: Canvas, shown: NDArray[np.bool_], parts: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Part labels of a layer with those that the user gave where the drawing shows it: its own parts and extras."""
    given = canvas.labels
    wanted = shown & (computed > 0) & (np.isin(given, parts) | (given >= PART["hair"]))
    return np.where(wanted, given, computed).astype(np.uint8)


def _with_chain(region: NDArray[np.bool_], excess: NDArray[np.float64]) -> NDArray[np.bool_]:
    """The pieces of a limb's region that hold some of its chain."""
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
    """Half width of the head: distance from its centre to the contour."""
    depth = -float(canvas.sample(canvas.sdf, joints[None, JOINT["head"], :2])[0])
    return max(depth, HEAD_RADIUS_MIN)


def _thorax_distance(points: NDArray[np.float64], joints: NDArray[np.float64]) -> NDArray[np.float64]:
    spine = _segment_distance(points, joints[JOINT["neck"], :2], joints[JOINT["pelvis"], :2])
    shoulders = joints[[JOINT["l_shoulder"], JOINT["r_shoulder"]], :2]
    hips = joints[[JOINT["l_hip"], JOINT["r_hip"]], :2]
    half = 0.25 * (np.linalg.norm(shoulders[1] - shoulders[0]) + np.linalg.norm(hips[1] - hips[0]))
    return spine - max(float(half), 0.04)


def _chain_distance(limb: Limb, points: NDArray[np.float64]) -> NDArray[np.float64]:
    distance, _ = cKDTree(limb.points).query(points.reshape(-1, 2))
    return np.asarray(distance).reshape(points.shape[:-1])


def _nearest_circle(limb: Limb, points: NDArray[np.float64]) -> NDArray[np.intp]:
    _, index = cKDTree(limb.points).query(points.reshape(-1, 2))
    return np.asarray(index).reshape(points.shape[:-1])


def _segment_distance(
    points: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    along = end - start
    t = np.clip(((points - start) @ along) / max(float(along @ along), 1e-12), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - t[..., None] * along, axis=-1))


def _polygon_distance(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed distance to a simple or self-crossing quadrilateral's even-odd interior."""
    distance = np.full(points.shape[:-1], np.inf)
    within = np.zeros(points.shape[:-1], bool)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        distance = np.minimum(distance, _segment_distance(points, start, end))
        straddles = (start[1] > points[..., 1]) != (end[1] > points[..., 1])
        rise = end[1] - start[1]
        if rise:
            cross = start[0] + (points[..., 1] - start[1]) / rise * (end[0] - start[0])
            within ^= straddles & (points[..., 0] < cross)
    return np.where(within, -distance, distance)


def closing(image: NDArray[np.bool_], radius: float) -> NDArray[np.bool_]:
    """Morphological closing by a disc, by distances: its cost does not grow with the radius (pixels)."""
    pad = int(radius) + 2
    grown = ndimage.distance_transform_edt(~np.pad(image, pad)) <= radius
    return np.asarray((ndimage.distance_transform_edt(grown) > radius)[pad:-pad, pad:-pad])
