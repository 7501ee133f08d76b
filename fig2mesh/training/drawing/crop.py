"""One crop for the figure parser: a drawing cut out around its figure, and the visibility of its joints."""

from __future__ import annotations

from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import JOINT, JOINT_NAMES, PART, SIDES

SIZE: Final = 256
"""Edge of a crop, pixels."""


MARGIN, ROOM = 0.06, 0.3
"""Margin around a figure with transparency, and around one on a background of its own; share of its size."""


# fmt: off
_LIMBS: Final = {
    "shoulder": ("torso", "upper_arm"), "elbow": ("upper_arm", "lower_arm"), "wrist": ("lower_arm", "hand"),
    "hand": ("hand", "lower_arm"), "hip": ("torso", "upper_leg"), "knee": ("upper_leg", "lower_leg"),
    "ankle": ("lower_leg", "foot"), "foot": ("foot",),
}
# fmt: on


OWN: Final = {
    "head": ("head", "hair"),
    "eyes": ("head",),
    "neck": ("head", "torso", "hair"),
    "thorax": ("torso",),
    "pelvis": ("torso", "l_upper_leg", "r_upper_leg"),
    **{
        f"{side}_{joint}": tuple(part if part == "torso" else f"{side}_{part}" for part in parts)
        for side in SIDES
        for joint, parts in _LIMBS.items()
    },
}
"""A joint is drawn where its pixel, or one beside it, shows one of these parts."""


ALLOWED: Final = np.zeros((len(JOINT_NAMES), 18), bool)


for _joint, _parts in OWN.items():
    ALLOWED[JOINT[_joint], [PART[_part] for _part in _parts]] = True


class Crop(NamedTuple):
    """rgba : (256, 256, 4) uint8, straight alpha; all opaque where the figure has a background of its own
    labels : (256, 256) uint8, `PART_NAMES`; joints : (21, 2) float32, pixels; visible : (21,) bool"""

    rgba: NDArray[np.uint8]
    labels: NDArray[np.uint8]
    joints: NDArray[np.float32]
    visible: NDArray[np.bool_]


def cut(
    rgba: NDArray[np.uint8],
    labels: NDArray[np.uint8],
    joints: NDArray[np.floating],
    visible: NDArray[np.bool_],
    margin: float,
) -> Crop | None:
    """Cut out the square around the figure, resized to `SIZE`; None without a figure. Empty beyond the picture."""
    rows, columns = np.flatnonzero((labels > 0).any(axis=1)), np.flatnonzero((labels > 0).any(axis=0))
    if len(rows) < 8 or len(columns) < 4:
        return None
    side = max(rows[-1] - rows[0], columns[-1] - columns[0]) + 1
    edge = side * (1 + 2 * margin)
    low = np.array([columns[0] + columns[-1] + 1, rows[0] + rows[-1] + 1]) / 2 - edge / 2
    if margin == ROOM:
        edge = min(edge, float(min(labels.shape)))
        low = np.clip(low, 0, np.array(labels.shape[::-1]) - edge)
    scale = SIZE / edge
    matrix = np.array([[scale, 0, -low[0] * scale], [0, scale, -low[1] * scale]])
    premultiplied = rgba.astype(np.float32)
    premultiplied[..., :3] *= premultiplied[..., 3:] / 255
    # Areas are averaged where pixels get larger.
    soft = cv2.GaussianBlur(premultiplied, (0, 0), max(0.35 / scale, 0.1)) if scale < 0.9 else premultiplied
    moved = cv2.warpAffine(soft, _centred(matrix), (SIZE, SIZE), flags=cv2.INTER_LINEAR)
    moved[..., :3] *= 255 / np.maximum(moved[..., 3:], 1)
    turned = cv2.warpAffine(labels, _centred(matrix), (SIZE, SIZE), flags=cv2.INTER_NEAREST)
    placed = (np.asarray(joints, np.float64)[:, :2] - low) * scale
    return Crop(np.clip(np.rint(moved), 0, 255).astype(np.uint8), turned, placed.astype(np.float32), visible)


def _centred(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shift a matrix to OpenCV's pixel centres, which lie on whole numbers; elsewhere here they lie at +0.5."""
    out = matrix.copy()
    out[:, 2] += 0.5 * matrix[:, :2].sum(axis=1) - 0.5
    return out


def visible_joints(labels: NDArray[np.uint8], joints: NDArray[np.floating]) -> NDArray[np.bool_]:
    """(21,) bool: joints (21, 2) in pixels at which one of their own parts is visible."""
    height, width = labels.shape
    out = np.zeros(len(joints), bool)
    for index, (x, y) in enumerate(joints):
        column, row = int(x), int(y)
        if 0 <= column < width and 0 <= row < height:
            near = labels[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3]
            out[index] = ALLOWED[index, near].any()
    return out
