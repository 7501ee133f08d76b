"""The shapes that doodles are made of: a strip, an oval or a polygon along each bone of a skeleton."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import JOINT, LIMB_BONES, PART

CANVAS: Final = 512
"""Edge of the canvas that doodles are drawn on, pixels."""


@dataclass(frozen=True)
class DoodleStyle:
    """Way to draw a doodle; lengths are shares of the figure's height.

    limb : width of arms and legs; taper : how much narrower their ends are; torso : half width; head : radius
    rubber : how much limbs bend; gap : between head and body; line : width of outlines, 0 for none
    union : one outline around all, instead of one per part; filled : fill areas; solid : one colour for all
    """

    kind: str
    limb: float
    taper: float
    torso: float
    head: float
    rubber: float
    gap: float
    line: float
    union: bool
    filled: bool
    solid: bool
    torso_shape: str
    ends: float


def shapes_of(
    joints: NDArray[np.float64], style: DoodleStyle, tall: float, rng: np.random.Generator
) -> list[tuple[int, NDArray[np.uint8]]]:
    """Return (part label, mask) of each part from back to front."""
    at = joints[:, :2]
    limb = style.limb * tall
    shapes: list[tuple[float, int, NDArray[np.uint8]]] = []
    depth = joints[:, 2] / max(tall, 1)
    bend = {f"{side}_{half}": rng.normal(0, style.rubber) for side in "lr" for half in ("arm", "leg")}
    for side in "lr":
        for kind, (start, end) in LIMB_BONES.items():
            half = "arm" if kind in ("upper_arm", "lower_arm", "hand") else "leg"
            wide = limb * (1.0 if half == "arm" else rng.uniform(1.0, 1.3) if style.kind != "stick" else 1.0)
            first, last = at[JOINT[f"{side}_{start}"]], at[JOINT[f"{side}_{end}"]]
            widths = {
                "upper_arm": (1, 1),
                "lower_arm": (1, style.taper),
                "upper_leg": (1.15, 1),
                "lower_leg": (1, style.taper),
            }
            w0, w1 = widths.get(kind, (style.taper, style.taper))
            mask = np.zeros((CANVAS, CANVAS), np.uint8)
            if style.kind == "blob" and kind not in ("hand", "foot") and style.limb > 0.045:
                _oval(mask, first, last, wide * 0.7)
            else:
                _strip(mask, first, last, wide * w0, wide * w1, bend[f"{side}_{half}"])
            if kind in ("hand", "foot") and style.ends > 0:
                size = max(style.ends * tall, 0.6 * wide)
                centre = last if kind == "hand" else (first + last) / 2
                angle = np.degrees(np.arctan2(*(last - first)[::-1])) if np.linalg.norm(last - first) > 1 else 0
                stretch = 1.0 if kind == "hand" else rng.uniform(1.2, 2.2)
                cv2.ellipse(mask, pixel(centre), (int(size * stretch) + 1, int(size) + 1), angle, 0, 360, 255, -1)
                if kind == "hand" and rng.random() < 0.3:
                    _fingers(mask, last, last - at[JOINT[f"{side}_elbow"]], tall, style, rng)
            z = float(depth[JOINT[f"{side}_{end}"]]) * (1.0 if abs(depth[JOINT[f"{side}_{end}"]]) > 0.08 else 0.1)
            shapes.append((z, PART[f"{side}_{kind}"], mask))
    shapes.append((0.0, PART["torso"], _torso(at, style, tall, rng)))
    head = np.zeros((CANVAS, CANVAS), np.uint8)
    up = at[JOINT["head"]] - at[JOINT["neck"]]
    radius = style.head * tall
    angle = float(np.degrees(np.arctan2(up[1], up[0])))
    radii = (int(radius * rng.uniform(0.95, 1.2)) + 1, int(radius * rng.uniform(0.85, 1.1)) + 1)
    cv2.ellipse(head, pixel(at[JOINT["head"]]), radii, angle, 0, 360, 255, -1)
    if style.gap == 0:
        neck = np.zeros_like(head)
        _strip(neck, at[JOINT["thorax"]], at[JOINT["head"]], max(limb * 0.9, 2), max(limb * 0.9, 2), 0.0)
        shapes.append((-0.01, PART["torso"], neck))
    shapes.append((0.05, PART["head"], head))
    return [(label, mask) for _, label, mask in sorted(shapes, key=lambda shape: shape[0])]


def _torso(at: NDArray[np.float64], style: DoodleStyle, tall: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    mask = np.zeros((CANVAS, CANVAS), np.uint8)
    neck, pelvis, thorax = at[JOINT["neck"]], at[JOINT["pelvis"]], at[JOINT["thorax"]]
    shoulders, hips = (np.stack([at[JOINT[f"{s}_{name}"]] for s in "lr"]) for name in ("shoulder", "hip"))
    half = style.torso * tall
    down = (pelvis - thorax) / max(float(np.linalg.norm(pelvis - thorax)), 1.0)
    across = np.array([-down[1], down[0]])
    limb = style.limb * tall
    if style.torso_shape == "line":
        _strip(mask, thorax, pelvis, max(limb, 2), max(limb, 2), 0.0)
        for joint in (*shoulders, *hips):
            base = thorax if np.linalg.norm(joint - thorax) < np.linalg.norm(joint - pelvis) else pelvis
            _strip(mask, base, joint, max(limb, 2), max(limb, 2), 0.0)
        return mask
    if style.torso_shape == "ellipse":
        top = neck if rng.random() < 0.6 else thorax
        centre = (top + pelvis) / 2
        angle = float(np.degrees(np.arctan2(down[1], down[0])))
        cv2.ellipse(
            mask,
            pixel(centre),
            (int(np.linalg.norm(pelvis - top) / 2 + 0.5 * limb) + 2, int(half) + 2),
            angle,
            0,
            360,
            255,
            -1,
        )
    elif style.torso_shape == "triangle":
        wide = half * rng.uniform(1, 2)
        corner = np.stack([neck, pelvis + down * limb + across * wide, pelvis + down * limb - across * wide])
        if rng.random() < 0.3:
            corner = np.stack([pelvis, thorax + across * wide, thorax - across * wide])
        cv2.fillPoly(mask, [np.rint(corner).astype(np.int32)], 255)
    elif style.torso_shape == "box":
        corner = np.stack(
            [
                thorax + across * half,
                pelvis + across * half * rng.uniform(0.7, 1.2),
                pelvis - across * half * rng.uniform(0.7, 1.2),
                thorax - across * half,
            ]
        )
        cv2.fillPoly(mask, [np.rint(corner).astype(np.int32)], 255)
    hull = cv2.convexHull(np.rint(np.concatenate([shoulders, hips, thorax[None], pelvis[None]])).astype(np.int32))
    cv2.fillPoly(mask, [hull], 255)
    reach = max(int(limb), 3) if style.torso_shape != "hull" else max(int(limb), int(half * 0.6), 3)
    for first, last in (
        (shoulders[0], shoulders[1]),
        (hips[0], hips[1]),
        (shoulders[0], hips[0]),
        (shoulders[1], hips[1]),
    ):
        cv2.line(mask, pixel(first), pixel(last), 255, reach)
    return mask


def _strip(mask: NDArray[np.uint8], first: Any, last: Any, w0: float, w1: float, bend: float) -> None:
    """A limb with round ends, bent sideways by a share of its length."""
    way = np.asarray(last) - first
    aside = np.array([-way[1], way[0]]) * bend
    t = np.linspace(0, 1, 9)[:, None]
    line = first + t * way + 4 * t * (1 - t) * aside * 0.5
    for index in range(8):
        width = w0 + (w1 - w0) * (index + 0.5) / 8
        cv2.line(mask, pixel(line[index]), pixel(line[index + 1]), 255, max(round(width), 1))


def _oval(mask: NDArray[np.uint8], first: Any, last: Any, half: float) -> None:
    way = np.asarray(last) - first
    angle = float(np.degrees(np.arctan2(way[1], way[0])))
    length = float(np.linalg.norm(way)) / 2
    cv2.ellipse(
        mask, pixel((np.asarray(first) + last) / 2), (int(length * 1.08) + 2, int(half) + 2), angle, 0, 360, 255, -1
    )


def _fingers(
    mask: NDArray[np.uint8], hand: Any, way: Any, tall: float, style: DoodleStyle, rng: np.random.Generator
) -> None:
    base = float(np.arctan2(way[1], way[0]))
    for angle in base + np.linspace(-0.9, 0.9, int(rng.integers(3, 6))):
        tip = hand + rng.uniform(0.03, 0.06) * tall * np.array([np.cos(angle), np.sin(angle)])
        cv2.line(mask, pixel(hand), pixel(tip), 255, max(int(style.limb * tall * 0.4), 2))


def pixel(point: Any) -> tuple[int, int]:
    return round(float(point[0])), round(float(point[1]))
