"""Inking and colouring of doodles: fills, outlines, faces, crayon strokes, an unsteady hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import JOINT, PART
from fig2mesh.training.drawing.crop import MARGIN, Crop, cut, visible_joints
from fig2mesh.training.drawing.doodle_shapes import CANVAS, DoodleStyle, pixel, shapes_of
from fig2mesh.training.drawing.styles import BRIGHTS, HAIRS, INKS, MAP_TINTS, SKINS
from fig2mesh.training.drawing.thing_shapes import Thing
from fig2mesh.training.drawing.worn import things

FILL: Final = 0.66
"""Share of the canvas that the skeleton takes."""

Colour = tuple[float, ...]


def draw_doodle(joints: NDArray[np.float64], style: DoodleStyle, rng: np.random.Generator) -> Crop | None:
    tall = FILL * CANVAS
    ink: Colour = tuple(float(v) for v in list(INKS)[int(rng.integers(len(INKS)))])
    if rng.random() < 0.15:
        ink = tuple(rng.uniform(0, 140, 3).tolist())
    colours = _colours(style, ink, rng)
    canvas = DoodleCanvas(ink, style.line)
    shapes = shapes_of(joints, style, tall, rng)
    fake = np.zeros((CANVAS, CANVAS), np.uint8)
    worn = [t for t in things(joints, fake, rng) if rng.random() < 0.6]
    behind = [t for t in worn if not t.front]
    shapes = [*[_thing(t) for t in behind], *shapes, *[_thing(t) for t in worn if t.front]]
    outline = style.line > 0
    if style.union and outline:
        for label, mask in shapes:
            canvas.put(mask, label, ink, True)
    for label, mask in shapes:
        if not mask.any():
            continue
        fill = colours[label] if style.filled or label >= PART["hair"] or _thin(mask) else None
        if style.union and outline:
            inside = cv2.erode(mask, np.ones((2, 2), np.uint8))
            if style.filled:
                canvas.put(inside, label, fill, False)
            else:
                canvas.labels[mask > 127] = label
                canvas.cover[inside > 127] = 0.0
                if _thin(mask):
                    canvas.cover[mask > 127] = 1.0
        else:
            canvas.put(mask, label, fill, outline and not (_thin(mask) and style.limb < 0.03))
    _scribble(canvas, style, rng)
    face = _face(canvas, joints, style, tall, rng)
    visible = visible_joints(canvas.labels, joints[:, :2])
    visible[JOINT["eyes"]] &= face
    rgba = np.dstack([canvas.colour, canvas.cover * 255])
    rgba, labels = _wobbled(
        rgba, canvas.labels, rng.uniform(0, 5) if style.kind == "child" else rng.uniform(0, 1.5), rng
    )
    rgba[..., :3] = np.where(rgba[..., 3:] > 0, rgba[..., :3], 255)
    return cut(rgba.astype(np.uint8), labels, joints, visible, MARGIN)


class DoodleCanvas:
    """Picture of a doodle while it is drawn: colours, coverage and labels, `CANVAS` pixels square."""

    def __init__(self, ink: Colour, line: float) -> None:
        self.colour = np.zeros((CANVAS, CANVAS, 3), np.float32)
        self.cover = np.zeros((CANVAS, CANVAS), np.float32)
        self.labels = np.zeros((CANVAS, CANVAS), np.uint8)
        self.ink, self.line = ink, line

    def put(self, mask: NDArray[np.uint8], label: int, fill: Colour | None, outline: bool) -> None:
        """Draw a shape (H, W) 0/255 in front of the others; without a fill it hides only the lines under it."""
        half = max(round(self.line * CANVAS * FILL), 1)
        inside = mask > 127
        if outline and self.line > 0:
            grown = cv2.dilate(mask, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * (half // 2) + 1,) * 2)) > 127
            shrunk = (
                cv2.erode(mask, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * (half - half // 2) + 1,) * 2)) > 127
            )
            rim, inside = grown & ~shrunk, shrunk
            self.colour[rim], self.cover[rim] = self.ink, 1.0
            self.labels[grown] = label
        self.labels[inside] = label
        if fill is not None:
            self.colour[inside], self.cover[inside] = fill, 1.0
        elif outline:
            self.cover[inside] = 0.0


def _thin(mask: NDArray[np.uint8]) -> bool:
    return not cv2.erode(mask, np.ones((11, 11), np.uint8)).any()


def _thing(thing: Thing) -> tuple[int, NDArray[np.uint8]]:
    return thing.label, thing.mask.astype(np.uint8) * 255


def _colours(style: DoodleStyle, ink: Colour, rng: np.random.Generator) -> list[Colour]:
    """One colour per part label."""
    tints = BRIGHTS if rng.random() < 0.5 else MAP_TINTS

    def pick(options: Sequence[tuple[int, int, int]]) -> Colour:
        return tuple(float(v) for v in options[int(rng.integers(len(options)))])

    if style.solid:
        one = ink if style.kind in ("stick", "pictogram") and rng.random() < 0.7 else pick(tints)
        out = [one] * 18
        if rng.random() < 0.3:
            out[PART["head"]] = pick(SKINS)
        for label in (15, 16, 17):
            if rng.random() < 0.5:
                out[label] = pick(tints)
        return out
    skin, shirt, legs, shoes = pick(SKINS), pick(tints), pick(tints), pick(tints)
    bare, sleeves, trousers = rng.random() < 0.3, rng.random() < 0.5, rng.random() < 0.6
    out = [skin] * 18
    out[PART["torso"]] = shirt
    for side in "lr":
        out[PART[f"{side}_upper_arm"]] = skin if bare else shirt
        out[PART[f"{side}_lower_arm"]] = shirt if sleeves and not bare else skin
        out[PART[f"{side}_upper_leg"]] = legs
        out[PART[f"{side}_lower_leg"]] = legs if trousers else skin
        out[PART[f"{side}_foot"]] = shoes
    out[15], out[16], out[17] = pick(HAIRS), pick(tints), pick(tints)
    return out


def _face(
    canvas: DoodleCanvas, joints: NDArray[np.float64], style: DoodleStyle, tall: float, rng: np.random.Generator
) -> bool:
    """Draw eyes and mouth, at times; True where there are eyes."""
    head, eyes, neck = (joints[JOINT[name], :2] for name in ("head", "eyes", "neck"))
    averted = joints[JOINT["eyes"], 2] < joints[JOINT["head"], 2] - 1
    if (
        averted
        or rng.random() < {"stick": 0.6, "pictogram": 0.95, "child": 0.1, "blob": 0.6, "cartoon": 0.15}[style.kind]
    ):
        return False
    up = (head - neck) / max(float(np.linalg.norm(head - neck)), 1.0)
    across = np.array([-up[1], up[0]])
    radius = style.head * tall
    layer = np.zeros((CANVAS, CANVAS), np.uint8)
    dot = max(int(radius * rng.uniform(0.06, 0.14)), 1)
    for side in (-1, 1):
        cv2.circle(layer, pixel(eyes + side * across * radius * 0.32), dot, 255, -1 if rng.random() < 0.7 else 1)
    mouth = [
        eyes - up * radius * (0.6 - rng.normal(0.0, 0.1) * (x * x - 0.5)) + across * x * radius * 0.35
        for x in np.linspace(-1, 1, 5)
    ]
    cv2.polylines(layer, [np.rint(np.stack(mouth)).astype(np.int32)], False, 255, max(int(radius * 0.08), 1))
    on = (layer > 0) & (canvas.labels == PART["head"])
    under = canvas.colour[canvas.labels == PART["head"]]
    dark = len(under) > 0 and canvas.cover[canvas.labels == PART["head"]].mean() > 0.5 and under.mean() < 80
    canvas.colour[on], canvas.cover[on] = (
        ((255.0, 255.0, 255.0) if dark else tuple(min(v, 90) for v in canvas.ink)),
        1.0,
    )
    return True


def _scribble(canvas: DoodleCanvas, style: DoodleStyle, rng: np.random.Generator) -> None:
    """Draw strokes inside the figure: crayon, hatching, shading of blobs."""
    inside = canvas.labels > 0
    if style.kind == "blob" and rng.random() < 0.6:
        y, x = np.mgrid[:CANVAS, :CANVAS] / CANVAS
        light = 0.8 + 0.35 * np.sin(rng.uniform(2, 14) * (x * rng.normal() + y * rng.normal()) + rng.uniform(0, 6))
        canvas.colour = np.clip(canvas.colour * light[..., None], 0, 255).astype(np.float32)
    if rng.random() < (0.4 if style.kind == "child" else 0.12):
        layer = np.zeros((CANVAS, CANVAS), np.uint8)
        angle, gap = rng.uniform(0, np.pi), rng.uniform(5, 16)
        way, side = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        for place in np.arange(-CANVAS, CANVAS, gap):
            centre = np.array([CANVAS / 2, CANVAS / 2]) + side * (place + rng.normal(0, 2))
            cv2.line(layer, pixel(centre - way * CANVAS), pixel(centre + way * CANVAS), 255, int(rng.integers(1, 4)))
        chosen = np.isin(canvas.labels, rng.choice(np.arange(1, 18), int(rng.integers(3, 17)), replace=False))
        on = (layer > 0) & chosen & inside
        canvas.colour[on], canvas.cover[on] = canvas.ink, np.maximum(canvas.cover[on], rng.uniform(0.5, 1))


def _wobbled(
    rgba: NDArray[np.float32], labels: NDArray[np.uint8], amount: float, rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Warp the drawing as by an unsteady hand, `amount` pixels."""
    if amount < 0.3:
        return rgba, labels
    y, x = np.mgrid[:CANVAS, :CANVAS].astype(np.float32)
    coarse = rng.normal(0, 1, (2, 24, 24)).astype(np.float32)
    field = [cv2.resize(grid, (CANVAS, CANVAS), interpolation=cv2.INTER_CUBIC) * amount for grid in coarse]
    right, down = x + field[0], y + field[1]
    return (cv2.remap(rgba, right, down, cv2.INTER_LINEAR), cv2.remap(labels, right, down, cv2.INTER_NEAREST))
