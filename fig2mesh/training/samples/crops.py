"""Crops for the figure parser: one drawn figure each, with transparency, part labels and joints."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.camera import axes
from fig2mesh.skeleton import JOINT, PART
from fig2mesh.training.bodies.pack import Pack
from fig2mesh.training.bodies.subject import Subject, draw_subject
from fig2mesh.training.drawing.background import draw_background
from fig2mesh.training.drawing.crop import MARGIN, ROOM, Crop, cut, visible_joints
from fig2mesh.training.drawing.draw import Layers, draw
from fig2mesh.training.drawing.pictures import view_face, view_layers
from fig2mesh.training.drawing.raster import rasterise
from fig2mesh.training.drawing.styles import random_style
from fig2mesh.training.drawing.worn import put_on, things

DRAWN: Final = 320
"""Edge of the picture that a crop is cut from, pixels."""

FILL: Final = 0.72
"""Share of that picture that the body takes."""


ON_PAPER: Final = 0.4
"""Share of crops that have a background of their own."""

YAWS: Final = ((0.0, 22.0, 0.64), (90.0, 22.0, 0.13), (-90.0, 22.0, 0.13), (180.0, 30.0, 0.1))
"""Mean and standard deviation of the camera's yaw, degrees, added to the body's own turn; and probability."""


def body_crops(pack: Pack, split: str, number: int, count: int = 4) -> list[Crop]:
    """Draw subject `number` of a split `count` times, each from another side and in another style."""
    subject = draw_subject(pack, split, number)
    rng = np.random.default_rng([7, number])
    crops = []
    for _ in range(count):
        mean, spread, _ = YAWS[int(rng.choice(len(YAWS), p=[share for *_, share in YAWS]))]
        crops.append(_draw(_turned(subject, float(rng.normal(mean, spread))), rng))
    return [crop for crop in crops if crop is not None]


def _turned(subject: Subject, yaw_deg: float) -> Subject:
    turn = axes(yaw_deg).T
    return replace(
        subject,
        vertices=subject.vertices @ turn,
        joints=subject.joints @ turn,
        skirt_vertices=subject.skirt_vertices @ turn,
    )


def _draw(subject: Subject, rng: np.random.Generator) -> Crop | None:
    raster, labels, corner, pitch = _front(subject)
    layers, _ = view_layers(subject, 0, raster, labels)
    materials = [*subject.rig.materials, "cloth.skirt"]
    topmost = [index for index, name in enumerate(materials) if name in ("hair", "hat")]
    layers = layers._replace(labels=np.where(np.isin(layers.material, topmost), PART["hair"], labels).astype(np.uint8))
    pixels = subject.joints * [1, 1, 1 / pitch]
    pixels[:, 0] = (subject.joints[:, 0] - corner[0]) / pitch
    pixels[:, 1] = DRAWN - (subject.joints[:, 1] - corner[1]) / pitch
    layers, materials = put_on(layers, materials, things(pixels, layers.labels, rng))
    colours = None
    if subject.colours is not None and rng.random() < 0.3:
        more = rng.uniform(0, 1, (len(materials) - len(subject.colours), 3))
        colours = np.concatenate([subject.colours, more]) * 255
    style = random_style(materials, rng, colours)
    face = view_face(subject.joints, corner, pitch, DRAWN) if rng.random() < 0.85 else None
    visible = visible_joints(layers.labels, pixels[:, :2])
    visible[JOINT["eyes"]] &= face is not None
    if rng.random() < ON_PAPER:
        paper = draw_background(style.background, (DRAWN, DRAWN), rng)
        picture = draw(layers, materials, rng, style=style, face=face, paper=paper)
        rgba = np.dstack([picture, np.full((DRAWN, DRAWN, 1), 255, np.uint8)])
        return cut(rgba, layers.labels, pixels, visible, ROOM)
    rgba = _cut_out(layers, materials, rng, replace(style, glaze=False, speckle=0.0), face)
    return cut(rgba, layers.labels, pixels, visible, MARGIN)


def _cut_out(layers: Layers, materials: list[str], rng: np.random.Generator, style, face) -> NDArray[np.uint8]:  # type: ignore[no-untyped-def]
    """(H, W, 4) uint8 colours and alpha of a drawing, computed from drawings on black and on white."""
    style = replace(style, background="white")
    drawn = []
    for ground in (0.0, 255.0):
        paper = np.full((DRAWN, DRAWN, 3), ground, np.float32)
        drawn.append(
            draw(layers, materials, copy.deepcopy(rng), style=style, face=face, paper=paper).astype(np.float32)
        )
    alpha = np.clip(1 - (drawn[1] - drawn[0]).mean(axis=-1, keepdims=True) / 255, 0, 1)
    colour = np.clip(drawn[0] / np.maximum(alpha, 1e-3), 0, 255)
    return np.concatenate([colour, alpha * 255], axis=-1).astype(np.uint8)


def _front(subject: Subject):  # type: ignore[no-untyped-def]
    """Rasterise the front as `drawing.scene.scene`, with room around the body."""
    vertices = np.concatenate([subject.vertices, subject.skirt_vertices])
    faces = np.concatenate([subject.rig.faces, subject.skirt_faces + len(subject.vertices)])
    label = np.concatenate([subject.rig.face_part, np.full(len(subject.skirt_faces), PART["garment"], np.uint8)])
    low, high = vertices[:, :2].min(axis=0), vertices[:, :2].max(axis=0)
    pitch = float((high - low).max()) / (FILL * DRAWN)
    corner = (low + high) / 2 - pitch * DRAWN / 2
    raster = rasterise(vertices, faces, size=DRAWN, low=corner, pitch=pitch)
    return raster, raster.pick(label), corner, pitch
