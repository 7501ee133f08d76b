"""Things worn and carried beyond the clothes of the bodies: gowns, capes, long hair, hats, and things held in a hand.

Each thing is a shape in the picture with a depth; it goes into the `Layers` of a drawn body as a material of its own,
so that it is filled and outlined like the body.
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import JOINT, LIMB_PARTS, PART, SIDES
from fig2mesh.training.drawing.draw import Layers
from fig2mesh.training.drawing.held import held
from fig2mesh.training.drawing.thing_shapes import Points, Thing, at, body_length, ellipse, line, polygon, smooth

SHARES: Final = {"gown": 0.14, "cape": 0.07, "hair": 0.14, "hat": 0.2, "held": 0.28, "pack": 0.06}
"""Kind → probability that it is worn or carried."""

ARMS: Final = tuple(PART[f"{side}_{part}"] for side in SIDES for part in LIMB_PARTS["arm"])
OVER, UNDER = 0.02, 0.4
"""Distance of a thing in front of what it covers, and behind the body, FIGURE units."""


def things(joints: Points, labels: NDArray[np.uint8], rng: np.random.Generator) -> list[Thing]:
    """Choose at random the things that a body wears and carries.

    joints : (21, 3) x, y in pixels, z to the viewer in pixels; labels : (H, W) uint8 of the body
    """
    made: list[Thing] = []
    makers = {"cape": _cape, "pack": _pack, "gown": _gown, "hair": _hair, "hat": _hat, "held": held}
    for kind, make in makers.items():
        if rng.random() < SHARES[kind]:
            made += make(joints, labels.shape, rng)
    return [thing for thing in made if thing.mask.any()]


def put_on(layers: Layers, materials: list[str], worn: list[Thing]) -> tuple[Layers, list[str]]:
    """Add things to the layers; each adds a material."""
    labels, material = layers.labels.copy(), layers.material.astype(np.int32)
    depth, normals = layers.depth.copy(), layers.normals.copy()
    names = list(materials)
    for thing in worn:
        seen = labels > 0
        free = thing.mask & ~(seen & np.isin(labels, thing.spared)) if thing.front else thing.mask & ~seen
        if not free.any():
            continue
        near = depth[thing.mask & seen]
        middle = float(np.median(near)) if len(near) else 0.0
        labels[free], material[free] = thing.label, len(names)
        depth[free] = np.where(seen[free], depth[free], middle) + OVER if thing.front else middle - UNDER
        if thing.front:
            depth[free] = max(middle, float(np.quantile(near, 0.9)) if len(near) else middle) + OVER
        normals[free] = _bulge(free)[free]
        names.append(thing.material)
    return layers._replace(labels=labels, material=material, depth=depth, normals=normals), names


def _bulge(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(H, W, 3) normals of a shape that is round at its rim."""
    away = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 4)
    normal = np.stack(
        [-cv2.Sobel(away, cv2.CV_32F, 1, 0), cv2.Sobel(away, cv2.CV_32F, 0, 1), np.full(mask.shape, 0.3)], axis=-1
    )
    return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True), np.float32)


def _gown(joints: Points, shape: tuple[int, ...], rng: np.random.Generator) -> list[Thing]:
    """A skirt from the waist, or a robe from the chest, to somewhere between knees and ground."""
    tall = body_length(joints)
    pelvis, thorax = at(joints, "pelvis", "thorax")
    hips = np.stack(at(joints, "l_hip", "r_hip"))
    legs = np.stack(at(joints, "l_knee", "r_knee", "l_ankle", "r_ankle"))
    end = rng.uniform(0.5, 1.1)
    low = np.concatenate(
        [legs[:2] * (1 - end) + legs[2:] * end if end <= 1 else legs[2:] + [0, (end - 1) * tall * 0.3]]
    )
    down = low.mean(axis=0) - pelvis
    if np.linalg.norm(down) < 0.2 * tall:
        return []
    down /= np.linalg.norm(down)
    across = np.array([-down[1], down[0]])
    flare, waist = rng.uniform(0.05, 0.16) * tall, rng.uniform(0.05, 0.08) * tall
    top = pelvis - down * rng.uniform(0.02, 0.12) * tall
    if rng.random() < 0.35:
        top, waist = thorax + (pelvis - thorax) * rng.uniform(0.0, 0.4), rng.uniform(0.07, 0.1) * tall
    sides = (low - pelvis) @ across
    left, right = float(min(sides.min(), 0)) - flare, float(max(sides.max(), 0)) + flare
    if rng.random() < 0.2:  # a train on the ground
        right += rng.uniform(0.05, 0.3) * tall
    reach = float(((low - pelvis) @ down).max())
    wide = float(np.abs((hips - pelvis) @ across).max()) + waist
    hem = [
        pelvis + across * (left + (right - left) * t) + down * (reach + rng.normal(0, 0.012) * tall)
        for t in np.linspace(0, 1, 6)
    ]
    outline = np.stack(
        [top - across * waist, pelvis - across * wide, *hem, pelvis + across * wide, top + across * waist]
    )
    mask = polygon(shape, smooth(outline))
    return [Thing(mask, PART["garment"], "cloth.gown", True, (*ARMS, PART["head"]) if rng.random() < 0.9 else ())]


def _cape(joints: Points, shape: tuple[int, ...], rng: np.random.Generator) -> list[Thing]:
    """Cloth from the shoulders or the crown that hangs behind: capes, veils."""
    tall = body_length(joints)
    left, right, pelvis, thorax, head = at(joints, "l_shoulder", "r_shoulder", "pelvis", "thorax", "head")
    down = (pelvis - thorax) / max(float(np.linalg.norm(pelvis - thorax)), 1.0)
    across = np.array([-down[1], down[0]])
    length, wide, drift = rng.uniform(0.3, 0.75) * tall, rng.uniform(0.1, 0.24) * tall, rng.normal(0, 0.1) * tall
    start = [left, right] if rng.random() < 0.7 else [head + across * 0.06 * tall, head - across * 0.06 * tall]
    start.sort(key=lambda point: float(point @ across))
    foot = thorax + down * length + across * drift
    outline = np.stack([start[0], foot - across * wide, foot + down * 0.03 * tall, foot + across * wide, start[1]])
    return [Thing(polygon(shape, smooth(outline)), PART["garment"], "cloth.cape", False)]


def _hair(joints: Points, shape: tuple[int, ...], rng: np.random.Generator) -> list[Thing]:
    """Long or wide hair: behind the head, or a bun, a tail, a beard before it."""
    head, eyes, neck = at(joints, "head", "eyes", "neck")
    up = head - neck
    size = max(float(np.linalg.norm(up)), 4.0)
    up, across = up / size, np.array([-up[1], up[0]]) / size
    averted = joints[JOINT["eyes"], 2] < joints[JOINT["head"], 2]
    kind = rng.choice(["long", "bob", "bun", "tail", "spikes", "beard"])
    if kind == "beard" and not averted:
        low = eyes - up * rng.uniform(0.9, 2.2) * size
        outline = np.stack(
            [eyes - up * 0.5 * size + across * 0.45 * size, low, eyes - up * 0.5 * size - across * 0.45 * size]
        )
        return [Thing(polygon(shape, smooth(outline)), PART["hair"], "hair", True)]
    if kind in ("long", "bob"):
        length, wide = (rng.uniform(1.2, 2.6) if kind == "long" else rng.uniform(0.4, 0.9)), rng.uniform(0.75, 1.3)
        aside, fall = across * wide * size, up * length * size
        lock = [
            head + up * size,
            head + 0.9 * aside + up * 0.5 * size,
            head + aside - fall,
            head - aside - fall,
            head - 0.9 * aside + up * 0.5 * size,
        ]
        mask = polygon(shape, smooth(np.stack(lock)))
        return [Thing(mask, PART["hair"], "hair", bool(averted))]
    if kind == "bun":
        where = head + up * rng.uniform(0.6, 1.1) * size + across * rng.normal(0, 0.5) * size
        radius = rng.uniform(0.25, 0.5) * size
        return [Thing(ellipse(shape, where, (radius, radius), 0), PART["hair"], "hair", bool(averted))]
    if kind == "spikes":
        angles = np.linspace(-1.6, 1.6, int(rng.integers(9, 23)))
        reach = np.where(np.arange(len(angles)) % 2, rng.uniform(1.05, 1.5), 0.6) * size
        outline = np.stack(
            [head + r * (up * np.cos(a) + across * np.sin(a)) for a, r in zip(angles, reach, strict=True)]
        )
        return [Thing(polygon(shape, outline), PART["hair"], "hair", bool(averted))]
    side = float(rng.choice([-1.0, 1.0]))
    way = np.stack(
        [
            head + up * 0.3 * size,
            head + across * side * size,
            head + across * side * rng.uniform(0.9, 1.4) * size - up * rng.uniform(0.5, 1.6) * size,
        ]
    )
    return [Thing(line(shape, smooth(way, False), rng.uniform(0.25, 0.5) * size), PART["hair"], "hair", False)]


def _hat(joints: Points, shape: tuple[int, ...], rng: np.random.Generator) -> list[Thing]:
    """A brim with a crown, a point, a cap, a crown of spikes."""
    head, neck = at(joints, "head", "neck")
    up = head - neck
    size = max(float(np.linalg.norm(up)), 4.0)
    up, across = up / size, np.array([-up[1], up[0]]) / size
    base = head + up * rng.uniform(0.35, 0.6) * size
    half, brim, high = rng.uniform(0.55, 0.8) * size, rng.uniform(0.6, 1.5) * size, rng.uniform(0.4, 1.3) * size
    kind = rng.choice(["brim", "point", "cap", "crown"], p=[0.4, 0.2, 0.3, 0.1])
    top = rng.uniform(0.4, 1.1) * half if kind in ("brim", "cap") else 0.05 * half
    outline = [
        base - across * half,
        base - across * top + up * high,
        base + across * top + up * high,
        base + across * half,
    ]
    if kind == "crown":
        teeth = [base + across * half * (1 - t / 3) + up * high * 0.6 * (1 if t % 2 == 0 else 0.5) for t in range(7)]
        outline = [base - across * half, *teeth[::-1], base + across * half]
    mask = polygon(shape, np.stack(outline) if kind != "cap" else smooth(np.stack(outline)))
    if kind == "brim" or (kind != "crown" and rng.random() < 0.3):
        mask |= ellipse(shape, base, (brim, rng.uniform(0.08, 0.25) * size), float(np.arctan2(across[1], across[0])))
    return [Thing(mask, PART["hair"], "hat", True)]


def _pack(joints: Points, shape: tuple[int, ...], rng: np.random.Generator) -> list[Thing]:
    """A bag on the back: behind the body seen from the front, before it from behind."""
    thorax, pelvis = at(joints, "thorax", "pelvis")
    tall, turned = body_length(joints), joints[JOINT["eyes"], 2] < joints[JOINT["head"], 2]
    side = joints[JOINT["head"], :2] - joints[JOINT["eyes"], :2]
    centre = (0.7 * thorax + 0.3 * pelvis) + np.array([np.sign(side[0]), 0]) * min(abs(side[0]), 0.1 * tall)
    box = rng.uniform(0.07, 0.13, 2) * tall * [1, 1.5]
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * box + centre
    return [Thing(polygon(shape, smooth(corner, steps=4)), PART["prop"], "cloth.pack", bool(turned), ARMS)]
