"""Views of a subject from the four sides: rasters of body and skirt with their part labels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.camera import VIEW_YAW_DEG, axes
from fig2mesh.skeleton import PART
from fig2mesh.training.bodies.subject import Subject
from fig2mesh.training.drawing.raster import Raster, rasterise

VIEWS: tuple[NDArray[np.float64], ...] = tuple(axes(yaw) for yaw in VIEW_YAW_DEG.values())
"""The four sides of paper §3: p_view = VIEWS[k] @ p."""


SCENE = 448
"""Edge of the picture in which occlusion is decided, pixels."""


def scene(
    subject: Subject, view: int, size: int = SCENE
) -> tuple[Raster, NDArray[np.uint8], NDArray[np.float64], float]:
    """Rasterise one side: the raster of body and skirt, part labels, lower left corner and edge of a pixel."""
    body = subject.vertices @ VIEWS[view].T
    skirt = subject.skirt_vertices @ VIEWS[view].T
    vertices = np.concatenate([body, skirt])
    faces = np.concatenate([subject.rig.faces, subject.skirt_faces + len(body)])
    label = np.concatenate([subject.rig.face_part, np.full(len(subject.skirt_faces), PART["garment"], np.uint8)])
    low, high = vertices[:, :2].min(axis=0), vertices[:, :2].max(axis=0)
    pitch = float((high - low).max()) / (0.9 * size)
    corner = (low + high) / 2 - pitch * size / 2
    raster = rasterise(vertices, faces, size=size, low=corner, pitch=pitch)
    return raster, raster.pick(label), corner, pitch
