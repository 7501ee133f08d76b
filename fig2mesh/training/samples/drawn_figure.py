"""Drawn figures with known backs: both sides of a synthetic body, drawn by one hand in flat or cel-shaded colours.

Without a background, and with an unbroken contour: what is measured on them are colours, not tracing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.records import BoolArray, ByteArray, Figure
from fig2mesh.skeleton import BODY_PARTS, JOINT, JOINT_NAMES, PART, anchor_joints
from fig2mesh.training.bodies.occlusion import AVERTED
from fig2mesh.training.bodies.subject import Subject
from fig2mesh.training.drawing.draw import draw
from fig2mesh.training.drawing.pictures import view_face, view_layers
from fig2mesh.training.drawing.scene import VIEWS, scene
from fig2mesh.training.drawing.styles import Style, random_style
from fig2mesh.training.samples.textured_subject import face_region

PICTURE: Final = 512
"""Pixels of a picture's edge."""

SHRINK: Final = 2
"""Factor by which pictures are drawn larger, for smooth edges."""

FLAT: Final = 0.6
"""Share of figures in flat colours; the others are cel-shaded."""

MIN_WIDTH, MAX_WIDTH = 0.8, 2.2
"""Width of lines, pixels of a picture of 256 pixels."""

PAPER: Final = 255.0
UNLIKE_PAPER: Final = 100.0
"""Least difference of a channel between paper and the outer half of the contour."""

MIN_INK: Final = 24.0
"""Least difference of a channel between pictures with and without lines where there is a line."""

TRUNK: Final = {"head": (2,), "eyes": (2,), "neck": (1, 2), "thorax": (1,), "pelvis": (1,)}
"""Joint of the trunk → parts on which it is visible."""

FRONT, BACK = 0, 2


@dataclass(frozen=True)
class DrawnSide:
    """One side of a figure; pictures are (H, W, 3) uint8 on white paper.

    picture : as drawn; bare : without lines, its colours continued under the outer half of the contour and beyond
    mask : (H, W) bool, the silhouette, the contour included; inked : (H, W) bool, lines
    head : (H, W) bool; face : (H, W) bool, region of the head with eyes and mouth, empty where it is not visible
    """

    picture: ByteArray
    bare: ByteArray
    mask: BoolArray
    inked: BoolArray
    head: BoolArray
    face: BoolArray


@dataclass(frozen=True)
class DrawnFigure:
    """A figure and its true back.

    figure : the front as input of a conversion
    front, back : the back as it is seen from behind: the mirror image of the front's silhouette
    skin : (3,) 0-255; line_px : width of the contour, pixels
    """

    figure: Figure
    front: DrawnSide
    back: DrawnSide
    skin: NDArray[np.float32]
    line_px: float


def drawn_figure(subject: Subject, name: str, seed: int) -> DrawnFigure:
    """Draw a subject from the front and from behind."""
    rng = np.random.default_rng([2, seed])
    materials = [*subject.rig.materials, "cloth.skirt"]
    colours = None
    if subject.colours is not None and rng.random() < 0.3:
        colours = np.concatenate([subject.colours, rng.uniform(0, 1, (1, 3))]) * 255
    style = _plain(random_style(materials, rng, colours), rng)
    front, back = (_side(subject, materials, style, view, seed) for view in (FRONT, BACK))
    joints_px, visible = drawn_joints(subject, PICTURE)
    rgba = np.dstack([front.picture, np.full(front.mask.shape, 255, np.uint8)])
    figure = Figure(name, rgba, front.mask, joints_px, visible, np.zeros(front.mask.shape, np.uint8))
    skin = style.colours[materials.index("skin")] if "skin" in materials else np.full(3, np.nan, np.float32)
    return DrawnFigure(figure, front, back, skin, style.width * style.outline * PICTURE / 256)


def drawn_joints(subject: Subject, size: int) -> tuple[NDArray[np.float32], BoolArray]:
    """(21, 2) joints in pixels of the front picture of edge `size`, and (21,) bool whether they are visible there."""
    _, labels, corner, pitch = scene(subject, FRONT, size)
    joints_px = np.stack(
        [(subject.joints[:, 0] - corner[0]) / pitch, size - (subject.joints[:, 1] - corner[1]) / pitch], axis=1
    )
    showing = {name: set(TRUNK.get(name, ())) for name in JOINT_NAMES}
    for part in BODY_PARTS:
        for joint in anchor_joints(part):
            showing[JOINT_NAMES[joint]].add(part)
    columns, rows = np.clip(joints_px.astype(int), 0, size - 1).T
    visible = np.array([labels[r, c] in showing[name] for name, r, c in zip(JOINT_NAMES, rows, columns, strict=True)])
    face = subject.joints[JOINT["eyes"]] - subject.joints[JOINT["head"]]
    visible[JOINT["eyes"]] &= face[2] >= -AVERTED * float(np.linalg.norm(face))
    return joints_px.astype(np.float32), visible


def _plain(style: Style, rng: np.random.Generator) -> Style:
    """The style with a contour, in plain colours, and without the accidents of printing."""
    return replace(
        style,
        fill="flat" if rng.random() < FLAT else "steps",
        width=float(np.clip(style.width or rng.uniform(1.0, 1.6), MIN_WIDTH, MAX_WIDTH)),
        wobble=0.0,
        broken=0.0,
        glaze=False,
        slip=(0.0, 0.0),
        softness=0.0,
        speckle=0.0,
    )


def _side(subject: Subject, materials: list[str], style: Style, view: int, seed: int) -> DrawnSide:
    size = PICTURE * SHRINK
    raster, labels, corner, pitch = scene(subject, view, size)
    layers, _ = view_layers(subject, view, raster, labels)
    joints = subject.joints @ VIEWS[view].T
    face = view_face(joints, corner, pitch, size)
    paper = np.full((size, size, 3), PAPER, np.float32)
    # The same random numbers: the same light, the same lines, if any.
    picture, bare = (
        draw(
            layers, materials, np.random.default_rng([3, seed]), style=one, face=face, shrink=SHRINK, paper=paper.copy()
        )
        for one in (style, replace(style, width=0.0))
    )
    small = labels[SHRINK // 2 :: SHRINK, SHRINK // 2 :: SHRINK]
    mask = (small > 0) | (PAPER - picture.min(axis=2) > UNLIKE_PAPER)
    inked = np.abs(picture.astype(int) - bare).max(axis=2) > MIN_INK
    # The outermost pixels of the body are mixed with paper.
    body = ndimage.binary_erosion(small > 0)
    if body.any():
        bare = bare[tuple(ndimage.distance_transform_edt(~body, return_distances=False, return_indices=True))]
    head = small == PART["head"]
    joints_px = np.stack([(joints[:, 0] - corner[0]) / pitch, size - (joints[:, 1] - corner[1]) / pitch], axis=1)
    return DrawnSide(picture, bare, mask, inked, head, face_region(head, joints, joints_px / SHRINK, pitch * SHRINK))
