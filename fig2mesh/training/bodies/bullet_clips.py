"""Motion clips of the package `pybullet_data`, for use without other clips.

Each frame holds seconds, root position (3) and quaternions w, x, y, z, or one angle for a hinge, in the order of
`_CHANNELS`, local to the parent. Axes: x ahead, y up, z right; at rest the figure stands with its arms hanging.
"""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fig2mesh.training.bodies.retarget import Rotations, about, swings
from fig2mesh.training.bodies.rig import KEY, KEYS, T_POSE

# fmt: off
_CHANNELS: tuple[tuple[str, int, str], ...] = (
    ("hips", 4, ""), ("spine3", 4, "hips"), ("neck", 4, "spine3"),
    ("r_upper_leg", 4, "hips"), ("r_lower_leg", 1, "r_upper_leg"), ("r_foot", 4, "r_lower_leg"),
    ("r_upper_arm", 4, "spine3"), ("r_lower_arm", 1, "r_upper_arm"),
    ("l_upper_leg", 4, "hips"), ("l_lower_leg", 1, "l_upper_leg"), ("l_foot", 4, "l_lower_leg"),
    ("l_upper_arm", 4, "spine3"), ("l_lower_arm", 1, "l_upper_arm"),
)
# fmt: on
# fmt: off
_FOLLOWS = {
    "head": "neck", "l_clavicle": "spine3", "r_clavicle": "spine3", "l_hand": "l_lower_arm", "r_hand": "r_lower_arm",
}
# fmt: on
_HINGE = np.array([[0.0, 0.0, 1.0]])
_BODY_AXES = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


def motion_folder() -> Path | None:
    """Folder of the installed package's motions, None without the package."""
    spec = importlib.util.find_spec("pybullet_data")
    if spec is None or spec.origin is None:
        return None
    folder = Path(spec.origin).parent / "data" / "motions"
    return folder if folder.is_dir() else None


def read_motion(path: Path, frames: int) -> Rotations:
    """(N, 20, 3, 3) canonical rotations of at most `frames` evenly spaced frames; N = 0 for another skeleton."""
    rows = np.array(json.loads(path.read_text())["Frames"], np.float64)
    if rows.ndim != 2 or rows.shape[1] != 4 + sum(width for _, width, _ in _CHANNELS):
        return np.empty((0, len(KEYS), 3, 3))
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, frames).round().astype(int))]
    turned: dict[str, NDArray[np.float64]] = {}
    column = 4
    for key, width, parent in _CHANNELS:
        values = rows[:, column : column + width]
        column += width
        local = about(_HINGE.repeat(len(rows), 0), values[:, 0]) if width == 1 else _matrices(values)
        turned[key] = turned[parent] @ local if parent else local
    half = _halfway(turned["hips"], turned["spine3"])
    turned |= {"spine1": turned["hips"], "spine2": half} | {key: turned[above] for key, above in _FOLLOWS.items()}
    result = _BODY_AXES @ np.stack([turned[key] for key in KEYS], 1) @ _BODY_AXES.T
    for key, index in KEY.items():
        if key.endswith(("arm", "hand")):
            result[:, index] = result[:, index] @ swings(T_POSE[index], np.array([0.0, -1.0, 0.0]))
    return np.asarray(result)


def _matrices(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3, 3) rotations of quaternions w, x, y, z."""
    unit = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    vector = unit[:, 1:]
    return about(vector, 2 * np.arctan2(np.linalg.norm(vector, axis=1), unit[:, 0]))


def _halfway(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3, 3) rotations half way between two that are less than half a turn apart."""
    between = np.swapaxes(first, -1, -2) @ second
    axis = np.stack(
        [between[:, 2, 1] - between[:, 1, 2], between[:, 0, 2] - between[:, 2, 0], between[:, 1, 0] - between[:, 0, 1]],
        -1,
    )
    angle = np.arctan2(np.linalg.norm(axis, axis=1), np.trace(between, axis1=1, axis2=2) - 1)
    return np.asarray(first @ about(axis, angle / 2))
