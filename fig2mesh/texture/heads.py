"""Heads from behind: no face, hair or hat where it was."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parse.frame import ImageFrame
from fig2mesh.parts.outline import Outline
from fig2mesh.records import JOINT, Figure
from fig2mesh.texture.pen import STROKE

FACE_SHARE = 1.05
"""Half width of the face relative to the head's."""

LEAST_HAIR = 0.04
"""Share of the head that hair or hat must have to be carried on over its back."""

SHADE = 45.0
"""Colours of a head nearer to each other than this (RGB 0-255) are light and shade of one thing."""

HAIRLINE = 0.55
"""Height of the hairline above the eyes relative to the head's half width."""


def drawn_face(
    figure: Figure, frame: ImageFrame, outline: Outline, points: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], float]:
    """(h, w) bool: where the drawing shows a face from the front, and the head's half width, FIGURE units.

    Profiles and faceless heads have none to hide.
    """
    eyes, head, neck = (frame.figure_from_image(figure.joints_px[JOINT[n]]) for n in ("eyes", "head", "neck"))
    none = np.zeros(points.shape[:-1], bool)
    radius = -float(outline.canvas.sample(outline.canvas.sdf, head[None])[0])
    if not figure.visible[JOINT["eyes"]] or radius <= 0:
        return none, 0.0
    up = head - neck
    up = up / max(float(np.linalg.norm(up)), 1e-9)
    aside = abs(float(np.array([up[1], -up[0]]) @ (eyes - head)))
    if aside > 0.6 * radius:
        return none, 0.0
    # From the chin to a hairline half a head above the eyes; below the eyes as wide as the head.
    offset = points - eyes
    along, across = offset @ up, (points - head) @ np.array([up[1], -up[0]])
    rise = np.maximum(along, 0.0) / (HAIRLINE * radius)
    face = (rise**2 + (across / (FACE_SHARE * radius)) ** 2 < 1.0) & (along > -2.0 * radius)
    return np.asarray(face), radius


def back_of_head(
    kind: NDArray[np.int_],
    head: NDArray[np.bool_],
    face: NDArray[np.bool_],
    palette: NDArray[np.float32],
    index: NDArray[np.int_],
    weight: NDArray[np.float64],
    line: float,
    radius: float,
) -> NDArray[np.int_]:
    """(h, w) areas with the face in the colour of hair or hat beside it, heads in the few colours of their areas.

    Shades of one colour are that colour. A face without hair or hat around it keeps the head's colour.

    Parameters
    ----------
    kind : (h, w) colour of each pixel's area; head, face : (h, w) bool
    palette : (K, 3) 0-255; index : (h, w) palette colour of each pixel; weight : (K,) small for colours of strokes
    line : width of a contour, pixels; radius : how far beside the face its hair is looked for, pixels
    """
    colours = _area_colours(palette, index, head, weight, line)
    if not len(colours):
        return kind
    known = colours >= 0
    _, source = ndimage.distance_transform_edt(~(head & known[kind]), return_indices=True)
    areas = colours[kind[tuple(source)]] if (head & known[kind]).any() else kind
    face = face & head
    around = head & ~face & known[index]
    if not face.any() or not around.any():
        return np.where(head, areas, kind)
    few = np.where(known[index], colours[index], 0)
    skin = int(np.argmax(np.bincount(few[face & known[index]], minlength=len(palette))))
    hair = around & (few != skin)
    if hair.sum() < LEAST_HAIR * head.sum():
        hair = around
    # Right beside the face there is hair; above it there may be a hat, further out a rucksack.
    for square in (np.ones((1, 2 * int(radius) + 1)), np.ones((2 * int(radius) + 1,) * 2)):
        near = hair & ndimage.binary_dilation(face, square)
        if near.sum() >= LEAST_HAIR / 2 * head.sum():
            hair = near
            break
    hue = int(np.argmax(np.bincount(few[hair], minlength=len(palette))))
    return np.where(face, hue, np.where(head, areas, kind))


def _area_colours(
    palette: NDArray[np.float32],
    index: NDArray[np.int_],
    own: NDArray[np.bool_],
    weight: NDArray[np.float64],
    line: float,
) -> NDArray[np.int_]:
    """(K,) the colour that each palette colour counts as among those with areas, -1 for strokes and mixed rims.

    Empty where no colour has an area.
    """
    count = np.bincount(index[own], minlength=len(palette))
    result = np.full(len(palette), -1)
    for colour in np.argsort(-count, kind="stable"):
        area = own & (index == colour)
        if count[colour] < LEAST_HAIR * own.sum() or weight[colour] <= STROKE:
            continue
        if ndimage.distance_transform_edt(area).max() <= max(line, 1.0):
            continue
        larger = np.flatnonzero(result == np.arange(len(palette)))
        near = np.linalg.norm(palette[larger] - palette[colour], axis=1) < SHADE
        result[colour] = larger[near][0] if near.any() else colour
    return result if (result >= 0).any() else result[:0]
