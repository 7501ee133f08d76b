"""Colours that a conversion bakes on unseen sides, on bodies whose true shape is known.

The front of a `TexturedSubject` goes through the stages of a conversion that decide colours: splitting into layers and
continuing their colours from the rim. Shapes stay the true ones, so that results can be compared pixel by pixel.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fig2mesh.image_frame import image_frame
from fig2mesh.parts.canvas import make_canvas
from fig2mesh.parts.layers import raise_layers
from fig2mesh.parts.outline import Outline
from fig2mesh.parts.split import split
from fig2mesh.pose.prior import lift
from fig2mesh.records import Figure
from fig2mesh.skeleton import JOINT
from fig2mesh.texture.sources import Sources, make_sources
from fig2mesh.training.samples.textured_subject import TexturedSubject

CANVAS_PX: Final = 512

MIN_DEPTH_GAP: Final = 0.02
"""Points this far behind the visible surface of the front are not visible in it, units of depth."""

TEXTURE: Final = 1024


def baked_sides(subject: TexturedSubject) -> NDArray[np.float32]:
    """(4, H, W, 3) 0-255, colours of the texels visible from each side."""
    sides = subject.sides
    size = sides.labels.shape[1]
    straight = _pixels(sides.places(), size)
    sources = _sources(subject)
    pixel = np.clip(straight.astype(int), 0, size - 1)
    depth = np.where(sides.labels[0] > 0, sides.points[0, ..., 2], -np.inf)
    drawn = sides.points[..., 2] >= depth[pixel[..., 1], pixel[..., 0]] - MIN_DEPTH_GAP
    drawn[2] = False
    result = sources.seen[pixel[..., 1], pixel[..., 0]]
    for label in np.unique(sides.shown[sides.shown > 0]):
        picture = sources.back.get(int(label), next(iter(sources.back.values())))
        own = ~drawn & (sides.shown == label)
        at = np.clip((straight[own] * sources.plain_scale).astype(int), 0, np.array(picture.shape[1::-1]) - 1)
        result[own] = picture[at[:, 1], at[:, 0]]
    return np.asarray(result, np.float32)


def _pixels(places: NDArray[np.floating], size: int) -> NDArray[np.float64]:
    """Convert positions with edges at -1 and 1 to pixels."""
    return np.asarray((np.asarray(places, np.float64) + 1) / 2 * size)


def _sources(subject: TexturedSubject) -> Sources:
    sides = subject.sides
    mask = sides.labels[0] > 0
    rgba = np.full((*mask.shape, 4), 255, np.uint8)
    rgba[..., :3] = np.clip(np.rint(subject.truth[0]), 0, 255)
    visible = np.ones(len(subject.joints_px), bool)
    visible[JOINT["eyes"]] = bool(subject.face.any())
    figure = Figure("subject", rgba, mask, subject.joints_px, visible, np.zeros(mask.shape, np.uint8))
    frame = image_frame(figure)
    canvas = make_canvas(figure, frame, CANVAS_PX)
    joints = lift(figure, frame).joints.astype(np.float64)
    divided = split(canvas, joints, visible)
    outline = Outline((), divided, raise_layers(canvas, divided, joints, "cpu"), canvas)
    return make_sources(figure, frame, outline, TEXTURE, 0)
