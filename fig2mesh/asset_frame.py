"""Transform from FIGURE to ASSET: metres, feet on the ground, origin between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fig2mesh.image_frame import ImageFrame, image_frame
from fig2mesh.records import Figure, FloatArray, Pose3D
from fig2mesh.skeleton import FIGURE_HEIGHT, JOINT
from georef.frames import ASSET, FIGURE
from georef.transform import Transform

STANDING_FOOT_SHARE = 0.12
"""Threshold, share of the figure's height: a foot this far above the other one does not stand."""


def asset_from_figure(pose: Pose3D, vertices: FloatArray, height_m: float) -> Transform:
    """Transform that puts the lowest vertex on the ground and the standing feet around the origin.

    Parameters
    ----------
    vertices : (V, 3) FIGURE, of the finest mesh
    height_m : height of the drawn figure, metres
    """
    scale = height_m / FIGURE_HEIGHT
    x, _, z = _stand(pose.joints)
    ground = float(vertices[:, 1].min())
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = -scale * np.array([x, ground, z])
    return Transform(ASSET, FIGURE, matrix)


def _stand(joints: FloatArray) -> NDArray[np.float64]:
    """(D,) mean position of the standing feet of (21, D) FIGURE joints."""
    feet = [[joints[JOINT[f"{side}_{joint}"]] for joint in ("ankle", "foot")] for side in "lr"]
    middles = np.array(feet, np.float64).mean(axis=1)
    standing = middles[:, 1] <= middles[:, 1].min() + STANDING_FOOT_SHARE * FIGURE_HEIGHT
    return np.asarray(middles[standing].mean(axis=0))


def foot_on_picture(figure: Figure) -> tuple[float, float]:
    """Pixel (x, y) between the standing feet, at the lowest row of the drawing, in the picture that the figure was cut
    from.

    It is the pixel under the ASSET origin, as far as that is known before there is a surface: the mesh, of finite
    triangles, may end a fraction of a pixel higher.
    """
    frame = image_frame(figure)
    stand = frame.image_from_figure(_stand(frame.figure_from_image(figure.joints_px).astype(np.float32)))
    bottom = float(np.flatnonzero(figure.mask.any(axis=1))[-1] + 1)
    x0, y0 = figure.origin_px
    return x0 + figure.step_px * float(stand[0]), y0 + figure.step_px * bottom


def height_on_picture(figure: Figure) -> float:
    """Height of a figure on the globe, in pixels of the picture that it was cut from."""
    return figure.step_px * FIGURE_HEIGHT / image_frame(figure).units_per_px


def on_drawing(frame: ImageFrame, asset: Transform) -> tuple[float, tuple[float, float]]:
    """ASSET metres per pixel of the drawing, and the pixel (x, y) under the ASSET origin.

    asset : ASSET from FIGURE
    """
    x, y = frame.image_from_figure(asset.inverse().apply(np.zeros((1, 3))))[0].tolist()
    return frame.units_per_px * float(asset.matrix[0, 0]), (x, y)
