"""Bodies of the training data as if they had been traced, for the evaluation of textures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fig2mesh.records import Pose3D
from fig2mesh.skeleton import JOINT, PART
from fig2mesh.texture.sides import SideViews, body_labels
from fig2mesh.texture.space import inwards
from fig2mesh.training.samples.build import read_shard, shards
from fig2mesh.training.samples.texture_data import Drawings, load_drawings
from fig2mesh.training.samples.unfold import extend_colours, front_scale, places

FACE_WIDTH, FACE_UP, FACE_DOWN = 0.9, 0.35, 1.2
"""Half axes of the region of drawn features about the eyes, relative to their distance from the head's middle."""

FACING: Final = 0.15
"""Threshold above which a face is towards the viewer: how much nearer its eyes are than the head's middle, relative to
their distance."""

FILLED: Final = 0.9
"""Height of the figure above the picture's middle, as a share of half the edge."""


@dataclass(frozen=True)
class TexturedSubject:
    """One body of `Drawings` as if it were traced, and its front picture.

    sides : see `SideViews`; FIGURE x, y relative to the middle of the front
    front : (H, W, 3) float32, 0-255, colours extended beyond the silhouette
    truth : (4, H, W, 3) float32, 0-255
    face : (H, W) bool, region of the front with eyes and mouth
    joints_px : (21, 2) float32, pixels of the front
    """

    sides: SideViews
    front: NDArray[np.float32]
    truth: NDArray[np.float32]
    face: NDArray[np.bool_]
    joints_px: NDArray[np.float32]


def subjects(data: Path, split: str, limit: int) -> list[TexturedSubject]:
    """Load the first `limit` bodies of a split that have texture coordinates."""
    drawings = load_drawings(data, (split,), pictures=True, limit=limit)
    joints: list[NDArray[np.float32]] = []
    for path in shards(data, split):
        arrays = read_shard(path, ("joints", "uv"))
        joints += list(arrays["joints"][arrays["uv"].any(axis=(1, 2, 3, 4))])
    return [_subject(drawings, row, joints[row].astype(np.float32)) for row in range(len(drawings))]


def _subject(drawings: Drawings, row: int, joints: NDArray[np.float32]) -> TexturedSubject:
    labels, depth = drawings.labels[row], drawings.depth[row].astype(np.float32)
    place = places(labels, depth)
    size = labels.shape[1]
    pitch, middle_x = front_scale(labels, depth)
    half = pitch * size / 2
    # Depth of front and back; those of left and right follow from their columns.
    along = (np.arange(size) + 0.5 - size / 2) * pitch
    near = depth[0][labels[0] > 0]
    far = -depth[2][labels[2] > 0]
    middle = (float(near.max()) + float(far.min())) / 2
    z = np.stack(
        [
            depth[0],
            np.broadcast_to(middle - along, depth[1].shape),
            -depth[2],
            np.broadcast_to(middle + along, depth[3].shape),
        ]
    )
    points = np.concatenate([place * [half, -half], z[..., None]], axis=-1)
    points = np.where((labels > 0)[..., None], points, 0.0).astype(np.float32)
    picture = drawings.picture[row].astype(np.float32)
    # Joints are relative to the pelvis, pictures to the middle of the figure's box: the middle of the skull ties them.
    own = labels[0] == PART["head"]
    head = joints[JOINT["head"]]
    line = float(np.argwhere(own).mean(axis=0)[0]) + 0.5 if own.any() else size / 2
    across, down = (joints[:, 0] - middle_x) / pitch, (head[1] - joints[:, 1]) / pitch
    joints_px = np.stack([across + size / 2, down + line], axis=1)
    face = face_region(own, joints, joints_px, pitch)
    top = float(joints[:, 1].max())
    pose = Pose3D(np.concatenate([joints[:, :2] - [middle_x, top - half * FILLED], joints[:, 2:]], axis=1))
    sides = SideViews(body_labels(labels, points, pose), labels, depth, points, (0.0, 0.0), pitch)
    front = extend_colours(picture[0], inwards(labels[0] > 0))
    return TexturedSubject(sides, front, picture, face, joints_px.astype(np.float32))


def face_region(
    own: NDArray[np.bool_], joints: NDArray[np.floating], joints_px: NDArray[np.floating], pitch: float
) -> NDArray[np.bool_]:
    """(H, W) bool: region of the head (H, W) in which eyes and mouth are drawn.

    joints : (21, 3) VIEW; joints_px : (21, 2) pixels; pitch : edge of a pixel, units of the joints
    """
    head, eyes = (joints[JOINT[name]] for name in ("head", "eyes"))
    reach = float(np.linalg.norm(eyes - head))
    if not own.any() or eyes[2] - head[2] <= FACING * reach:
        return np.zeros_like(own)
    column, line = joints_px[JOINT["eyes"]]
    y, x = np.mgrid[: own.shape[0], : own.shape[1]] + 0.5
    across = (x - column) / (FACE_WIDTH * reach / pitch)
    up = (line - y) * pitch / reach
    return np.asarray((across**2 + np.where(up > 0, up / FACE_UP, up / FACE_DOWN) ** 2 < 1) & own)
