"""Heads from behind: no face, hair or hat where it was."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fig2mesh.image_frame import ImageFrame
from fig2mesh.parts.canvas import Canvas
from fig2mesh.records import Figure
from fig2mesh.skeleton import JOINT

FACE: Final = (0.6, -0.9, 0.25)
"""Half width, bottom and top of the middle of a face about the eyes, face radii."""

BESIDE: Final = (0.5, 2.2, -0.8, 0.4)
"""Distances aside and heights about the eyes between which hair hangs beside a face, face radii."""

CROWN: Final = (1.2, 0.5)
"""Half width and least height above the eyes of the crown of a head, face radii."""

MIN_HAIR: Final = 0.03
"""Least area of hair beside a face, squares of the face radius."""

BRIM: Final = 1.6
"""Half width of a hat with a brim, face radii: what is below it is not hidden by the hat."""

NAPE: Final = -0.8
"""Greatest height of the lower end of hair about the eyes, face radii; and its quantile of what is hair in front."""

NAPE_QUANTILE: Final = 0.03

TOP: Final = 0.9
"""Height above the eyes from which a head is never bare where it has hair, face radii."""

SKIN_HUE, SKIN_LIGHT = 10.0, 28.0
"""Tolerances for shades of skin, CIELAB units: of a and b, and of L."""

PROFILE: Final = 0.55
"""Distance of the eyes from the middle of a head drawn in profile, head radii."""

NARROW: Final = 0.5
"""Largest distance between the shoulders of a body drawn in profile, lengths of the trunk."""


@dataclass(frozen=True)
class DrawnFace:
    """A face that is not drawn from behind.

    eyes : FIGURE x, y; up : unit vector; radius : FIGURE units
    """

    eyes: NDArray[np.float64]
    up: NDArray[np.float64]
    radius: float

    def at(self, points: NDArray[np.float64]) -> FacePositions:
        """Positions of (H, W, 2) FIGURE points."""
        offset = (points - self.eyes) / self.radius
        return FacePositions(offset @ np.array([self.up[1], -self.up[0]]), offset @ self.up, self.radius)


@dataclass(frozen=True)
class FacePositions:
    """aside, above : (H, W) position of each pixel about the eyes along the head's own axes, face radii;
    radius : FIGURE units"""

    aside: NDArray[np.float64]
    above: NDArray[np.float64]
    radius: float


def find_face(figure: Figure, frame: ImageFrame, canvas: Canvas) -> DrawnFace | None:
    """Face of a figure; None where it has none or is drawn from behind."""
    eyes, head, neck = (frame.figure_from_image(figure.joints_px[JOINT[n]]) for n in ("eyes", "head", "neck"))
    radius = -float(canvas.sample(canvas.sdf, head[None])[0])
    if not figure.visible[JOINT["eyes"]] or radius <= 0:
        return None
    up = head - neck
    up = up / max(float(np.linalg.norm(up)), 1e-9)
    height = abs(float((eyes - neck) @ up))
    return DrawnFace(eyes, up, min(radius, max(height / 2, 0.3 * radius)))


def in_profile(figure: Figure, frame: ImageFrame, canvas: Canvas) -> bool:
    """Whether a figure is drawn from the side: head and body. Flat drawings may have no eyes, but a place for them."""
    joints = frame.figure_from_image(figure.joints_px)
    eyes, head, neck, pelvis, left, right = (
        joints[JOINT[n]] for n in ("eyes", "head", "neck", "pelvis", "l_shoulder", "r_shoulder")
    )
    radius = -float(canvas.sample(canvas.sdf, head[None])[0])
    if radius <= 0:
        return False
    up = head - neck
    up = up / max(float(np.linalg.norm(up)), 1e-9)
    aside = abs(float(np.array([up[1], -up[0]]) @ (eyes - head)))
    trunk = float(np.linalg.norm(neck - pelvis))
    return aside > PROFILE * radius and float(np.linalg.norm(left - right)) < NARROW * trunk


@dataclass(frozen=True)
class HeadMaterials:
    """Materials of a head.

    skin : indices of those of the face; hair : index of that of the hair, or of the hat that takes its place
    nape : height of the lower end of the hair about the eyes, face radii
    """

    skin: NDArray[np.int_]
    hair: int
    nape: float


def head_materials(
    face: FacePositions,
    head: NDArray[np.bool_],
    index: NDArray[np.int_],
    clear: NDArray[np.bool_],
    colour: NDArray[np.float32],
    pitch: float,
) -> HeadMaterials | None:
    """Skin and hair of a head; None where it is bald or has no face.

    Parameters
    ----------
    head : (H, W) bool; index : (H, W) material; clear : (H, W) bool, pixels that are shown and no ink
    colour : (K, 3) of the materials; pitch : FIGURE units per pixel
    """
    own = head & clear
    aside, above = np.abs(face.aside), face.above
    middle = own & (aside < FACE[0]) & (above > FACE[1]) & (above < FACE[2])
    if not middle.any():
        return None
    skin = _shades(int(np.bincount(index[middle]).argmax()), colour)
    other = own & ~np.isin(index, skin)
    least = MIN_HAIR * (face.radius / pitch) ** 2
    beside = other & (aside > BESIDE[0]) & (aside < BESIDE[1]) & (above > BESIDE[2]) & (above < BESIDE[3])
    counts = np.bincount(index[beside], minlength=len(colour))
    if counts.max(initial=0) < least:
        crown = other & (aside < CROWN[0]) & (above > CROWN[1])
        counts = np.bincount(index[crown], minlength=len(colour))
        if counts.max(initial=0) < least:
            return None
        hat = int(counts.argmax())
        brim = other & (index == hat) & (above > 0)
        if aside[brim].max(initial=0) > BRIM and np.ptp(face.aside[brim]) > 2 * BRIM:
            # The brim hides no neck; below it there is the hair that shows at all, be it a moustache.
            below = other & (index != hat) & (aside < BESIDE[1]) & (above > FACE[1]) & (above < BESIDE[3])
            counts = np.bincount(index[below], minlength=len(colour))
            if counts.max(initial=0) < least:
                return None
    hair = int(counts.argmax())
    low = np.quantile(above[other & (index == hair)], NAPE_QUANTILE) if (other & (index == hair)).any() else NAPE
    return HeadMaterials(skin, hair, min(float(low), NAPE))


def covered_rim(
    material: NDArray[np.int_], votes: NDArray[np.float64], above: NDArray[np.float64], found: HeadMaterials
) -> NDArray[np.int_]:
    """(N,) materials of a head's rim with hair where the drawing has temples, ears and cheeks.

    material : (N,); votes : (N, K); above : (N,) height of each point about the eyes, face radii
    """
    bare = np.isin(material, found.skin) & (above > found.nape)
    rest = votes.copy()
    rest[:, found.skin] = 0.0
    best = np.where(rest.max(axis=1) > 0.15, rest.argmax(axis=1), found.hair)
    return np.where(bare, np.where(above > TOP, best, found.hair), material)


def _shades(material: int, colour: NDArray[np.float32]) -> NDArray[np.int_]:
    """Materials that are shades of one."""
    from skimage.color import rgb2lab

    apart = np.abs(rgb2lab(colour / 255.0) - rgb2lab(colour[material] / 255.0))
    return np.flatnonzero((np.hypot(apart[:, 1], apart[:, 2]) < SKIN_HUE) & (apart[:, 0] < SKIN_LIGHT))
