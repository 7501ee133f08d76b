"""Right-hand sides of the inflation, which set the thickness of each part of a layer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.skeleton import JOINT, PART, PART_NAMES

LOAD = {"torso": 0.95, "head": 3.0, "garment": 1.1, "foot": 2.2, "limb": 2.0}
"""Right-hand side of the inflation by kind of part: 2 makes a strip as deep as wide, 1 about 0.7 times; a torso is
two thirds as deep as wide, a head nearly a ball."""


FRONTAL_FOOT = 4.0
"""Additional load of a foot that points to the viewer: it is longer than it is drawn wide."""


def part_loads(joints: NDArray[np.float64]) -> NDArray[np.float64]:
    """Right-hand side of the inflation for every part label."""
    loads = np.array([LOAD.get(name, LOAD["limb"]) for name in PART_NAMES])
    for side in "lr":
        across, along = np.abs(joints[JOINT[f"{side}_foot"], :2] - joints[JOINT[f"{side}_ankle"], :2])
        sideways = across / max(0.8 * float(np.hypot(across, along)), 1e-9)
        loads[PART[f"{side}_foot"]] = LOAD["foot"] + FRONTAL_FOOT * max(0.0, 1.0 - float(sideways))
    return loads


def load_of(
    region: NDArray[np.bool_], labels: NDArray[np.uint8], loads: NDArray[np.float64], pitch: float
) -> NDArray[np.float64]:
    """(H, W) right-hand side of the inflation, without jumps between parts."""
    values = np.where(region, loads[labels], 0.0)
    blur = 0.03 / pitch
    cover = ndimage.gaussian_filter(region.astype(float), blur)
    return np.asarray(ndimage.gaussian_filter(values, blur) / np.maximum(cover, 1e-6))
