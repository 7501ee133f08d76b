"""From FIGURE to ASSET: metres, feet on the ground, origin between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fig2mesh.paper import FIGURE_HEIGHT
from fig2mesh.parse.frame import ImageFrame
from fig2mesh.records import JOINT, FloatArray, Pose3D
from georef.frames import ASSET, FIGURE
from georef.transform import Transform

STANDING = 0.12
"""A foot this share of the figure's height above the other one does not stand."""


def asset_from_figure(pose: Pose3D, vertices: FloatArray, height_m: float) -> Transform:
    """The transform that puts the lowest vertex on the ground and the standing feet around the origin.

    Parameters
    ----------
    vertices : (V, 3) FIGURE, of the finest mesh
    height_m : height of the drawn figure, metres
    """
    scale = height_m / FIGURE_HEIGHT
    feet = np.stack([_foot(pose, side) for side in "lr"])
    standing = feet[:, 1] <= feet[:, 1].min() + STANDING * FIGURE_HEIGHT
    x, _, z = feet[standing].mean(axis=0)
    ground = float(vertices[:, 1].min())
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = -scale * np.array([x, ground, z])
    return Transform(ASSET, FIGURE, matrix)


def _foot(pose: Pose3D, side: str) -> NDArray[np.float64]:
    ankle, foot = (pose.joints[JOINT[f"{side}_{joint}"]].astype(np.float64) for joint in ("ankle", "foot"))
    return np.asarray((ankle + foot) / 2)


def on_drawing(frame: ImageFrame, asset: Transform) -> tuple[float, tuple[float, float]]:
    """ASSET metres a pixel of the drawing, and the pixel (x, y) under the ASSET origin.

    asset : ASSET from FIGURE
    """
    x, y = frame.image_from_figure(asset.inverse().apply(np.zeros((1, 3))))[0].tolist()
    return frame.units_per_px * float(asset.matrix[0, 0]), (x, y)
