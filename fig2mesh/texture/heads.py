"""Heads from behind: no face, hair or hat where it was."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.image_frame import ImageFrame
from fig2mesh.parts.outline import Outline
from fig2mesh.records import Figure
from fig2mesh.skeleton import JOINT
from fig2mesh.texture.pen import STROKE

FACE_SHARE = 1.05
"""Half width of the face relative to the head's."""

MIN_HAIR = 0.04
"""Least share of the head covered by hair or hat for it to continue over the back."""

SHADE = 18.0
"""Colour tolerance, CIELAB units: nearer colours of a head are light and shade of one thing."""

CHEEKS = (0.3, 0.7)
"""Start and end of temples and cheeks, shares of the height of the face."""

BRIM = 1.6
"""Width of hats relative to faces."""

FILLED = 0.4
"""Least share of an area that has its colour: mixed rims of lines dominate where nothing else does."""

HAIRLINE = 0.55
"""Height of the hairline above the eyes relative to the head's half width."""


def drawn_face(
    figure: Figure, frame: ImageFrame, outline: Outline, points: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], float]:
    """(h, w) bool: face drawn from the front; and the head's half width, FIGURE units.

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
    line : width of a contour, pixels; radius : search distance for hair beside the face, pixels
    """
    colours = _area_colours(palette, kind, index, head, weight, line)
    if not len(colours):
        return kind
    known = colours >= 0
    _, source = ndimage.distance_transform_edt(~(head & known[kind]), return_indices=True)
    areas = colours[kind[tuple(source)]] if (head & known[kind]).any() else kind
    face = face & head
    around = head & ~face & known[kind]
    if not face.any() or not around.any():
        return np.where(head, areas, kind)
    few = np.where(known[kind], colours[kind], 0)
    skin = int(np.argmax(np.bincount(few[face & known[kind]], minlength=len(palette))))
    hair = around & (few != skin)
    if hair.sum() < MIN_HAIR * head.sum():
        hair = around
    # Right beside cheeks and temples there is hair; above there may be a hat, below a scarf, further out a rucksack.
    rows = np.flatnonzero(face.any(axis=1))
    cheeks = face.copy()
    cheeks[: int(np.quantile(rows, CHEEKS[0]))] = cheeks[int(np.quantile(rows, CHEEKS[1])) :] = False
    wide = 2 * int(radius) + 1
    beside = hair & ndimage.binary_dilation(cheeks, np.ones((1, wide)))
    over = hair & ndimage.binary_dilation(face, np.ones((wide, wide)))
    if beside.sum() >= MIN_HAIR / 4 * head.sum():
        hair = beside
    elif np.ptp(np.flatnonzero(hair.any(axis=0))) > BRIM * np.ptp(np.flatnonzero(face.any(axis=0))):
        # A hat with a brim and no hair: a bare neck, not a hood.
        return np.where(face, skin, np.where(head, areas, kind))
    elif over.sum() >= MIN_HAIR / 2 * head.sum():
        hair = over
    hue = int(np.argmax(np.bincount(few[hair], minlength=len(palette))))
    return np.where(face, hue, np.where(head, areas, kind))


def _area_colours(
    palette: NDArray[np.float32],
    kind: NDArray[np.int_],
    index: NDArray[np.int_],
    own: NDArray[np.bool_],
    weight: NDArray[np.float64],
    line: float,
) -> NDArray[np.int_]:
    """(K,) index of the colour with areas that each palette colour is merged into, -1 for strokes and mixed rims.

    Empty where no colour has an area.
    """
    from skimage.color import rgb2lab

    lab = rgb2lab(palette / 255.0)
    count = np.bincount(kind[own], minlength=len(palette))
    result = np.full(len(palette), -1)
    for colour in np.argsort(-count, kind="stable"):
        area = own & (kind == colour)
        if count[colour] < MIN_HAIR * own.sum() or weight[colour] <= STROKE:
            continue
        if ndimage.distance_transform_edt(area).max() <= max(line, 1.0):
            continue
        alike = np.flatnonzero(np.linalg.norm(lab - lab[colour], axis=1) < SHADE)
        if np.isin(index[area], alike).mean() < FILLED:
            continue
        larger = np.flatnonzero(result == np.arange(len(palette)))
        near = np.isin(larger, alike)
        result[colour] = larger[near][0] if near.any() else colour
    return result if (result >= 0).any() else result[:0]
