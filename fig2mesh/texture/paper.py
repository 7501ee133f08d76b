"""The paper's own way to colour a body: four sides painted by networks (§4.3 and §4.4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.field.body import Body
from fig2mesh.field.camera import VIEW_YAW_DEG
from fig2mesh.image_frame import ImageFrame
from fig2mesh.records import Pose3D
from fig2mesh.texture.painted import BlendedSides
from fig2mesh.texture.sides import side_pitch, trace_sides
from fig2mesh.texture.unobserved import TextureNets, front_picture, paint


def painted_sides(
    body: Body, pose: Pose3D, picture: NDArray[np.float32], frame: ImageFrame, nets: TextureNets
) -> BlendedSides:
    """Paint the four sides of a body.

    picture : (H, W, 3) 0-255, the drawing with its colours continued beyond the silhouette
    """
    sides = trace_sides(body, pose)
    bounds = body.bounds().astype(np.float64)
    size = sides.labels.shape[1]
    painted = paint(sides, front_picture(picture, frame, sides), nets)
    for side, shown in enumerate(sides.shown > 0):
        if shown.any():
            source = ndimage.distance_transform_edt(~shown, return_distances=False, return_indices=True)
            painted[side] = painted[side][tuple(source)]
    pitch = tuple(side_pitch(bounds, yaw, size) for yaw in VIEW_YAW_DEG.values())
    return BlendedSides(painted, sides.depth, bounds.mean(axis=0), pitch)
